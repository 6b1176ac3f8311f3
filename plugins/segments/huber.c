/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * huber.c: Newton's steps with modified residuals (Huber, Robust Statistics, 7.8; huber.h).
 */
#include "huber.h"

#include <math.h>

#define LIMIT 2.f   /* sigma beyond which an offset counts less */
#define INLIERS 0.7 /* share of the offsets that must be within */
#define FEW 0.9     /* share above which one step is enough */
#define MOST 1e5f   /* sigma: no limit is beyond */
#define CHANCE 4.0  /* sigma from which waves are no chance */

enum { BLOCKS = 8 };

INLINE void solve(huber_line *l, double per_det, double a, double b) {
    const double *w = l->normal;
    l->offset += (w[2] * a - w[1] * b) * per_det;
    l->slope += (w[0] * b - w[1] * a) * per_det;
}

/* Fills in `normal`, too, and returns the reciprocal of its determinant. */
INLINE double least_squares(const huber_data *d, huber_line *l) {
    eight w0 = {0}, w1 = {0}, w2 = {0}, q0 = {0}, q1 = {0};
    for (uint32_t i = 0; i * LANES < d->n; i++) {
        eight ww = d->weight[i] * d->weight[i], wt = ww * d->t[i];
        w0 += ww, w1 += wt, w2 += wt * d->t[i];
        q0 += ww * d->offset[i], q1 += wt * d->offset[i];
    }
    four sum = eight_sums((eight[]){w0, w1, q0, q1});
    l->normal[0] = (double)sum[0];
    l->normal[1] = (double)sum[1];
    l->normal[2] = (double)eight_sum(&w2);
    l->offset = l->slope = 0;
    double per_det = 1 / (l->normal[0] * l->normal[2] - l->normal[1] * l->normal[1]);
    solve(l, per_det, (double)sum[2], (double)sum[3]);
    return per_det;
}

/* One step towards the line whose residuals, at most `limit` each, are orthogonal to it. Returns
 * the share of the offsets whose residuals were smaller. */
INLINE double step(const huber_data *d, huber_line *l, double per_det, float limit) {
    eight offset = (eight){0} + (float)l->offset, slope = (eight){0} + (float)l->slope;
    eight most = (eight){0} + limit, q0 = {0}, q1 = {0}, square = {0};
    eight_ints out = {0};
    for (uint32_t i = 0; i * LANES < d->n; i++) {
        eight e = (d->offset[i] - offset - slope * d->t[i]) * d->weight[i];
        eight_ints over = e > most, under = e < -most;
        out -= over + under; /* true is -1 */
        e = EIGHT_CHOOSE(over, most, EIGHT_CHOOSE(under, -most, e));
        square += e * e;
        e *= d->weight[i];
        q0 += e, q1 += e * d->t[i];
    }
    four sum = eight_sums((eight[]){q0, q1, square, __builtin_convertvector(out, eight)});
    l->misfit = (double)sum[2];
    solve(l, per_det, (double)sum[0], (double)sum[1]);
    return 1 - (double)sum[3] / d->n;
}

/* Looks for the least limit that leaves enough within, from wide to narrow: gross outliers, and
 * offsets that scatter by more than the weights claim. */
INLINE double narrow_down(const huber_data *d, huber_line *l, double per_det) {
    huber_line best;
    float limit = LIMIT;
    l->offset = l->slope = 0; /* the line that was expected */
    while (step(d, l, per_det, limit) < INLIERS && limit < MOST)
        limit *= 2;
    do {
        best = *l;
        limit /= 2;
    } while (limit >= LIMIT && step(d, l, per_det, limit) >= INLIERS);
    *l = best;
    return step(d, l, per_det, 2 * limit);
}

INLINE void fit(const huber_data *d, huber_line *l) {
    double per_det = least_squares(d, l), share = step(d, l, per_det, LIMIT);
    if (share < INLIERS)
        share = narrow_down(d, l, per_det);
    else if (share < FEW)
        share = step(d, l, per_det, LIMIT);
    l->spread = l->misfit / ((d->n - 2) * share * share);
}

static void fit_portable(const huber_data *d, huber_line *l) {
    fit(d, l);
}

AVX2_PATH static void fit_avx2(const huber_data *d, huber_line *l) {
    fit(d, l);
}

void huber_fit(const huber_data *d, huber_line *l) {
    (HAS_AVX2 && !d->portable ? fit_avx2 : fit_portable)(d, l);
}

double huber_beyond_chance(double variance, double dof, double sigma) {
    return variance > 1 + sigma * sqrt(2 / dof) ? variance : 1;
}

double huber_waves(const huber_data *d, const huber_line *l) {
    const float *offset = (const float *)d->offset, *weight = (const float *)d->weight;
    const float *t = (const float *)d->t, middle = (float)l->offset, slope = (float)l->slope;
    uint32_t size = d->n / BLOCKS > 4 ? d->n / BLOCKS : 4, blocks = d->n / size;
    double square = 0;
    if (blocks < 3)
        return 1;
    for (uint32_t k = 0; k < blocks; k++) {
        float sum = 0, w = 0;
        for (uint32_t i = k * size; i < (k + 1) * size; i++) {
            float ww = weight[i] * weight[i];
            sum += ww * (offset[i] - middle - slope * t[i]);
            w += ww;
        }
        square += (double)(sum * sum / w);
    }
    return huber_beyond_chance(square / (blocks - 2), blocks - 2, CHANCE);
}
