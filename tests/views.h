/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * views.h: a simulated camera, views of edges by it, and the truth in an estimate's terms; for the
 * tests of reconstruct; after cmocka.h.
 */
#ifndef VIEWS_H
#define VIEWS_H

#include <math.h>
#include <stdint.h>

#include "../plugins/reconstruct/line.h"
#include "chance.h"

/* ---- a simulated camera --------------------------------------------------------------------- */

static const arris_camera camera = {320, 240, 380, 378, 0.5, 158.5, 121, 0, 0, 0, 0, 0};
static const double picture[4] = {0, 0, 319, 239};
static const scene known = {.scale = 1, .memory = 1, .depth = 1000};

typedef struct edge {
    double p[3], q[3];
} edge;

static inline arris_pose pose_at(double x, double y, double z, double omega, double theta,
                                 double kappa) {
    arris_pose p = {.valid = true, .C = {x, y, z}};
    arris_rotation(omega, theta, kappa, p.R);
    return p;
}

/* Frame i of n on a straight path of 4.1 mm steps in x. */
static inline arris_pose on_path(int i, int n) {
    return pose_at((i - (n - 1) / 2.0) * 4.1, 0, 0, 0, 0, 0);
}

/* Narrows w[0]..w[1] to where from + w (to - from) is within 0..size. */
static inline void clip(double from, double to, double size, double w[2]) {
    if (from == to)
        return;
    double w0 = -from / (to - from), w1 = (size - from) / (to - from);
    w[0] = fmax(w[0], fmin(w0, w1));
    w[1] = fmin(w[1], fmax(w0, w1));
}

/* The picture of the edge from a to b, as far as it is in the picture; both ends are in front. */
static inline bool project(const edge *e, const arris_pose *pose, double a[2], double b[2]) {
    double w[2] = {0, 1}, p[2], q[2];
    assert_true(arris_project(&camera, pose, e->p, &p[0], &p[1]) > 0);
    assert_true(arris_project(&camera, pose, e->q, &q[0], &q[1]) > 0);
    clip(p[0], q[0], 319, w);
    clip(p[1], q[1], 239, w);
    for (int i = 0; i < 2; i++) {
        a[i] = p[i] + w[0] * (q[i] - p[i]);
        b[i] = p[i] + w[1] * (q[i] - p[i]);
    }
    return w[1] > w[0];
}

/* The segment that a detector finds, its offset noise `sigma` px for 100 px of length, its angle as
 * that of a fitted line, its ends scattered by `scatter` px along it. */
static inline bool detect(const edge *e, const arris_pose *pose, double sigma, double scatter,
                          arris_segment *s) {
    double a[2], b[2];
    if (!project(e, pose, a, b))
        return false;
    double dx = b[0] - a[0], dy = b[1] - a[1], length = hypot(dx, dy);
    if (length < 10)
        return false;
    dx /= length, dy /= length;
    double var = sigma * sigma * 100 / length, offset = sqrt(var) * normal();
    double turn = sqrt(12 * var) / length * normal();
    double first = scatter * normal(), last = scatter * normal();
    *s = (arris_segment){.x1 = a[0] + first * dx - (offset - turn * length / 2) * dy,
                         .y1 = a[1] + first * dy + (offset - turn * length / 2) * dx,
                         .x2 = b[0] + last * dx - (offset + turn * length / 2) * dy,
                         .y2 = b[1] + last * dy + (offset + turn * length / 2) * dx,
                         .cov = {var, 0, 12 * var / (length * length)}};
    return true;
}

static inline bool see(const edge *e, const arris_pose *pose, double sigma, view *v) {
    arris_segment s;
    return detect(e, pose, sigma, 0, &s) && view_make(v, &s, &camera, pose, picture) == 0;
}

/* ---- the truth in an estimate's terms -------------------------------------------------------- */

/* The offsets of the true edge from the frame's reference, where x is those of the estimate. */
static inline void truth_in_frame(const edge *e, const frame *f, double x[4]) {
    double u[3], d[3];
    for (int i = 0; i < 3; i++)
        u[i] = e->q[i] - e->p[i], d[i] = e->p[i] - f->X[i];
    for (int k = 0; k < 2; k++) {
        double t = ((k ? f->h : -f->h) - arris_dot(d, f->u)) / arris_dot(u, f->u);
        double P[3] = {d[0] + t * u[0], d[1] + t * u[1], d[2] + t * u[2]};
        x[2 * k] = arris_dot(P, f->a);
        x[2 * k + 1] = arris_dot(P, f->b);
    }
}

static inline void error_of(const line *l, const edge *e, double d[4]) {
    truth_in_frame(e, &l->f, d);
    for (int i = 0; i < 4; i++)
        d[i] = l->x[i] - d[i];
}

#endif
