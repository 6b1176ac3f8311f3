/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * huber.c: Newton's steps with modified residuals (Huber, Robust Statistics, 7.8; huber.h).
 */
#include "huber.h"

#include <math.h>

#define LIMIT 2.f    /* sigma beyond which an offset counts less */
#define INLIERS 0.7f /* share of the offsets that must be within */
#define FEW 0.9f     /* share above which one step is enough */
#define MOST 1e5f    /* sigma: no limit is beyond */
#define CHANCE 4.0   /* sigma from which waves are no chance */

enum { BLOCKS = 8 };

/* The line on its way: its offset and slope, and by what the sums of weighted residuals, and of
 * those times t, change them: each by its own, less each by the other. */
typedef struct newton {
    four line, own, other;
    float misfit, within; /* within: how many residuals were */
} newton;

/* Fills in `normal`, too. */
INLINE void least_squares(const huber_data *d, huber_line *l, newton *n) {
    eight w0 = {0}, w1 = {0}, w2 = {0}, q0 = {0}, q1 = {0};
    for (uint32_t i = 0; i * LANES < d->n; i++) {
        eight ww = d->weight[i] * d->weight[i], wt = ww * d->t[i];
        w0 += ww, w1 += wt, w2 += wt * d->t[i];
        q0 += ww * d->offset[i], q1 += wt * d->offset[i];
    }
    four sum = eight_sums((eight[]){q0, q1, w0, w1});
    double *w = l->normal;
    w[0] = (double)sum[2], w[1] = (double)sum[3], w[2] = (double)eight_sum(&w2);
    double per_det = 1 / (w[0] * w[2] - w[1] * w[1]);
    n->own = (four){(float)(w[2] * per_det), (float)(w[0] * per_det)};
    n->other = (four){(float)(w[1] * per_det), (float)(w[1] * per_det)};
    n->line = n->own * sum - n->other * __builtin_shufflevector(sum, sum, 1, 0, 2, 3);
}

/* One step towards the line whose residuals, at most `limit` each, are orthogonal to it. Returns
 * whether at least `share` of them were smaller. */
INLINE bool step(const huber_data *d, newton *n, float limit, float share) {
    eight offset = (eight){0} + n->line[0], slope = (eight){0} + n->line[1];
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
    n->line += n->own * sum - n->other * __builtin_shufflevector(sum, sum, 1, 0, 2, 3);
    n->misfit = sum[2], n->within = (float)d->n - sum[3];
    return n->within >= share * (float)d->n;
}

/* Looks for the least limit that leaves enough within, from wide to narrow: gross outliers, and
 * offsets that scatter by more than the weights claim. */
INLINE void narrow_down(const huber_data *d, newton *n) {
    newton best;
    float limit = LIMIT;
    n->line = (four){0}; /* the line that was expected */
    while (!step(d, n, limit, INLIERS) && limit < MOST)
        limit *= 2;
    do {
        best = *n;
        limit /= 2;
    } while (limit >= LIMIT && step(d, n, limit, INLIERS));
    *n = best;
    step(d, n, 2 * limit, INLIERS);
}

INLINE void fit(const huber_data *d, huber_line *l) {
    newton n;
    least_squares(d, l, &n);
    if (!step(d, &n, LIMIT, FEW)) {
        if (n.within < INLIERS * (float)d->n)
            narrow_down(d, &n);
        else
            step(d, &n, LIMIT, FEW);
    }
    double share = (double)n.within / d->n;
    l->offset = (double)n.line[0], l->slope = (double)n.line[1];
    l->misfit = (double)n.misfit;
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
