/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * memory.c: how the poses' noise hangs together over the frames (memory.h).
 */
#include "memory.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double RHO[MEMORIES] = {0, 0.3, 0.5, 0.6, 0.7, 0.75, 0.8, 0.85, 0.9, 0.93, 0.95, 0.97};
static const double PRIOR_DOF = 10; /* weight of the scene's variance against the line's own */
static const double UNLIKELY = 1e-3;
static const double UNKNOWN = 1e6; /* times the variance of e */
enum { LEAST = 8 };                /* views that tell */

/* What a view says of the pose's error, e: y = e + c x + its own noise, all in mm. */
typedef struct datum {
    uint32_t frame, views; /* with those that are not kept */
    double y, c[4], own;   /* own: variance */
    double B[4];           /* by how much e adds to the slope of chi-square */
} datum;

static int by_frame(const void *a, const void *b) {
    uint32_t x = ((const datum *)a)->frame, y = ((const datum *)b)->frame;
    return (x > y) - (x < y);
}

/* In the order of the frames, which the views of a merged line are not in. */
static uint32_t list(const line *l, const scene *s, datum d[LINE_KEPT]) {
    uint32_t n = 0;
    pose_noise none = {0, 0, false};
    linear r, own;
    for (uint32_t i = 0; i < l->n_kept; i++) {
        const view *v = &l->kept[i];
        if (!l->inlier[i] || !view_linearise(v, &l->f, l->x, &s->noise, &r) ||
            !view_linearise(v, &l->f, l->x, &none, &own))
            continue;
        double px = sqrt(arris_dot(v->plane, v->plane)) / r.depth; /* by a mm */
        double det = r.cov[0] * r.cov[2] - r.cov[1] * r.cov[1];
        double w[2] = {(r.cov[2] - r.cov[1]) / det, (r.cov[0] - r.cov[1]) / det};
        datum *to = &d[n++];
        to->frame = v->frame;
        to->views = 1 + (l->stride > 1 ? l->rest[i].n : 0);
        double left = s->noise.corrected ? v->left : 1;
        to->y = (own.r[0] + own.r[1]) / 2 / px;
        to->own = (own.cov[0] + 2 * own.cov[1] + own.cov[2]) / (4 * px * px);
        for (int k = 0; k < 4; k++) {
            to->c[k] = (r.J[0][k] + r.J[1][k]) / 2 / px;
            to->B[k] = (w[0] * r.J[0][k] + w[1] * r.J[1][k]) * px * left;
        }
    }
    qsort(d, n, sizeof *d, by_frame);
    return n;
}

/* The variance of e, which is about `variance`, by its likelihood, of which *log_likelihood is the
 * logarithm: a Kalman filter over e and the line's four parameters, of which nothing is known at
 * first. */
static double filter(const datum *d, uint32_t n, double rho, double variance,
                     double *log_likelihood) {
    double z[5] = {0}, P[5][5] = {{1}}, sum = 0, logs = 0;
    for (int k = 1; k < 5; k++)
        P[k][k] = UNKNOWN;
    for (uint32_t i = 0; i < n; i++) {
        double keeps = i > 0 ? pow(rho, d[i].frame - d[i - 1].frame) : 1;
        double h[5] = {1, d[i].c[0], d[i].c[1], d[i].c[2], d[i].c[3]}, Ph[5];
        double F = d[i].own / variance, v = d[i].y;
        z[0] *= keeps;
        for (int k = 0; k < 5; k++)
            P[0][k] = P[k][0] = P[k][0] * keeps * (k == 0 ? keeps : 1);
        P[0][0] += 1 - keeps * keeps;
        for (int k = 0; k < 5; k++) {
            Ph[k] = 0;
            for (int j = 0; j < 5; j++)
                Ph[k] += P[k][j] * h[j];
            F += h[k] * Ph[k];
            v -= h[k] * z[k];
        }
        sum += v * v / F;
        logs += log(F);
        for (int k = 0; k < 5; k++) {
            z[k] += Ph[k] * v / F;
            for (int j = 0; j < 5; j++)
                P[k][j] -= Ph[k] * Ph[j] / F;
        }
    }
    double dof = n - 2.0, found = fmax(sum / dof, DBL_MIN);
    *log_likelihood = -(dof * log(found) + logs) / 2;
    return found;
}

/* What e that is of variance 1, mm², adds by what views share of it to C, the covariance of the
 * line by what each has; over that, the mean over the two ways that e moves a line in. */
static double shared(const datum *d, uint32_t n, double rho, const mat4 *C) {
    double F[4] = {0}, CB[4], sum = 0;
    for (uint32_t i = 0; i < n; i++) {
        double m = d[i].views, q = (1 - pow(rho, m)) / (1 - rho); /* of each of which e is rho^k */
        mat4_times(C, d[i].B, CB);
        double BF = 0, BB = 0;
        for (int k = 0; k < 4; k++)
            BF += CB[k] * F[k], BB += CB[k] * d[i].B[k];
        sum += 2 * q * BF + 2 * rho / (1 - rho) * (m - q) * BB;
        if (i + 1 == n)
            break;
        double gap = d[i + 1].frame - d[i].frame, keeps = pow(rho, gap);
        double more = rho > 0 ? pow(rho, fmax(gap - m + 1, 0)) * q : 0;
        for (int k = 0; k < 4; k++)
            F[k] = keeps * F[k] + more * d[i].B[k];
    }
    return sum / 2;
}

void memory_begin(memories *m) {
    memset(m, 0, sizeof *m);
}

void memory_add(memories *m, const line *l, const scene *s) {
    datum d[LINE_KEPT];
    uint32_t n = list(l, s, d);
    double stated = s->noise.position * s->noise.position, likelihood;
    if (n < LEAST || stated <= 0)
        return;
    for (int k = 0; k < MEMORIES; k++) {
        m->variance[k] += n * filter(d, n, RHO[k], stated, &likelihood);
        m->likelihood[k] += likelihood;
    }
    m->views += n;
    m->most = fmax(m->most, n);
}

void memory_end(memories *m) {
    double best = -(double)INFINITY, sum = 0;
    m->known = m->views > 0;
    if (!m->known)
        return;
    for (int k = 0; k < MEMORIES; k++) {
        m->variance[k] /= m->views;
        m->likelihood[k] *= m->most / m->views; /* the lines see the same poses */
        best = fmax(best, m->likelihood[k]);
    }
    for (int k = 0; k < MEMORIES; k++) {
        /* beforehand, one is as likely as another */
        double from = RHO[k > 0 ? k - 1 : 0], to = RHO[k + 1 < MEMORIES ? k + 1 : k];
        m->weight[k] = (to - from) * exp(m->likelihood[k] - best);
        sum += m->weight[k];
    }
    for (int k = 0; k < MEMORIES; k++)
        m->weight[k] /= sum;
}

double memory_shared(const memories *m, const line *l, const scene *s, const mat4 *C) {
    datum d[LINE_KEPT];
    uint32_t n = list(l, s, d);
    double stated = s->noise.position * s->noise.position, likelihood, sum = 0;
    for (int k = 0; k < MEMORIES; k++) {
        if (m->weight[k] < UNLIKELY)
            continue;
        double dof = n < LEAST ? 0 : n, own = 0;
        if (dof > 0)
            own = filter(d, n, RHO[k], stated, &likelihood);
        double variance = (dof * own + PRIOR_DOF * m->variance[k]) / (dof + PRIOR_DOF);
        sum += m->weight[k] * variance * shared(d, n, RHO[k], C);
    }
    return sum;
}
