/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * info.c: what views say of a line (info.h).
 */
#include "info.h"

#include <math.h>

#include "lane.h"

/* A value for each parameter. */
typedef double each __attribute__((vector_size(32), aligned(8), may_alias));

void info_add(info *in, const linear *l, const double x[4]) {
    double det = l->cov[0] * l->cov[2] - l->cov[1] * l->cov[1];
    double w0 = l->cov[2] / det, w1 = -l->cov[1] / det, w2 = l->cov[0] / det, y[2];
    for (int k = 0; k < 2; k++) {
        y[k] = -l->r[k];
        for (int i = 0; i < 4; i++)
            y[k] += l->J[k][i] * x[i];
        in->squares += l->r[k] * l->r[k];
    }
    const each *J = (const each *)(const void *)l->J;
    each A = w0 * J[0] + w1 * J[1], B = w1 * J[0] + w2 * J[1];
    *(each *)(void *)in->g += A * y[0] + B * y[1];
    for (int i = 0; i < 4; i++)
        *(each *)(void *)in->H.m[i] += l->J[0][i] * A + l->J[1][i] * B;
    in->c += w0 * y[0] * y[0] + 2 * w1 * y[0] * y[1] + w2 * y[1] * y[1];
    in->misfit += l->misfit;
    in->weight++;
    in->n++;
}

/* y + px in the place of y in info_add, where y is J x but for the residuals, whose mean is 0. */
void info_move(info *in, const linear *l, const double x[4], double px) {
    double det = l->cov[0] * l->cov[2] - l->cov[1] * l->cov[1];
    double w[2] = {(l->cov[2] - l->cov[1]) / det, (l->cov[0] - l->cov[1]) / det};
    for (int k = 0; k < 2; k++) {
        double more = in->n * w[k] * px, y = 0;
        for (int i = 0; i < 4; i++) {
            in->g[i] += more * l->J[k][i];
            y += l->J[k][i] * x[i];
        }
        in->c += more * (2 * y + px);
    }
}

/* Adds to each of four sums its values for all views. */
INLINE void sum(double to[4], const lane a[4]) {
    lane b[2], *all = (lane *)(void *)to;
    for (int k = 0; k < 2; k++)
        b[k] = __builtin_shufflevector(a[2 * k], a[2 * k + 1], 0, 4, 2, 6) +
               __builtin_shufflevector(a[2 * k], a[2 * k + 1], 1, 5, 3, 7);
    *all += __builtin_shufflevector(b[0], b[1], 0, 1, 4, 5) +
            __builtin_shufflevector(b[0], b[1], 2, 3, 6, 7);
}

INLINE void add_views(info *in, const linears *l, const lane_bits *taken, const double x[4]) {
    lane J[2][4], r[2], y[2], A[4], B[4], H[4][4], g[4], rest[4] = {{0}};
    const lane *cov = (const lane *)(const void *)l->cov;
    lane det = cov[0] * cov[2] - cov[1] * cov[1];
    lane w0 = (lane)((lane_bits)(cov[2] / det) & *taken);
    lane w1 = (lane)((lane_bits)(-cov[1] / det) & *taken);
    lane w2 = (lane)((lane_bits)(cov[0] / det) & *taken);
    for (int k = 0; k < 2; k++) {
        r[k] = (lane)(*(const lane_bits *)(const void *)l->r[k] & *taken);
        y[k] = -r[k];
        for (int i = 0; i < 4; i++) {
            J[k][i] = (lane)(*(const lane_bits *)(const void *)l->J[k][i] & *taken);
            y[k] += J[k][i] * x[i];
        }
    }
    for (int i = 0; i < 4; i++) {
        A[i] = w0 * J[0][i] + w1 * J[1][i];
        B[i] = w1 * J[0][i] + w2 * J[1][i];
        g[i] = A[i] * y[0] + B[i] * y[1];
        for (int j = 0; j <= i; j++)
            H[i][j] = H[j][i] = J[0][i] * A[j] + J[1][i] * B[j];
    }
    rest[0] = w0 * y[0] * y[0] + 2 * w1 * y[0] * y[1] + w2 * y[1] * y[1];
    rest[1] = r[0] * r[0] + r[1] * r[1];
    rest[2] = (lane)(*(const lane_bits *)(const void *)l->misfit & *taken);
    for (int i = 0; i < 4; i++)
        sum(in->H.m[i], H[i]);
    sum(in->g, g);
    double total[4] = {0};
    sum(total, rest);
    in->c += total[0];
    in->squares += total[1];
    in->misfit += total[2];
}

static void add_portable(info *in, const linears *l, const lane_bits *taken, const double x[4]) {
    add_views(in, l, taken, x);
}

AVX2_PATH static void add_avx2(info *in, const linears *l, const lane_bits *taken,
                               const double x[4]) {
    add_views(in, l, taken, x);
}

void info_add_views(info *in, const linears *l, const bool take[VIEWS], const double x[4]) {
    lane_bits taken;
    for (int k = 0; k < VIEWS; k++) {
        taken[k] = -(int64_t)take[k];
        in->weight += take[k];
        in->n += take[k];
    }
    (HAS_AVX2 ? add_avx2 : add_portable)(in, l, &taken, x);
}

void info_sum(info *a, const info *b) {
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++)
            a->H.m[i][j] += b->H.m[i][j];
        a->g[i] += b->g[i];
    }
    a->c += b->c;
    a->squares += b->squares;
    a->misfit += b->misfit;
    a->weight += b->weight;
    a->n += b->n;
}

void info_weigh(info *in, double weight) {
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++)
            in->H.m[i][j] *= weight;
        in->g[i] *= weight;
    }
    in->c *= weight;
    in->weight *= weight;
}

void info_slope(const info *in, const double x[4], double slope[4]) {
    double Hx[4];
    mat4_times(&in->H, x, Hx);
    for (int i = 0; i < 4; i++)
        slope[i] = in->g[i] - Hx[i];
}

double info_chi2(const info *in, const double x[4]) {
    double chi2 = in->c + mat4_form(&in->H, x, x);
    for (int i = 0; i < 4; i++)
        chi2 -= 2 * in->g[i] * x[i];
    return chi2 > 0 ? chi2 : 0;
}
