/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * info.c: what views say of a line (info.h).
 */
#include "info.h"

#include <math.h>

/* A value for each parameter. */
typedef double four __attribute__((vector_size(32), aligned(8), may_alias));

void info_add(info *in, const linear *l, const double x[4]) {
    double det = l->cov[0] * l->cov[2] - l->cov[1] * l->cov[1];
    double w0 = l->cov[2] / det, w1 = -l->cov[1] / det, w2 = l->cov[0] / det, y[2];
    for (int k = 0; k < 2; k++) {
        y[k] = -l->r[k];
        for (int i = 0; i < 4; i++)
            y[k] += l->J[k][i] * x[i];
        in->squares += l->r[k] * l->r[k];
    }
    const four *J = (const four *)(const void *)l->J;
    four A = w0 * J[0] + w1 * J[1], B = w1 * J[0] + w2 * J[1];
    *(four *)(void *)in->g += A * y[0] + B * y[1];
    for (int i = 0; i < 4; i++)
        *(four *)(void *)in->H.m[i] += l->J[0][i] * A + l->J[1][i] * B;
    in->c += w0 * y[0] * y[0] + 2 * w1 * y[0] * y[1] + w2 * y[1] * y[1];
    in->misfit += l->misfit;
    in->weight++;
    in->n++;
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
    return fmax(chi2, 0);
}
