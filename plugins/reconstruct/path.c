/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * path.c: the slow part of the positions' error (path.h).
 */
#include "path.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double BIAS = 0.05; /* px, of any line, as in shift.c */
enum { SPACING = 16, KNOTS = 64, UNKNOWNS = 3 * KNOTS };

struct path {
    uint32_t n;     /* unknowns */
    double spacing; /* frames from knot to knot */
    double x[UNKNOWNS];
    double A[UNKNOWNS][UNKNOWNS]; /* the lower half; then its Cholesky factor */
};

/* A line's share of the normal equations: of itself, of both, of the path. */
typedef struct part {
    mat4 H;
    double B[4][UNKNOWNS], g[4];
} part;

path *path_new(void) {
    return calloc(1, sizeof(path));
}

void path_free(path *p) {
    free(p);
}

/* The two knots about a frame: the first unknown, the weights. */
static uint32_t knots(const path *p, uint32_t at_frame, double w[2]) {
    double at = at_frame / p->spacing, k = fmin(floor(at), p->n / 3 - 2.0);
    w[1] = fmin(at - k, 1);
    w[0] = 1 - w[1];
    return 3 * (uint32_t)k;
}

void path_begin(path *p, const shifts *t, uint32_t frames, const scene *s) {
    uint32_t n = frames / SPACING + 2;
    double w[2], d[3], weight[9];
    n = n < KNOTS ? n : KNOTS;
    p->n = 3 * n;
    p->spacing = frames / (n - 1.0);
    memset(p->x, 0, sizeof p->x);
    memset(p->A, 0, sizeof p->A);
    shifts_prior(t, weight);
    for (uint32_t place = 0, at; place < shifts_places(t); place++) {
        if (!shifts_at(t, place, &at, d))
            continue;
        uint32_t k = knots(p, at, w);
        for (uint32_t i = 0; i < 6; i++)
            for (uint32_t j = 0; j < 6; j++) {
                double a = w[i / 3] * weight[3 * (i % 3) + j % 3] / s->memories.mean;
                p->A[k + i][k + j] += a * w[j / 3];
                p->x[k + i] -= j < 3 ? a * d[j] : 0;
            }
    }
}

/* Adds a view, linear about the line: J dx - plane / depth d + r = 0 at both ends. A and y, which
 * may be NULL, are of the path alone. */
static void add_view(const path *p, const view *v, linear *r, double scale, double bias, part *a,
                     double A[][UNKNOWNS], double *y) {
    double c0 = scale * r->cov[0] + bias, c1 = scale * r->cov[1] + bias,
           c2 = scale * r->cov[2] + bias, w[2];
    double det = c0 * c2 - c1 * c1, W[2][2] = {{c2 / det, -c1 / det}, {-c1 / det, c0 / det}};
    uint32_t k = knots(p, v->frame, w);
    double G[6], both = W[0][0] + 2 * W[0][1] + W[1][1];
    for (int i = 0; i < 6; i++)
        G[i] = w[i / 3] * v->plane[i % 3] / r->depth;
    double rest = (W[0][0] + W[1][0]) * r->r[0] + (W[0][1] + W[1][1]) * r->r[1];
    for (int i = 0; i < 4; i++) {
        double J[2] = {W[0][0] * r->J[0][i] + W[0][1] * r->J[1][i],
                       W[1][0] * r->J[0][i] + W[1][1] * r->J[1][i]};
        for (int j = 0; j < 4; j++)
            a->H.m[i][j] += J[0] * r->J[0][j] + J[1] * r->J[1][j];
        for (uint32_t j = 0; j < 6; j++)
            a->B[i][k + j] += (J[0] + J[1]) * G[j];
        a->g[i] -= J[0] * r->r[0] + J[1] * r->r[1];
    }
    for (uint32_t i = 0; A && i < 6; i++) {
        for (uint32_t j = 0; j < 6; j++)
            A[k + i][k + j] += both * G[i] * G[j];
        y[k + i] += rest * G[i];
    }
}

static void add_views(const path *p, const line *l, const scene *s, double scale, double bias,
                      part *a, double A[][UNKNOWNS], double *y) {
    linear r;
    memset(a, 0, sizeof *a);
    for (uint32_t i = 0; i < l->n_kept; i++)
        if (l->inlier[i] && view_linearise(&l->kept[i], &l->f, l->x, &s->noise, &r))
            add_view(p, &l->kept[i], &r, scale, bias, a, A, y);
}

/* With the line eliminated: A - B' H^-1 B, y + B' H^-1 g. */
void path_add(path *p, const line *l, const scene *s) {
    part a;
    mat4 C;
    info past = line_past(l, s);
    double slope[4];
    add_views(p, l, s, l->scale * s->memories.mean, BIAS * BIAS, &a, p->A, p->x);
    info_slope(&past, l->x, slope);
    for (int i = 0; i < 4; i++) {
        a.g[i] += slope[i];
        for (int j = 0; j < 4; j++)
            a.H.m[i][j] += past.H.m[i][j] + (i == j) / (l->prior * l->prior);
    }
    if (!mat4_invert(&a.H, &C))
        return;
    for (uint32_t i = 0; i < p->n; i++) {
        double b[4] = {a.B[0][i], a.B[1][i], a.B[2][i], a.B[3][i]}, Cb[4];
        mat4_times(&C, b, Cb);
        p->x[i] += arris_dot(Cb, a.g) + Cb[3] * a.g[3];
        for (uint32_t j = 0; j <= i; j++)
            p->A[i][j] -=
                Cb[0] * a.B[0][j] + Cb[1] * a.B[1][j] + Cb[2] * a.B[2][j] + Cb[3] * a.B[3][j];
    }
}

/* L x = b */
static void forward(const path *p, double *x) {
    for (uint32_t i = 0; i < p->n; i++) {
        for (uint32_t j = 0; j < i; j++)
            x[i] -= p->A[i][j] * x[j];
        x[i] /= p->A[i][i];
    }
}

bool path_solve(path *p) {
    for (uint32_t i = 0; i < p->n; i++)
        for (uint32_t j = 0; j <= i; j++) {
            double sum = p->A[i][j];
            for (uint32_t k = 0; k < j; k++)
                sum -= p->A[i][k] * p->A[j][k];
            if (i == j && !(sum > 0)) {
                p->n = 0;
                return false;
            }
            p->A[i][j] = i == j ? sqrt(sum) : sum / p->A[j][j];
        }
    forward(p, p->x);
    for (uint32_t i = p->n; i-- > 0;) {
        for (uint32_t j = i + 1; j < p->n; j++)
            p->x[i] -= p->A[j][i] * p->x[j];
        p->x[i] /= p->A[i][i];
    }
    return true;
}

void path_shift(const path *p, line *l) {
    for (uint32_t i = 0; i < l->n_kept; i++) {
        double w[2];
        uint32_t k = knots(p, l->kept[i].frame, w);
        for (uint32_t j = 0; j < 6; j++)
            l->kept[i].shift[j % 3] += w[j / 3] * p->x[k + j];
    }
}

/* The path's error e moves the line by H^-1 B e. */
mat4 path_covariance(const path *p, const line *l, const scene *s) {
    part a;
    mat4 C, out = {{{0}}};
    if (p->n == 0)
        return out;
    add_views(p, l, s, 1, 0, &a, NULL, NULL);
    if (!mat4_invert(&l->all.H, &C))
        return out;
    double M[4][UNKNOWNS];
    for (int i = 0; i < 4; i++) {
        for (uint32_t k = 0; k < p->n; k++) {
            M[i][k] = 0;
            for (int j = 0; j < 4; j++)
                M[i][k] += C.m[i][j] * a.B[j][k];
        }
        forward(p, M[i]);
    }
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++)
            for (uint32_t k = 0; k < p->n; k++)
                out.m[i][j] += M[i][k] * M[j][k];
    return out;
}
