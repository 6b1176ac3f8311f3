/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * start.c: where a line is, from nothing: least median of squares (Rousseeuw 1984) over pairs of
 * views, since two planes meet in a line (thesis, section 2.6).
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "line.h"

static const double PARALLEL = 1e-5; /* rad: planes closer than this don't meet */
static const double HOLD = 0.01;     /* how much a guess may be moved, of its distance */
static const double UNKNOWN = 1e6;   /* scale of residuals that a guess leaves */
enum { PAIRS = 8, SAMPLE = 16 };     /* of views that are tried; views they are tried on */
static const double ORIGIN[4] = {0};

/* Completes f->u, f->X to a frame whose a points away from the camera at C. */
static void complete(frame *f, const double C[3]) {
    double along;
    for (int i = 0; i < 3; i++)
        f->a[i] = f->X[i] - C[i];
    along = arris_dot(f->a, f->u);
    for (int i = 0; i < 3; i++)
        f->a[i] -= along * f->u[i];
    arris_unit(f->a);
    arris_cross(f->u, f->a, f->b);
}

/* The frame on the intersection of the planes of v and w, its middle where v saw it. */
static bool meet(const view *v, const view *w, frame *f) {
    double n[3], m[3], d[3], p[3];
    for (int i = 0; i < 3; i++)
        n[i] = v->plane[i], m[i] = w->plane[i], d[i] = w->C[i] - v->C[i];
    arris_unit(n);
    arris_unit(m);
    arris_cross(n, m, f->u);
    double sine = arris_unit(f->u);
    if (sine < PARALLEL)
        return false;
    arris_cross(f->u, n, p);
    for (int i = 0; i < 3; i++)
        f->X[i] = v->C[i] + p[i] * arris_dot(m, d) / sine;
    complete(f, v->C);
    f->h = 1;
    double s[2];
    view_ends(v, f, ORIGIN, s);
    for (int i = 0; i < 3; i++) {
        f->X[i] += f->u[i] * (s[0] + s[1]) / 2;
        f->u[i] *= s[1] > s[0] ? 1 : -1;
        f->b[i] *= s[1] > s[0] ? 1 : -1;
    }
    f->h = fabs(s[1] - s[0]) / 2;
    return isfinite(f->h) && f->h > 0;
}

static int ascending(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* The median of the squared Mahalanobis distance, over the kept views or a good sample of them;
 * `most` when it is not below that, which half of the views tell. */
static double median_distance(const line *l, const frame *f, const scene *s, double most) {
    double d[LINE_KEPT];
    linears r;
    uint32_t step = 1 + l->n_kept / SAMPLE, n = 1 + (l->n_kept - 1) / step, near = 0;
    for (uint32_t i = 0; i < n; i++) {
        if (i % VIEWS == 0)
            views_linearise(&l->kept[i * step], n - i, step, f, ORIGIN, &s->noise, &r);
        d[near] = r.distance[i % VIEWS];
        near += d[near] < most;
        if (n - 1 - i + near <= n / 2)
            return most;
    }
    qsort(d, near, sizeof *d, ascending);
    return d[n / 2];
}

static double distance_from(const frame *f, const double C[3]) {
    double d[3] = {f->X[0] - C[0], f->X[1] - C[1], f->X[2] - C[2]};
    return arris_unit(d);
}

bool line_start(line *l, const scene *s) {
    double best = (double)INFINITY;
    uint32_t n = l->n_kept;
    for (uint32_t part = 2; part <= 3; part++) /* planes that are far apart meet best */
        for (uint32_t i = 0, far = n / part; far > 0 && i < n; i += 1 + n / PAIRS) {
            frame f;
            if (!meet(&l->kept[i], &l->kept[(i + far) % n], &f))
                continue;
            double d = median_distance(l, &f, s, best);
            if (d < best)
                best = d, l->f = f;
        }
    /* the median of chi-square with 2 degrees of freedom is 2 log 2; few views fit too well */
    double few = n > 4 ? 1 + 5.0 / (n - 2) : 4;
    l->depth = l->prior = distance_from(&l->f, l->kept[0].C);
    l->scale = fmax(s->scale, best / (2 * log(2.0)) * few * few);
    return isfinite(best);
}

void line_guess(line *l, const scene *s) {
    const view *v = &l->kept[l->n_kept / 2];
    frame *f = &l->f;
    for (int i = 0; i < 3; i++) {
        f->X[i] = v->C[i] + s->depth * v->ray[i];
        f->u[i] = v->step[i];
    }
    f->h = s->depth * v->half * arris_unit(f->u);
    complete(f, v->C);
    l->depth = s->depth;
    l->prior = HOLD * s->depth;
    l->scale = UNKNOWN;
}

/* Whether most views run against the estimate: as it moved, its ends went past each other. */
static bool runs_against(const line *l) {
    double M[3], D[3], ahead[3];
    int against = 0;
    frame_line(&l->f, l->x, M, D);
    for (uint32_t i = 0; i < l->n_kept; i++) {
        const view *v = &l->kept[i];
        double depth = arris_dot(v->axis, D);
        for (int k = 0; k < 3; k++)
            ahead[k] = D[k] - depth * v->ray[k];
        against += arris_dot(ahead, v->step) < 0 ? 1 : -1;
    }
    return against > 0;
}

void line_reframe(line *l) {
    frame *f = &l->f;
    double P[3], Q[3];
    bool turned = runs_against(l);
    frame_point(f, l->x, l->ends[turned], P);
    frame_point(f, l->x, l->ends[!turned], Q);
    for (int i = 0; i < 3; i++) {
        f->X[i] = (P[i] + Q[i]) / 2;
        f->u[i] = (Q[i] - P[i]) / 2;
    }
    f->h = arris_unit(f->u);
    complete(f, l->kept[0].C);
    memset(l->x, 0, sizeof l->x);
    l->ends[0] = -1, l->ends[1] = 1;
}
