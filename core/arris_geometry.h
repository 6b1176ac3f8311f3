/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * arris_geometry.h: the geometry that all share: camera model, rotation and pose, 3D line.
 *
 * Pure functions: any thread, nothing allocated, nothing kept. Matrices are row by row. Arguments
 * must be finite; what a function does with degenerate ones is said beside it.
 */
#ifndef ARRIS_GEOMETRY_H
#define ARRIS_GEOMETRY_H

#include "arris_types.h"

#ifdef __cplusplus
extern "C" {
#endif
#pragma GCC visibility push(default)

/* Checks a camera's parameters: finite, positive focal lengths and size. NULL when they are good,
 * else what is wrong, a static string. */
const char *arris_camera_check(const arris_camera *c);

/* Whether the two models map every point alike: all parameters equal. Either may be NULL. */
bool arris_camera_same(const arris_camera *a, const arris_camera *b);

/* The same pinhole without its lens: `c` with zero distortion. */
arris_camera arris_camera_ideal(const arris_camera *c);

/* True when `c` has a distortion that is not zero. */
bool arris_camera_distorts(const arris_camera *c);

/* Ideal pixel (x, y) to the pixel where the lens puts it. Brown's model in Bouguet's convention:
 * x_d = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + tangential, on normalised coordinates. */
void arris_distort(const arris_camera *c, double x, double y, double *u, double *v);

/* The inverse of arris_distort by Newton's method, to 1e-9 px where the model is invertible.
 * Returns 0, or ARRIS_E_INPUT where it does not converge (outside the lens's valid circle); then
 * (x, y) holds the best that was found. */
int arris_undistort(const arris_camera *c, double u, double v, double *x, double *y);

/* R of the thesis's eq. 2.7 from (Omega, Theta, Kappa), the rotations about x, y and z, rad. */
void arris_rotation(double omega, double theta, double kappa, double R[9]);

/* The angles that arris_rotation turns into R; at theta = ±90° omega is 0. */
void arris_angles(const double R[9], double *omega, double *theta, double *kappa);

/* Projects the world point X (mm) by the pinhole of `c` (its distortion is not applied) at `pose`.
 * Writes the ideal pixel and returns the depth along the optical axis, mm; when that is not
 * positive the pixel is not written. */
double arris_project(const arris_camera *c, const arris_pose *pose, const double X[3], double *x,
                     double *y);

/* The bearing of an ideal pixel: the unit vector in the world from the camera centre. */
void arris_bearing(const arris_camera *c, const arris_pose *pose, double x, double y, double d[3]);

/* The plane through the camera centre and the image line through the ideal pixels (x1, y1) and
 * (x2, y2): n X = n C, n of unit length in the world (thesis, section 2.6). Returns 0, or
 * ARRIS_E_INPUT when the two pixels coincide. */
int arris_view_plane(const arris_camera *c, const arris_pose *pose, const double e[4], double n[3]);

/* Where the bearing d from C comes nearest to the line through X along the unit vector u: the
 * parameter along the line, mm from X. NAN when they are parallel to within 1e-9 rad. */
double arris_line_at(const double X[3], const double u[3], const double C[3], const double d[3]);

static inline double arris_dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
static inline void arris_cross(const double a[3], const double b[3], double c[3]) {
    double x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
    c[0] = x;
    c[1] = y;
}
/* Scales v to unit length and returns the length it had; a zero vector is left as it is. */
double arris_unit(double v[3]);

#pragma GCC visibility pop
#ifdef __cplusplus
}
#endif
#endif
