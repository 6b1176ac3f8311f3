/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * rigid.h: rigid motions: quaternions (w, x, y, z), and a pose moved along a fixed one.
 *
 * Pure functions: any thread, nothing kept. Arguments are finite and quaternions of unit length.
 */
#ifndef RIGID_H
#define RIGID_H

#include "arris_types.h"

/* The rotation matrix of q, row by row: it turns what q turns. */
void rigid_matrix(const double q[4], double R[9]);

/* The quaternion of a rotation matrix, w >= 0. */
void rigid_quaternion(const double R[9], double q[4]);

/* Scales q to unit length. False when it is not one to within 1e-3, or not finite. */
bool rigid_normalise(double q[4]);

/* From a (f = 0) to b (f = 1) the short way, at constant rate (Shoemake 1985). */
void rigid_slerp(const double a[4], const double b[4], double f, double q[4]);

/* The pose of a body's frame B, given as arris_pose has it (C its origin, R world to B), to that of
 * a frame A which sits on the body: its origin at t of B, q turning A's axes to B's. The covariance
 * of (C, rotation vector in the world) moves with it: dC' = dC + w x (C' - C). */
void rigid_move(arris_pose *pose, const double t[3], const double q[4]);

#endif
