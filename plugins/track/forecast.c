/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * forecast.c: the gate (forecast.h).
 */
#include "forecast.h"

#include <math.h>

static const double GATE = 16;       /* chi-square of 2 degrees of freedom: 3 in 10,000 */
static const double SIGMAS = 4;      /* its root */
static const double COS_TURN = 0.9;  /* a line turns by less than 25° between two sightings */
static const double OVERLAP = 0.5;   /* of the shorter one, that must be in common */
static const double STRETCH = 0.25;  /* of the gate: the cost of having nothing in common */
static const double STRAIGHT = 0.01; /* px²: of what is called straight */
static const double FLIP = 8;        /* the cost of the other polarity */
static const double FLIPPED = 0.5;   /* of the gate, that it must be within */

forecast forecast_box(const arris_segment *where, double box) {
    double var = box * box * 2 / GATE; /* the corners of the box are at the gate */
    return (forecast){.where = *where, .cov = {var, 0, var}, .box = box};
}

double forecast_reach(const forecast *f) {
    return f->box > 0 ? f->box : SIGMAS * sqrt(f->cov[0] > f->cov[2] ? f->cov[0] : f->cov[2]);
}

double segment_direction(const arris_segment *s, double u[2]) {
    double dx = s->x2 - s->x1, dy = s->y2 - s->y1, length = sqrt(dx * dx + dy * dy);
    double per_px = length > 0 ? 1 / length : 0;
    u[0] = dx * per_px, u[1] = dy * per_px;
    return length;
}

/* segment_stretch; u and lp are the direction of p and its length. */
static double stretch(const arris_segment *p, const double u[2], double lp, const arris_segment *s,
                      double t[2], double d[2]) {
    double v[2], ls = segment_direction(s, v), turn = u[0] * v[0] + u[1] * v[1];
    if (!(turn >= COS_TURN))
        return 0;
    double x = s->x1 - p->x1, y = s->y1 - p->y1;
    double along = x * u[0] + y * u[1], right = y * u[0] - x * u[1], end = along + ls * turn;
    double shorter = lp < ls ? lp : ls, longer = lp < ls ? ls : lp;
    t[0] = along > 0 ? along : 0, t[1] = end < lp ? end : lp;
    if (!(t[1] - t[0] >= OVERLAP * shorter))
        return 0;
    double slope = (u[0] * v[1] - u[1] * v[0]) / turn;
    d[0] = right + (t[0] - along) * slope;
    d[1] = right + (t[1] - along) * slope;
    return (t[1] - t[0]) / longer;
}

double segment_stretch(const arris_segment *p, const arris_segment *s, double t[2], double d[2]) {
    double u[2], length = segment_direction(p, u);
    return stretch(p, u, length, s, t, d);
}

static bool runs_against(const forecast *f, const arris_segment *s) {
    return (f->where.x2 - f->where.x1) * (s->x2 - s->x1) +
               (f->where.y2 - f->where.y1) * (s->y2 - s->y1) <
           0;
}

arris_segment segment_along(const forecast *f, const arris_segment *s) {
    arris_segment r = *s;
    if (!runs_against(f, s))
        return r;
    r.x1 = s->x2, r.y1 = s->y2, r.x2 = s->x1, r.y2 = s->y1;
    r.lo = s->hi, r.hi = s->lo;
    r.cov[1] = -s->cov[1];
    return r;
}

/* Whether the intervals ab and cd are more than `margin` apart. */
static bool apart(double a, double b, double c, double d, double margin) {
    return (a > b ? a : b) + margin < (c < d ? c : d) || (c > d ? c : d) + margin < (a < b ? a : b);
}

/* The covariance of the distances at the two ends t of the common stretch; u and length are of the
 * forecast. */
static void covariance(const forecast *f, const double u[2], double length, const arris_segment *s,
                       const double t[2], double cov[3]) {
    double middle =
        ((s->x1 + s->x2) / 2 - f->where.x1) * u[0] + ((s->y1 + s->y2) / 2 - f->where.y1) * u[1];
    double a = t[0] / length, b = t[1] / length, v = t[0] - middle, w = t[1] - middle;
    const double *c = f->cov, *m = s->cov;
    cov[0] = (1 - a) * (1 - a) * c[0] + 2 * a * (1 - a) * c[1] + a * a * c[2] + m[0] +
             2 * v * m[1] + v * v * m[2] + STRAIGHT;
    cov[2] = (1 - b) * (1 - b) * c[0] + 2 * b * (1 - b) * c[1] + b * b * c[2] + m[0] +
             2 * w * m[1] + w * w * m[2] + STRAIGHT;
    cov[1] = (1 - a) * (1 - b) * c[0] + (a + b - 2 * a * b) * c[1] + a * b * c[2] + m[0] +
             (v + w) * m[1] + v * w * m[2];
}

/* forecast_misfit; *det is the covariance's determinant. */
static double misfit(const forecast *f, const arris_segment *s, double *det) {
    double u[2], length = segment_direction(&f->where, u), t[2], d[2], c[3];
    double share = stretch(&f->where, u, length, s, t, d);
    if (share <= 0)
        return 1;
    if (f->box > 0 && (fabs(d[0]) > f->box || fabs(d[1]) > f->box))
        return 1;
    covariance(f, u, length, s, t, c);
    *det = c[0] * c[2] - c[1] * c[1];
    double chi2 = (c[2] * d[0] * d[0] - 2 * c[1] * d[0] * d[1] + c[0] * d[1] * d[1]) / *det;
    return chi2 < GATE ? chi2 / GATE + STRETCH * (1 - share) : 1;
}

bool forecast_near(const forecast *f, const arris_segment *s, double reach) {
    const arris_segment *p = &f->where;
    return !apart(p->x1, p->x2, s->x1, s->x2, reach) && !apart(p->y1, p->y2, s->y1, s->y2, reach);
}

double forecast_misfit(const forecast *f, const arris_segment *s) {
    double det;
    arris_segment own = segment_along(f, s);
    return runs_against(f, s) == f->turned ? misfit(f, &own, &det) : 1;
}

/* How much the sides have changed, 1 being too much: one of them should be as it was, or else the
 * step between them, since light changes too. */
static double change(const arris_segment *a, const arris_segment *b) {
    double before = a->hi - a->lo, now = b->hi - b->lo, largest = fmax(fabs(before), fabs(now));
    if (before == 0 || now == 0)
        return 0;
    double side = fmin(fabs((double)a->lo - b->lo), fabs((double)a->hi - b->hi)) / largest;
    return before * now > 0 ? fmin(side, fabs(log(now / before))) : side;
}

double forecast_cost(const forecast *f, const arris_segment *s, double *off) {
    double det, changed;
    bool flipped = runs_against(f, s) != f->turned;
    *off = 1;
    if (flipped && !f->line)
        return (double)INFINITY;
    arris_segment own = segment_along(f, s);
    *off = misfit(f, &own, &det);
    if (*off >= (flipped ? FLIPPED : 1) || (changed = change(&f->where, &own)) >= 1)
        return (double)INFINITY;
    return GATE * *off + log(det) + changed * changed + (flipped ? FLIP : 0);
}
