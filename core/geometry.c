/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * geometry.c: camera model, rotation and pose, 3D line (arris_geometry.h).
 *
 * The lens is Brown's model in Bouguet's convention; the rotation is the thesis's eq. 2.7. Lengths
 * named x, y are normalised camera coordinates unless they are arguments in pixels.
 */
#include "arris_geometry.h"

#include <math.h>

/* ---- vectors -------------------------------------------------------------------------------- */

double arris_unit(double v[3]) {
    double n = sqrt(arris_dot(v, v));
    if (n > 0)
        for (int i = 0; i < 3; i++)
            v[i] /= n;
    return n;
}

/* ---- the camera ----------------------------------------------------------------------------- */

const char *arris_camera_check(const arris_camera *c) {
    if (c->width < 1 || c->height < 1)
        return "the width and the height must be at least 1";
    if (!isfinite(c->fx) || !isfinite(c->fy) || c->fx <= 0 || c->fy <= 0)
        return "the focal lengths fx and fy must be above 0";
    if (!isfinite(c->skew) || !isfinite(c->cx) || !isfinite(c->cy))
        return "skew, cx and cy must be finite";
    if (!isfinite(c->k1) || !isfinite(c->k2) || !isfinite(c->p1) || !isfinite(c->p2) ||
        !isfinite(c->k3))
        return "the distortion k1, k2, p1, p2 and k3 must be finite";
    return NULL;
}

bool arris_camera_same(const arris_camera *a, const arris_camera *b) {
    if (!a || !b)
        return a == b;
    return a->width == b->width && a->height == b->height && a->fx == b->fx && a->fy == b->fy &&
           a->skew == b->skew && a->cx == b->cx && a->cy == b->cy && a->k1 == b->k1 &&
           a->k2 == b->k2 && a->p1 == b->p1 && a->p2 == b->p2 && a->k3 == b->k3;
}

arris_camera arris_camera_ideal(const arris_camera *c) {
    arris_camera ideal = *c;
    ideal.k1 = ideal.k2 = ideal.p1 = ideal.p2 = ideal.k3 = 0;
    return ideal;
}

bool arris_camera_distorts(const arris_camera *c) {
    return c->k1 != 0 || c->k2 != 0 || c->p1 != 0 || c->p2 != 0 || c->k3 != 0;
}

/* Normalised coordinates of a pixel, and back; the skew makes x depend on y (eq. 2.6). */
static void normalise(const arris_camera *c, double u, double v, double *x, double *y) {
    *y = (v - c->cy) / c->fy;
    *x = (u - c->cx - c->skew * *y) / c->fx;
}

static void to_pixel(const arris_camera *c, double x, double y, double *u, double *v) {
    *u = c->fx * x + c->skew * y + c->cx;
    *v = c->fy * y + c->cy;
}

/* Where the lens puts the normalised point (x, y), and the symmetric Jacobian
 * J = (dx_d/dx, dx_d/dy = dy_d/dx, dy_d/dy). Returns det J, which is positive as long as the model
 * has not folded back. */
static double lens(const arris_camera *c, double x, double y, double d[2], double J[3]) {
    double r2 = x * x + y * y;
    double radial = 1 + r2 * (c->k1 + r2 * (c->k2 + r2 * c->k3));
    double slope = 2 * (c->k1 + r2 * (2 * c->k2 + r2 * 3 * c->k3)); /* (1/r) d radial / dr */
    d[0] = x * radial + 2 * c->p1 * x * y + c->p2 * (r2 + 2 * x * x);
    d[1] = y * radial + c->p1 * (r2 + 2 * y * y) + 2 * c->p2 * x * y;
    J[0] = radial + x * x * slope + 2 * c->p1 * y + 6 * c->p2 * x;
    J[1] = x * y * slope + 2 * c->p1 * x + 2 * c->p2 * y;
    J[2] = radial + y * y * slope + 6 * c->p1 * y + 2 * c->p2 * x;
    return J[0] * J[2] - J[1] * J[1];
}

void arris_distort(const arris_camera *c, double x, double y, double *u, double *v) {
    double d[2], J[3];
    *u = x, *v = y;
    if (!arris_camera_distorts(c))
        return;
    normalise(c, x, y, &x, &y);
    lens(c, x, y, d, J);
    to_pixel(c, d[0], d[1], u, v);
}

/* Whether the model stays invertible all the way from the axis to (x, y): a polynomial that folds
 * back and rises again has a second, false inverse beyond the fold. */
static bool inside_fold(const arris_camera *c, double x, double y) {
    double d[2], J[3];
    for (int i = 1; i <= 16; i++)
        if (!(lens(c, x * i / 16, y * i / 16, d, J) > 0))
            return false;
    return true;
}

int arris_undistort(const arris_camera *c, double u, double v, double *ideal_u, double *ideal_v) {
    double target[2], x, y, d[2], J[3], beyond[3];
    normalise(c, u, v, &target[0], &target[1]);
    x = target[0], y = target[1];
    for (int i = 0; i < 60 && !inside_fold(c, x, y); i++)
        x /= 2, y /= 2;
    bool converged = false;
    for (int i = 0; i < 50 && !converged; i++) {
        double det = lens(c, x, y, d, J), ex = target[0] - d[0], ey = target[1] - d[1];
        if (!(det > 0))
            break;
        double sx = (J[2] * ex - J[1] * ey) / det, sy = (J[0] * ey - J[1] * ex) / det;
        converged = hypot(c->fx * sx, c->fy * sy) < 1e-10;
        double step = 1; /* halved until it doesn't end in the fold */
        while (step > 1e-3 && !(lens(c, x + step * sx, y + step * sy, d, beyond) > 0))
            step /= 2;
        x += step * sx, y += step * sy;
    }
    to_pixel(c, x, y, ideal_u, ideal_v);
    return converged && inside_fold(c, x, y) ? 0 : ARRIS_E_INPUT;
}

/* ---- rotation and pose ---------------------------------------------------------------------- */

void arris_rotation(double omega, double theta, double kappa, double R[9]) {
    double sO = sin(omega), cO = cos(omega), sT = sin(theta), cT = cos(theta);
    double sK = sin(kappa), cK = cos(kappa);
    R[0] = cT * cK;
    R[1] = cO * sK + sO * sT * cK;
    R[2] = sO * sK - cO * sT * cK;
    R[3] = -cT * sK;
    R[4] = cO * cK - sO * sT * sK;
    R[5] = sO * cK + cO * sT * sK;
    R[6] = sT;
    R[7] = -sO * cT;
    R[8] = cO * cT;
}

void arris_angles(const double R[9], double *omega, double *theta, double *kappa) {
    double cT = hypot(R[7], R[8]);
    *theta = atan2(R[6], cT);
    *omega = cT > 1e-9 ? atan2(-R[7], R[8]) : 0;
    /* sin and cos of kappa by way of omega: well conditioned at theta = ±90°, where only the sum
     * or the difference of the two is defined. */
    double sO = sin(*omega), cO = cos(*omega);
    *kappa = atan2(cO * R[1] + sO * R[2], cO * R[4] + sO * R[5]);
}

double arris_project(const arris_camera *c, const arris_pose *pose, const double X[3], double *x,
                     double *y) {
    double d[3] = {X[0] - pose->C[0], X[1] - pose->C[1], X[2] - pose->C[2]};
    double z = arris_dot(pose->R + 6, d);
    if (z > 0)
        to_pixel(c, arris_dot(pose->R, d) / z, arris_dot(pose->R + 3, d) / z, x, y);
    return z;
}

/* Camera to world: w = R^T v. */
static void to_world(const arris_pose *pose, const double v[3], double w[3]) {
    const double *R = pose->R;
    for (int i = 0; i < 3; i++)
        w[i] = R[i] * v[0] + R[3 + i] * v[1] + R[6 + i] * v[2];
}

void arris_bearing(const arris_camera *c, const arris_pose *pose, double x, double y, double d[3]) {
    double v[3] = {0, 0, 1};
    normalise(c, x, y, &v[0], &v[1]);
    to_world(pose, v, d);
    arris_unit(d);
}

int arris_view_plane(const arris_camera *c, const arris_pose *pose, const double e[4],
                     double n[3]) {
    double ax, ay, bx, by;
    normalise(c, e[0], e[1], &ax, &ay);
    normalise(c, e[2], e[3], &bx, &by);
    /* (ax, ay, 1) x (bx, by, 1) in differences, so that close pixels lose no digits */
    double dx = bx - ax, dy = by - ay, v[3] = {-dy, dx, ax * dy - ay * dx};
    to_world(pose, v, n);
    return arris_unit(n) > 0 ? 0 : ARRIS_E_INPUT;
}

double arris_line_at(const double X[3], const double u[3], const double C[3], const double d[3]) {
    double w[3] = {C[0] - X[0], C[1] - X[1], C[2] - X[2]}, n[3], m[3];
    arris_cross(u, d, n);
    arris_cross(w, d, m);
    double s2 = arris_dot(n, n); /* sin² of the angle between the two */
    return s2 > 1e-18 ? arris_dot(m, n) / s2 : (double)NAN;
}
