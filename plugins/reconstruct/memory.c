/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * memory.c: how the poses' noise hangs together over the frames (memory.h).
 */
#include "memory.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double PRIOR_DOF = 10; /* weight of the scene's variance against the line's own */
static const double UNLIKELY = 1e-3;
static const double UNKNOWN = 1e3; /* mm; sigma of what nothing is known of */
enum { DURATIONS = MEMORIES / 2, LEAST = 8, STATES = 6 }; /* LEAST: views that tell */

/* Of the rough memories the correlation from frame to frame; the smooth one of each lasts as long:
 * its correlations have the same integral. */
static const double RHO[DURATIONS] = {0.01, 0.3,  0.5, 0.6,  0.7,  0.75,
                                      0.8,  0.85, 0.9, 0.93, 0.95, 0.97};

/* What a view says of the pose's error, e: y = e + c x + its own noise, all in mm. */
typedef struct datum {
    uint32_t frame, views; /* with those that are not kept */
    double y, c[4], own;   /* own: variance */
    double B[4];           /* by how much e adds to the slope of chi-square */
} datum;

/* Of all kept views that take part, in the order of the frames. */
typedef struct record {
    uint32_t n;
    datum d[LINE_KEPT];
    mat4 H; /* the information of all views */
    mat4 P; /* the covariance of the line by the segments' angles alone, which e leaves alone */
} record;

/* The matrix u I + v N, N = {{1, 1}, {-1, -1}}. N N = 0, so they multiply as numbers do. The
 * correlation of e over some frames, where it is what is kept of e's state, is u + v. */
typedef struct kept {
    double u, v;
} kept;

static kept times(kept a, kept b) {
    return (kept){a.u * b.u, a.u * b.v + a.v * b.u};
}

/* (1 - a) / (1 - b) */
static kept ratio(kept a, kept b) {
    double u = (1 - a.u) / (1 - b.u);
    return (kept){u, (u * b.v - a.v) / (1 - b.u)};
}

/* What is kept after so many frames of the state of e, of which e is the first number and, when it
 * is smooth, its change over c the second: exp(-c t) (I + c t N), c = -2 log rho. */
static kept keeps(int memory, double frames) {
    double rho = RHO[memory / 2], left = pow(rho, frames);
    if (memory % 2 == 0)
        return (kept){left, 0};
    return (kept){left * left, -2 * frames * log(rho) * left * left};
}

static int by_frame(const void *a, const void *b) {
    uint32_t x = ((const datum *)a)->frame, y = ((const datum *)b)->frame;
    return (x > y) - (x < y);
}

/* A += w B */
static void add(mat4 *A, double w, const mat4 *B) {
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++)
            A->m[i][j] += w * B->m[i][j];
}

/* A += w (a b' + b a') / 2 */
static void add_outer(mat4 *A, double w, const double a[4], const double b[4]) {
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++)
            A->m[i][j] += w * (a[i] * b[j] + b[i] * a[j]) / 2;
}

/* Adds what a view tells of the line by its angle: how much more it is off at the second end. */
static void add_angle(mat4 *H, const linear *r) {
    double c[4];
    for (int k = 0; k < 4; k++)
        c[k] = r->J[1][k] - r->J[0][k];
    add_outer(H, 1 / (r->cov[0] - 2 * r->cov[1] + r->cov[2]), c, c);
}

/* Fills *to. False when too few views tell. */
static bool list(const line *l, const scene *s, record *to) {
    pose_noise none = {0, 0, false};
    linear r, own;
    mat4 angles = {{{0}}};
    to->n = 0;
    to->H = angles;
    for (uint32_t i = 0; i < l->n_kept; i++) {
        const view *v = &l->kept[i];
        if (!l->inlier[i] || !view_linearise(v, &l->f, l->x, &s->noise, &r) ||
            !view_linearise(v, &l->f, l->x, &none, &own))
            continue;
        double px = sqrt(arris_dot(v->plane, v->plane)) / r.depth; /* by a mm */
        double det = r.cov[0] * r.cov[2] - r.cov[1] * r.cov[1];
        double w[2] = {(r.cov[2] - r.cov[1]) / det, (r.cov[0] - r.cov[1]) / det};
        double left = s->noise.corrected ? v->left : 1;
        datum *d = &to->d[to->n++];
        d->frame = v->frame;
        d->views = 1 + (l->stride > 1 ? l->rest[i].n : 0);
        d->y = (own.r[0] + own.r[1]) / 2 / px;
        d->own = (own.cov[0] + 2 * own.cov[1] + own.cov[2]) / (4 * px * px);
        for (int k = 0; k < 4; k++) {
            d->c[k] = (r.J[0][k] + r.J[1][k]) / 2 / px;
            d->B[k] = (w[0] * r.J[0][k] + w[1] * r.J[1][k]) * px * left;
        }
        info one = {0};
        info_add(&one, &r, l->x);
        add(&to->H, d->views, &one.H);
        add_angle(&angles, &own);
    }
    qsort(to->d, to->n, sizeof *to->d, by_frame);
    for (int k = 0; k < 4; k++)
        angles.m[k][k] += 1 / (UNKNOWN * UNKNOWN);
    return mat4_invert(&angles, &to->P) && to->n >= LEAST;
}

/* Lets frames pass: z <- F z, P <- F (P - I) F' + I in e's state, whose variance at rest is I. */
static void pass(double z[STATES], double P[STATES][STATES], kept k) {
    double F[2][2] = {{k.u + k.v, k.v}, {-k.v, k.u - k.v}}, a[2] = {z[0], z[1]};
    for (int i = 0; i < 2; i++) {
        z[i] = F[i][0] * a[0] + F[i][1] * a[1];
        P[i][i] -= 1;
    }
    for (int j = 0; j < STATES; j++) {
        double b[2] = {P[0][j], P[1][j]};
        for (int i = 0; i < 2; i++)
            P[i][j] = F[i][0] * b[0] + F[i][1] * b[1];
    }
    for (int j = 0; j < STATES; j++) {
        double b[2] = {P[j][0], P[j][1]};
        for (int i = 0; i < 2; i++)
            P[j][i] = F[i][0] * b[0] + F[i][1] * b[1];
    }
    for (int i = 0; i < 2; i++)
        P[i][i] += 1;
}

/* The variance of e, which is about `variance`, by its likelihood, of which *log_likelihood is the
 * logarithm: a Kalman filter over e's state and the line's four parameters. */
static double filter(const record *of, int memory, double variance, double *log_likelihood) {
    const datum *d = of->d;
    double z[STATES] = {0}, P[STATES][STATES] = {{1}, {0, 1}}, sum = 0, logs = 0;
    uint32_t n = of->n;
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++)
            P[2 + i][2 + j] = of->P.m[i][j] / variance;
    for (uint32_t i = 0; i < n; i++) {
        double h[STATES] = {1, 0, d[i].c[0], d[i].c[1], d[i].c[2], d[i].c[3]}, Ph[STATES];
        double F = d[i].own / variance, v = d[i].y;
        if (i > 0)
            pass(z, P, keeps(memory, d[i].frame - d[i - 1].frame));
        for (int k = 0; k < STATES; k++) {
            Ph[k] = 0;
            for (int j = 0; j < STATES; j++)
                Ph[k] += P[k][j] * h[j];
            F += h[k] * Ph[k];
            v -= h[k] * z[k];
        }
        sum += v * v / F;
        logs += log(F);
        for (int k = 0; k < STATES; k++) {
            z[k] += Ph[k] * v / F;
            for (int j = 0; j < STATES; j++)
                P[k][j] -= Ph[k] * Ph[j] / F;
        }
    }
    double dof = n - 2.0, found = fmax(sum / dof, DBL_MIN);
    *log_likelihood = -(dof * log(found) + logs) / 2;
    return found;
}

/* Adds to S the covariance that e of this variance, mm², gives to the slope of chi-square, but for
 * what each view has by itself. Of the m views from a kept one on e is kept^k, k < m. */
static void add_shared(mat4 *S, const record *of, int memory, double variance) {
    const datum *d = of->d;
    kept F[4] = {{0, 0}}, by_one = keeps(memory, 1);
    for (uint32_t i = 0; i < of->n; i++) {
        double m = d[i].views, slope[4];
        kept q = ratio(keeps(memory, m), by_one); /* the sum of these */
        kept within = times(by_one, ratio((kept){1 - m + q.u, q.v}, by_one));
        for (int k = 0; k < 4; k++) {
            kept before = times(F[k], q);
            slope[k] = before.u + before.v + (within.u + within.v) * d[i].B[k];
        }
        add_outer(S, 2 * variance, slope, d[i].B);
        if (i + 1 == of->n)
            break;
        double gap = d[i + 1].frame - d[i].frame;
        kept all = keeps(memory, gap), more = times(keeps(memory, fmax(gap - m + 1, 0)), q);
        for (int k = 0; k < 4; k++) {
            F[k] = times(F[k], all);
            F[k].u += more.u * d[i].B[k], F[k].v += more.v * d[i].B[k];
        }
    }
}

/* C S C */
static mat4 around(const mat4 *C, const mat4 *S) {
    mat4 rows, out;
    for (int i = 0; i < 4; i++)
        mat4_times(C, S->m[i], rows.m[i]); /* S C */
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) {
            out.m[i][j] = 0;
            for (int k = 0; k < 4; k++)
                out.m[i][j] += C->m[i][k] * rows.m[k][j];
        }
    return out;
}

void memory_begin(memories *m) {
    memset(m, 0, sizeof *m);
}

void memory_add(memories *m, const line *l, const scene *s) {
    record of;
    double stated = s->noise.position * s->noise.position, likelihood;
    if (stated <= 0 || !list(l, s, &of))
        return;
    for (int k = 0; k < MEMORIES; k++) {
        m->variance[k] += of.n * filter(&of, k, stated, &likelihood);
        m->likelihood[k] += likelihood;
    }
    m->views += of.n;
    m->most = fmax(m->most, of.n);
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
        int i = k / 2; /* beforehand, one correlation is as likely as another */
        double from = RHO[i > 0 ? i - 1 : 0], to = RHO[i + 1 < DURATIONS ? i + 1 : i];
        m->weight[k] = (to - from) * exp(m->likelihood[k] - best);
        sum += m->weight[k];
    }
    for (int k = 0; k < MEMORIES; k++)
        m->weight[k] /= sum;
}

mat4 memory_covariance(const memories *m, const line *l, const scene *s, double scale,
                       const mat4 *C, double *shared) {
    record of;
    mat4 S = {{{0}}};
    double stated = s->noise.position * s->noise.position, likelihood, sum = 0;
    bool tells = list(l, s, &of);
    for (int k = 0; k < MEMORIES; k++) {
        if (m->weight[k] < UNLIKELY)
            continue;
        double own = tells ? filter(&of, k, stated, &likelihood) : scale * stated;
        double variance = (of.n * own + PRIOR_DOF * m->variance[k]) / (of.n + PRIOR_DOF);
        add_shared(&S, &of, k, m->weight[k] * variance);
        sum += m->weight[k] * variance;
    }
    *shared = 0;
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++)
            *shared += S.m[i][j] * C->m[i][j] / 2;
    add(&S, scale, &of.H);
    for (const datum *d = of.d; d < of.d + of.n; d++)
        add_outer(&S, fmax(sum - scale * stated, 0) * d->views, d->B, d->B);
    return around(C, &S);
}
