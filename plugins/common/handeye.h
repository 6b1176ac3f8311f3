/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * handeye.h: handeye.json, where the camera sits on the robot's flange.
 */
#ifndef HANDEYE_H
#define HANDEYE_H

#include "fault.h"

/* Camera to flange: a point p of the camera's axes is q p q* + t in the flange's. Its covariance is
 * common to all frames, so it is no part of a frame's: it is not read here. */
typedef struct handeye {
    double t[3]; /* mm */
    double q[4]; /* w, x, y, z */
} handeye;

/* Reads the n bytes of a handeye.json: {"camera_to_flange": {"x", "y", "z", "qw", "qx", "qy",
 * "qz"}}; other keys are ignored. Returns 0 or ARRIS_E_INPUT. */
int handeye_parse(const char *text, size_t n, const char *path, handeye *h, fault *f);

/* The same from a file; then also ARRIS_E_IO and ARRIS_E_MEMORY. */
int handeye_load(const char *path, handeye *h, fault *f);

#endif
