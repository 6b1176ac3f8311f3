/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * motion.c: from where a line was seen, and whether that tells where it is.
 */
#include <math.h>
#include <string.h>

#include "line.h"

static const double SWING = 5;      /* px of parallax: with less it is not observable */
static const double ALONG = 0.0140; /* rad: nor when the camera moves this near its direction */
static const double PARALLAX = 0.1; /* nor with a sigma above this share of its distance */

static double square_distance(const double a[3], const double b[3]) {
    double d[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
    return arris_dot(d, d);
}

/* From where the line is seen from C, in the plane across it. */
static void look(const line *l, const double C[3], double d[2]) {
    double P[3];
    frame_point(&l->f, l->x, 0, P);
    for (int i = 0; i < 3; i++)
        P[i] -= C[i];
    d[0] = arris_dot(P, l->f.a), d[1] = arris_dot(P, l->f.b);
}

static void widen_baseline(line *l, const double C[3]) {
    double d = square_distance(l->first, l->last), from_first = square_distance(C, l->first),
           to_last = square_distance(C, l->last);
    if (from_first > d && from_first >= to_last)
        memcpy(l->last, C, sizeof l->last);
    else if (to_last > d)
        memcpy(l->first, C, sizeof l->first);
}

void line_widen(line *l, const double C[3]) {
    double d[2];
    look(l, C, d);
    double angle = atan2(d[1], d[0]);
    l->swing[0] = fmin(l->swing[0], angle);
    l->swing[1] = fmax(l->swing[1], angle);
    widen_baseline(l, C);
}

void line_measure_motion(line *l) {
    double least[2], most[2], d[2];
    bool any = false;
    for (uint32_t i = 0; i < l->n_kept; i++) {
        const double *C = l->kept[i].C;
        if (!l->inlier[i])
            continue;
        look(l, C, d);
        if (!any || d[1] * least[0] < d[0] * least[1])
            memcpy(least, d, sizeof least);
        if (!any || d[1] * most[0] > d[0] * most[1])
            memcpy(most, d, sizeof most);
        if (!any)
            memcpy(l->first, C, sizeof l->first), memcpy(l->last, C, sizeof l->last);
        widen_baseline(l, C);
        any = true;
    }
    if (any)
        l->swing[0] = atan2(least[1], least[0]), l->swing[1] = atan2(most[1], most[0]);
}

double line_baseline(const line *l) {
    return sqrt(square_distance(l->first, l->last));
}

double line_pose_px(const line *l, const scene *s) {
    const double *plane = l->kept[0].plane;
    return s->noise.position * sqrt(arris_dot(plane, plane)) / l->depth;
}

bool line_observable(const line *l) {
    double swing = l->swing[1] - l->swing[0], worst = 0;
    for (int i = 0; i < 4; i++)
        worst = fmax(worst, l->cov.m[i][i] * l->scale);
    const double *plane = l->kept[0].plane;
    double parallax = swing * sqrt(arris_dot(plane, plane));
    return l->all.n >= 2 && parallax > SWING && swing * l->depth > ALONG * line_baseline(l) &&
           worst < PARALLAX * PARALLAX * l->depth * l->depth;
}

/* The planes of the views must turn, by themselves, and since the camera moved across the first of
 * them, at the distance of the nearest line that there may be. */
bool line_may_be_observable(const line *l, const scene *s) {
    const view *v = l->kept;
    double least = SWING * SWING / 16, moves = SWING * s->nearest;
    for (const view *w = v + 1; w < v + l->n_kept; w++) {
        double n[3], d[3] = {w->C[0] - v->C[0], w->C[1] - v->C[1], w->C[2] - v->C[2]};
        arris_cross(v->plane, w->plane, n);
        if (arris_dot(n, n) > least * arris_dot(w->plane, w->plane) &&
            fabs(arris_dot(v->plane, d)) >= moves)
            return true;
    }
    return false;
}
