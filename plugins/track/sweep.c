/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * sweep.c: epipolar sweeps (sweep.h).
 */
#include "sweep.h"

#include <math.h>
#include <string.h>

static const double NARROW = 0.25; /* of the inverse depth: its sigma when it is known */
static const double LONGER = 1.2;  /* a segment by so much longer is the better start */
static const double OUTLIER = 16;  /* squared sigmas */
static const double ASTRAY = 0.2;  /* of the length: what sigma may be along the line */

static bool narrow(const sweep *s) {
    return s->var[0] < NARROW * NARROW * s->w[0] * s->w[0] &&
           s->var[1] < NARROW * NARROW * s->w[1] * s->w[1];
}

/* Takes the lens out of the ends, where `undistort` has not. False outside of the lens. */
static bool straighten(const arris_camera *c, arris_segment *s) {
    return !arris_camera_distorts(c) || (!arris_undistort(c, s->x1, s->y1, &s->x1, &s->y1) &&
                                         !arris_undistort(c, s->x2, s->y2, &s->x2, &s->y2));
}

/* Variance of the segment across itself, `t` px along it from its middle. */
static double variance(const arris_segment *s, double t) {
    return s->cov[0] + 2 * t * s->cov[1] + t * t * s->cov[2];
}

void sweep_begin(sweep *s, const arris_segment *seen, const viewpoint *v, const depths *d) {
    arris_segment a = *seen;
    double u[2];
    bool good = straighten(v->camera, &a);
    double end[2][2] = {{a.x1, a.y1}, {a.x2, a.y2}};
    s->length = good ? segment_direction(&a, u) : 0;
    memcpy(s->C, v->pose->C, sizeof s->C);
    for (int i = 0; i < 2; i++) {
        arris_bearing(v->camera, v->pose, end[i][0], end[i][1], s->ray[i]);
        double depth = arris_dot(v->pose->R + 6, s->ray[i]);
        for (int k = 0; k < 3; k++)
            s->ray[i][k] /= depth;
        s->own[i] = variance(&a, (i - 0.5) * s->length);
        s->w[i] = d->mean;
        s->var[i] = d->sigma * d->sigma;
    }
    if (!isfinite(s->length + s->own[0] + s->own[1] + arris_dot(s->ray[0], s->ray[1])))
        s->length = 0;
}

/* The picture (x, y) of end i at its inverse depth, how that moves with it, and its depth in units
 * of that from where it was seen. */
static double picture(const sweep *s, int i, const viewpoint *v, double at[2], double speed[2]) {
    const arris_camera *c = v->camera;
    const double *R = v->pose->R;
    double base[3], X[3], Y[3];
    for (int k = 0; k < 3; k++)
        base[k] = s->C[k] - v->pose->C[k];
    for (int k = 0; k < 3; k++) {
        Y[k] = arris_dot(R + 3 * k, base);
        X[k] = arris_dot(R + 3 * k, s->ray[i]) + s->w[i] * Y[k];
    }
    double per_depth = 1 / X[2], x = X[0] * per_depth, y = X[1] * per_depth;
    double dx = (Y[0] - x * Y[2]) * per_depth, dy = (Y[1] - y * Y[2]) * per_depth;
    at[0] = c->fx * x + c->skew * y + c->cx;
    at[1] = c->fy * y + c->cy;
    speed[0] = c->fx * dx + c->skew * dy;
    speed[1] = c->fy * dy;
    return X[2];
}

bool sweep_forecast(const sweep *s, const viewpoint *v, forecast *f) {
    double at[2][2], speed[2][2], u[2], z[2];
    *f = (forecast){.where = {0}};
    for (int i = 0; i < 2; i++)
        if (!((z[i] = picture(s, i, v, at[i], speed[i])) > 0))
            return false;
    f->where.x1 = at[0][0], f->where.y1 = at[0][1];
    f->where.x2 = at[1][0], f->where.y2 = at[1][1];
    if (!(segment_direction(&f->where, u) > 0))
        return false;
    for (int i = 0; i < 2; i++) {
        double across = speed[i][1] * u[0] - speed[i][0] * u[1];
        f->cov[2 * i] = s->own[i] + across * across * s->var[i];
    }
    blur_forecast(v, 2 / (s->w[0] / z[0] + s->w[1] / z[1]), f);
    arris_distort(v->camera, f->where.x1, f->where.y1, &f->where.x1, &f->where.y1);
    arris_distort(v->camera, f->where.x2, f->where.y2, &f->where.x2, &f->where.y2);
    return isfinite(f->cov[0] + f->cov[1] + f->cov[2] + f->where.x1 + f->where.y1 + f->where.x2 +
                    f->where.y2) &&
           in_picture(v->camera, &f->where);
}

/* Narrows end i by the straight segment a. False when that contradicts it, or when nobody knows
 * any more where along the line it is. */
static bool narrow_end(sweep *s, int i, const arris_segment *a, const viewpoint *v,
                       const depths *d) {
    double at[2], speed[2], u[2];
    forecast blur = {.cov = {0}};
    double z = picture(s, i, v, at, speed);
    segment_direction(a, u);
    double x = at[0] - (a->x1 + a->x2) / 2, y = at[1] - (a->y1 + a->y2) / 2;
    double right = y * u[0] - x * u[1], across = speed[1] * u[0] - speed[0] * u[1];
    blur_forecast(v, z / s->w[i], &blur);
    double var = s->own[i] + variance(a, x * u[0] + y * u[1]) + blur.cov[0];
    double innovation = var + across * across * s->var[i];
    double along = fabs(speed[0] * u[0] + speed[1] * u[1]) * sqrt(s->var[i]);
    if (!(z > 0) || !(right * right < OUTLIER * innovation) || along > ASTRAY * s->length)
        return false;
    double gain = s->var[i] * across / innovation;
    s->w[i] = fmin(fmax(s->w[i] - gain * right, d->least), d->most);
    s->var[i] *= var / innovation;
    return true;
}

void sweep_sight(sweep *s, const arris_segment *seen, const viewpoint *v, const depths *d) {
    arris_segment a = *seen;
    double u[2];
    if (!straighten(v->camera, &a))
        return;
    bool good = s->length > 0 && (narrow(s) || segment_direction(&a, u) < LONGER * s->length);
    for (int i = 0; good && i < 2; i++)
        good = narrow_end(s, i, &a, v, d);
    if (!good)
        sweep_begin(s, seen, v, d);
}

bool sweep_depth(const sweep *s, const viewpoint *v, double *w) {
    double at[2], speed[2];
    if (s->length <= 0 || !narrow(s))
        return false;
    *w = s->w[0] / picture(s, 0, v, at, speed) / 2 + s->w[1] / picture(s, 1, v, at, speed) / 2;
    return *w > 0;
}
