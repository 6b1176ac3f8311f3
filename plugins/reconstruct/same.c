/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * same.c: whether two lines are one edge, seen as two because its track broke.
 */
#include <math.h>

#include "line.h"

static const double GATE = 18.5;      /* chi-square of 4 degrees of freedom: one in a thousand */
static const double GAP = 5;          /* px that may lie between the two */
static const double NEAR = 0.01;      /* of the distance: farther apart, they are never the same */
static const double COS_TURN = 0.9;   /* between their directions: 25° */
static const double COS_APART = 0.7;  /* likewise, before they have moved */
static const double CLOSE = 1;        /* px: what is seen farther off is another edge */
static const double FAR = 0.05;       /* of the distance, that the camera must have moved */
static const double SLANT = 0.05;     /* rad: and within this of the line's direction */
static const double SHARE = 0.8;      /* of a line's views that another line must explain */
static const double INDISTINCT = 0.2; /* px: nearer than this, edges are not told apart */
static const double ASIDE = 10;       /* px: what is seen farther off is not looked at again */

/* The places on l of two points, and their offsets along l's a and b. */
static void place_on(const line *l, double P[2][3], double place[2], double offset[4]) {
    double A[3], B[3], u[3];
    frame_point(&l->f, l->x, -1, A);
    frame_point(&l->f, l->x, 1, B);
    for (int i = 0; i < 3; i++)
        u[i] = B[i] - A[i];
    double length = arris_unit(u);
    for (int k = 0; k < 2; k++) {
        double d[3] = {P[k][0] - A[0], P[k][1] - A[1], P[k][2] - A[2]}, along = arris_dot(u, d);
        for (int i = 0; i < 3; i++)
            d[i] -= along * u[i];
        offset[2 * k] = arris_dot(d, l->f.a);
        offset[2 * k + 1] = arris_dot(d, l->f.b);
        place[k] = 2 * along / length - 1;
    }
}

/* Adds to A the covariance P of offsets along from->a, from->b, turned to those along to->a, to->b.
 */
static void add_turned(mat4 *A, const mat4 *P, const frame *from, const frame *to) {
    double T[2][2] = {{arris_dot(to->a, from->a), arris_dot(to->a, from->b)},
                      {arris_dot(to->b, from->a), arris_dot(to->b, from->b)}};
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++)
            for (int k = 0; k < 2; k++)
                for (int n = 0; n < 2; n++)
                    A->m[i][j] += T[i % 2][k] * T[j % 2][n] * P->m[i / 2 * 2 + k][j / 2 * 2 + n];
}

/* Whether places of b on a, which its ends have, lie along a and on it. */
static bool overlaps(const line *a, const line *b, const double place[2]) {
    double gap[2] = {GAP * a->pixel[0] / a->f.h, GAP * a->pixel[1] / a->f.h};
    return (place[1] - place[0]) * a->f.h > COS_TURN * (b->ends[1] - b->ends[0]) * b->f.h &&
           place[0] < a->ends[1] + gap[1] && place[1] > a->ends[0] - gap[0];
}

/* Whether the offsets are within the limit; those away from the camera only when `depth` is to
 * count. */
static bool near(const double offset[4], double limit, bool depth) {
    double a = depth ? offset[0] : 0, b = depth ? offset[2] : 0;
    return hypot(a, offset[1]) < limit && hypot(b, offset[3]) < limit;
}

/* How far a line reaches from f.X, mm. */
static double reach(const line *l) {
    return l->f.h * fmax(fabs(l->ends[0]), fabs(l->ends[1]));
}

/* Whether settled lines cannot be the same, wherever in their reach they are. */
static bool far_apart(const line *a, const line *b) {
    double d[3] = {b->f.X[0] - a->f.X[0], b->f.X[1] - a->f.X[1], b->f.X[2] - a->f.X[2]};
    double most = NEAR * a->depth + GAP * fmax(a->pixel[0], a->pixel[1]) + reach(a) + reach(b);
    return a->settled && arris_dot(d, d) > most * most;
}

/* Whether so little is known that what is near agrees, whatever it is. */
static bool vague(const mat4 *S, double limit) {
    double most = 0;
    for (int i = 0; i < 4; i++)
        most = fmax(most, S->m[i][i]);
    return GATE * most > limit * limit;
}

bool line_same(const line *a, const line *b, const scene *s, bool turned) {
    double P[2][3], place[2], offset[4], ends[2] = {b->ends[turned], b->ends[!turned]};
    if (a->parted || b->parted) /* it was told apart when its uncertainty was its own */
        return false;
    if (arris_dot(a->f.u, b->f.u) * (turned ? -1 : 1) < COS_APART || far_apart(a, b))
        return false;
    if (turned && arris_dot(a->kept[a->n_kept - 1].step, b->kept[b->n_kept - 1].step) > 0)
        return false; /* an estimate is, the edge is not */
    for (int i = 0; i < 2; i++)
        frame_point(&b->f, b->x, ends[i], P[i]);
    place_on(a, P, place, offset);
    if (!overlaps(a, b, place) || !near(offset, NEAR * a->depth, a->settled))
        return false;
    mat4 S = line_covariance(a, s, a->prior, place), C = line_covariance(b, s, b->prior, ends),
         inverse;
    double least = INDISTINCT * fmin(a->pixel[0], a->pixel[1]);
    add_turned(&S, &C, &b->f, &a->f);
    for (int i = 0; i < 4; i++)
        S.m[i][i] += least * least;
    if (a->settled && s->waits && vague(&S, NEAR * a->depth))
        return false;
    if (!a->settled) /* their depth was guessed, at two times */
        S.m[0][0] += a->depth * a->depth, S.m[2][2] += a->depth * a->depth;
    return mat4_invert(&S, &inverse) && mat4_form(&inverse, offset, offset) < GATE;
}

/* How many of n views, every stride-th from the first on, are not on the line, along it and no
 * farther off than the noise. `pixel` is what one measures, rad. */
static uint32_t missed_by(const line *a, const view *v, uint32_t n, uint32_t stride, double pixel,
                          const scene *s) {
    linears all;
    linear r;
    uint32_t missed = 0;
    views_linearise(v, n, stride, &a->f, a->x, &s->noise, &all);
    for (uint32_t k = 0; k < n; k++) {
        double middle = (all.s[0][k] + all.s[1][k]) / 2;
        double length = (all.s[1][k] - all.s[0][k]) * a->f.h;
        bool on = fabs(all.r[0][k]) < CLOSE && fabs(all.r[1][k]) < CLOSE &&
                  length > COS_TURN * 2 * v[k * stride].half * pixel * all.depth[k] &&
                  a->ends[0] < middle && middle < a->ends[1] && views_pick(&all, k, &r) &&
                  linear_distance(&r, &a->cov) < GATE * a->scale;
        missed += !on;
    }
    return missed;
}

/* Whether the whole line is on one side of what the view saw. */
static bool passes_by(const line *a, const view *v) {
    int left = 0, right = 0;
    for (int end = 0; end < 2; end++) {
        double P[3];
        frame_point(&a->f, a->x, a->ends[end], P);
        for (int i = 0; i < 3; i++)
            P[i] -= v->C[i];
        double limit = ASIDE * arris_dot(v->axis, P), off = arris_dot(v->plane, P);
        left += limit > 0 && off < -limit;
        right += limit > 0 && off > limit;
    }
    return left == 2 || right == 2;
}

bool line_explains(const line *a, const line *b, const scene *s) {
    uint32_t missed = 0, n = b->n_kept;
    double moved = line_baseline(b), swing = b->swing[1] - b->swing[0];
    if (moved < FAR * a->depth || swing * a->depth > SLANT * moved || passes_by(a, &b->kept[n / 2]))
        return false;
    double pixel = sqrt(arris_dot(b->kept[0].step, b->kept[0].step)); /* rad */
    double may_miss = (1 - SHARE) * n;
    if (missed_by(a, b->kept, 3, (n - 1) / 2, pixel, s) == 3) /* mostly three views tell */
        return false;
    for (uint32_t i = 0; i < n && missed <= may_miss; i += VIEWS)
        missed += missed_by(a, &b->kept[i], n - i < VIEWS ? n - i : VIEWS, 1, pixel, s);
    return missed <= may_miss;
}
