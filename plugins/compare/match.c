/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * match.c: compares edges with lines, and finds which belongs to which.
 */
#include "match.h"

#include <math.h>
#include <string.h>

#include "arris_geometry.h"

static const double ALONG = 0.990; /* cosine of 8° */
static const double SHARE = 0.3;   /* of the shorter that both must reach over */
static const double FAR = 9;       /* squared Mahalanobis distance */

static void rotate(const double R[9], const double x[3], double y[3]) {
    for (int i = 0; i < 3; i++)
        y[i] = R[3 * i] * x[0] + R[3 * i + 1] * x[1] + R[3 * i + 2] * x[2];
}

void place_point(const place *where, const double x[3], double X[3]) {
    double d[3] = {x[0] - where->c[0], x[1] - where->c[1], x[2] - where->c[2]};
    rotate(where->R, d, X);
    for (int i = 0; i < 3; i++)
        X[i] += where->c[i] + where->t[i];
}

/* A unit vector across u, towards n as far as may be; false when n doesn't tell. */
static bool across(const double u[3], const double n[3], double a[3]) {
    double s = arris_dot(u, n);
    for (int i = 0; i < 3; i++)
        a[i] = n[i] - s * u[i];
    return arris_unit(a) > 1e-3;
}

void piece_place(piece *e, const nominal_edge *n, const place *where) {
    static const double axes[2][3] = {{1, 0, 0}, {0, 1, 0}};
    double q[3], normal[3];
    place_point(where, n->p, e->p);
    place_point(where, n->q, q);
    rotate(where->R, n->normal, normal);
    for (int i = 0; i < 3; i++)
        e->u[i] = q[i] - e->p[i];
    e->length = arris_unit(e->u);
    e->outward = across(e->u, normal, e->a);
    if (!e->outward)
        across(e->u, axes[fabs(e->u[0]) > 0.7], e->a);
    arris_cross(e->u, e->a, e->b);
    e->line = -1;
    e->weight = e->from = e->to = 0;
}

static double along(const piece *e, const double x[3]) {
    double d[3] = {x[0] - e->p[0], x[1] - e->p[1], x[2] - e->p[2]};
    return arris_dot(e->u, d);
}

/* cov of J (p, q), the line's six numbers, for four rows. */
static void propagate(const double J[4][6], const double c[21], double out[4][4]) {
    double full[6][6], half[4][6];
    for (int i = 0, n = 0; i < 6; i++)
        for (int k = i; k < 6; k++, n++)
            full[i][k] = full[k][i] = c[n];
    for (int i = 0; i < 4; i++)
        for (int k = 0; k < 6; k++) {
            half[i][k] = 0;
            for (int m = 0; m < 6; m++)
                half[i][k] += J[i][m] * full[m][k];
        }
    for (int i = 0; i < 4; i++)
        for (int k = 0; k < 4; k++) {
            out[i][k] = 0;
            for (int m = 0; m < 6; m++)
                out[i][k] += half[i][m] * J[k][m];
        }
}

/* The row of the derivatives of x(s) across the edge by the line's ends: a point of the line at s
 * does not move when its ends move along it. */
static void row(const piece *e, const double axis[3], const double m[3], double share,
                double out[6]) {
    double slope = arris_dot(axis, m) / arris_dot(e->u, m);
    for (int i = 0; i < 3; i++) {
        double g = axis[i] - slope * e->u[i];
        out[i] = (1 - share) * g;
        out[3 + i] = share * g;
    }
}

static void fill(piece *e, const arris_line *l, const double m[3], double sp, double sq) {
    double J[4][6], at[2] = {e->from, e->to};
    for (int k = 0; k < 2; k++) {
        double share = (at[k] - sp) / (sq - sp), x[3];
        for (int i = 0; i < 3; i++)
            x[i] = (1 - share) * l->p[i] + share * l->q[i] - e->p[i];
        e->d[2 * k] = arris_dot(e->a, x);
        e->d[2 * k + 1] = arris_dot(e->b, x);
        row(e, e->a, m, share, J[2 * k]);
        row(e, e->b, m, share, J[2 * k + 1]);
    }
    propagate((const double(*)[6])J, l->cov, e->cov);
}

/* Squared Mahalanobis distance of the middle. */
static double distance(const piece *e, double reach) {
    double x = (e->d[0] + e->d[2]) / 2, y = (e->d[1] + e->d[3]) / 2, c[2][2];
    for (int i = 0; i < 2; i++)
        for (int k = 0; k < 2; k++)
            c[i][k] =
                (e->cov[i][k] + e->cov[i][k + 2] + e->cov[i + 2][k] + e->cov[i + 2][k + 2]) / 4 +
                (i == k) * reach * reach;
    double det = c[0][0] * c[1][1] - c[0][1] * c[1][0];
    double m = (x * x * c[1][1] - 2 * x * y * c[0][1] + y * y * c[0][0]) / det;
    return m >= 0 ? m : (double)INFINITY;
}

double piece_compare(piece *e, const arris_line *l, double reach) {
    double m[3] = {l->q[0] - l->p[0], l->q[1] - l->p[1], l->q[2] - l->p[2]};
    double length = arris_unit(m), c = arris_dot(m, e->u);
    if (!(fabs(c) > ALONG) || !(length > 0))
        return (double)INFINITY;
    double sp = along(e, l->p), sq = along(e, l->q);
    e->from = fmax(0, fmin(sp, sq));
    e->to = fmin(e->length, fmax(sp, sq));
    if (!(e->to - e->from > SHARE * fmin(e->length, length)))
        return (double)INFINITY;
    fill(e, l, m, sp, sq);
    return distance(e, reach);
}

/* ---- which is which -------------------------------------------------------------------------- */

static void offer(candidates *c, int32_t line, double cost) {
    uint32_t i = c->n < MATCH_CANDIDATES ? c->n++ : MATCH_CANDIDATES;
    for (; i > 0 && cost < c->best[i - 1].cost; i--)
        if (i < MATCH_CANDIDATES)
            c->best[i] = c->best[i - 1];
    if (i < MATCH_CANDIDATES) {
        c->best[i].line = line;
        c->best[i].cost = cost;
    }
}

/* The edge asks its best line that has not refused it; the line keeps the nearer edge. Returns the
 * edge that is now without a line, -1: none. */
static int32_t ask(candidates *c, int32_t edge, int32_t *owner) {
    candidates *mine = &c[edge];
    while (mine->next < mine->n) {
        uint32_t i = mine->next++;
        int32_t *held = &owner[mine->best[i].line], other = *held;
        if (other < 0) {
            *held = edge;
            return -1;
        }
        if (mine->best[i].cost < c[other].best[c[other].next - 1].cost) {
            *held = edge;
            return other;
        }
    }
    return -1;
}

void match(piece *e, uint32_t n, const arris_lines *lines, double search, candidates *c,
           int32_t *owner) {
    double reach = search / 3;
    for (uint32_t i = 0; i < n; i++) {
        c[i].n = c[i].next = 0;
        for (uint32_t k = 0; k < lines->n; k++) {
            const arris_line *l = &lines->item[k];
            bool stands = l->state == ARRIS_MEASURED && l->change != ARRIS_MERGED &&
                          l->change != ARRIS_RETIRED;
            double cost = stands ? piece_compare(&e[i], l, reach) : (double)INFINITY;
            double missing = 1 - (e[i].to - e[i].from) / e[i].length;
            if (cost < FAR) /* a fragment must be nearer than a whole line */
                offer(&c[i], (int32_t)k, cost + missing * missing);
        }
    }
    memset(owner, 0xff, lines->n * sizeof *owner);
    for (uint32_t i = 0; i < n; i++)
        for (int32_t edge = (int32_t)i; edge >= 0;)
            edge = ask(c, edge, owner);
    for (uint32_t i = 0; i < n; i++)
        e[i].line = -1;
    for (uint32_t k = 0; k < lines->n; k++)
        if (owner[k] >= 0) {
            e[owner[k]].line = (int32_t)k;
            piece_compare(&e[owner[k]], &lines->item[k], reach);
        }
}

/* ---- the nominal's own motion ---------------------------------------------------------------- */

void piece_point(const piece *e, int end, double X[3]) {
    for (int i = 0; i < 3; i++)
        X[i] = e->p[i] + (end ? e->to : e->from) * e->u[i];
}

void piece_jacobian(const piece *e, const place *where, double J[4][6]) {
    for (int r = 0; r < 4; r++) {
        const double *axis = r % 2 ? e->b : e->a;
        double X[3], turn[3];
        piece_point(e, r / 2, X);
        for (int i = 0; i < 3; i++)
            X[i] -= where->c[i] + where->t[i];
        arris_cross(X, axis, turn); /* axis (w x X) = w (X x axis) */
        for (int i = 0; i < 3; i++) {
            J[r][i] = -turn[i] / where->size;
            J[r][3 + i] = -axis[i];
        }
    }
}
