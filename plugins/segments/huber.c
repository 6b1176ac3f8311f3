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

static void solve(huber_line *l, double a, double b) {
    const double *w = l->normal, det = w[0] * w[2] - w[1] * w[1];
    l->offset += (w[2] * a - w[1] * b) / det;
    l->slope += (w[0] * b - w[1] * a) / det;
}

/* Fills in `normal`, too. */
static void least_squares(const huber_data *d, huber_line *l) {
    four w0 = {0}, w1 = {0}, w2 = {0}, q0 = {0}, q1 = {0};
    for (uint32_t i = 0; i * 4 < d->n; i++) {
        four ww = d->weight[i] * d->weight[i], wt = ww * d->t[i];
        w0 += ww, w1 += wt, w2 += wt * d->t[i];
        q0 += ww * d->offset[i], q1 += wt * d->offset[i];
    }
    l->normal[0] = (double)four_sum(w0);
    l->normal[1] = (double)four_sum(w1);
    l->normal[2] = (double)four_sum(w2);
    l->offset = l->slope = 0;
    solve(l, (double)four_sum(q0), (double)four_sum(q1));
}

/* One step towards the line whose residuals, at most `limit` each, are orthogonal to it. Returns
 * the share of the offsets whose residuals were smaller. */
static double step(const huber_data *d, huber_line *l, float limit) {
    four offset = (four){0} + (float)l->offset, slope = (four){0} + (float)l->slope;
    four most = (four){0} + limit, q0 = {0}, q1 = {0}, square = {0};
    four_bits out = {0};
    for (uint32_t i = 0; i * 4 < d->n; i++) {
        four e = (d->offset[i] - offset - slope * d->t[i]) * d->weight[i];
        four_bits over = e > most, under = e < -most;
        out -= over + under; /* true is -1 */
        e = four_choose(over, most, four_choose(under, -most, e));
        square += e * e;
        e *= d->weight[i];
        q0 += e, q1 += e * d->t[i];
    }
    l->misfit = (double)four_sum(square);
    solve(l, (double)four_sum(q0), (double)four_sum(q1));
    return 1 - (double)(out[0] + out[1] + out[2] + out[3]) / d->n;
}

/* Looks for the least limit that leaves enough within, from wide to narrow: gross outliers, and
 * offsets that scatter by more than the weights claim. */
static double narrow_down(const huber_data *d, huber_line *l) {
    huber_line best;
    float limit = LIMIT;
    l->offset = l->slope = 0; /* the line that was expected */
    while (step(d, l, limit) < INLIERS && limit < MOST)
        limit *= 2;
    do {
        best = *l;
        limit /= 2;
    } while (limit >= LIMIT && step(d, l, limit) >= INLIERS);
    *l = best;
    return step(d, l, 2 * limit);
}

void huber_fit(const huber_data *d, huber_line *l) {
    least_squares(d, l);
    double share = step(d, l, LIMIT);
    if (share < INLIERS)
        share = narrow_down(d, l);
    else if (share < FEW)
        share = step(d, l, LIMIT);
    l->spread = l->misfit / ((d->n - 2) * share * share);
}

double huber_beyond_chance(double variance, double dof, double sigma) {
    return variance > 1 + sigma * sqrt(2 / dof) ? variance : 1;
}

double huber_waves(const huber_data *d, const huber_line *l) {
    const float *offset = (const float *)d->offset, *weight = (const float *)d->weight;
    const float *t = (const float *)d->t;
    uint32_t size = d->n / BLOCKS > 4 ? d->n / BLOCKS : 4, blocks = d->n / size;
    double square = 0;
    if (blocks < 3)
        return 1;
    for (uint32_t k = 0; k < blocks; k++) {
        double sum = 0, w = 0;
        for (uint32_t i = k * size; i < (k + 1) * size; i++) {
            double ww = (double)(weight[i] * weight[i]);
            sum += ww * ((double)offset[i] - l->offset - l->slope * (double)t[i]);
            w += ww;
        }
        square += sum * sum / w;
    }
    return huber_beyond_chance(square / (blocks - 2), blocks - 2, CHANCE);
}
