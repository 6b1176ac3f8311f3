/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * noise.c: what the residuals tell of the noise (noise.h).
 */
#include "noise.h"

#include <math.h>
#include <string.h>

static const double FEW = 50; /* residuals that stand for what is expected before any were seen */
static const double MOST_CORRELATED = 0.9;

/* A camera that is off by d sees every line off by n d, n the normal of its plane: so the products
 * of different lines' residuals have the mean d² n n', whatever each line's own noise. */
double noise_add(noise *n, const view *v, const linear *r, double before) {
    double normal[3] = {v->plane[0], v->plane[1], v->plane[2]};
    double offset = (r->r[0] + r->r[1]) / 2, mm = offset * r->depth / arris_unit(normal);
    double sigma = sqrt((r->cov[0] + 2 * r->cov[1] + r->cov[2]) / 4);
    for (int i = 0; i < 3; i++) {
        n->v[i] += mm * normal[i];
        for (int j = 0; j < 3; j++)
            n->M[3 * i + j] += normal[i] * normal[j];
    }
    n->self += mm * mm;
    n->lines++;
    n->product += before * offset / sigma;
    n->square += before != 0 ? before * before : 0;
    return offset / sigma;
}

void noise_end_frame(noise *n) {
    double pairs = -n->lines;
    for (int i = 0; i < 9; i++)
        pairs += n->M[i] * n->M[i];
    n->common += arris_dot(n->v, n->v) - n->self;
    n->weight += pairs;
    memset(n->v, 0, sizeof n->v);
    memset(n->M, 0, sizeof n->M);
    n->self = n->lines = 0;
}

double noise_position(const noise *n) {
    return n->common > 0 && n->weight > 0 ? sqrt(n->common / (n->weight + FEW)) : 0;
}

double noise_memory(const noise *n) {
    double rho = n->square > 0 ? n->product / (n->square + FEW) : 0;
    rho = fmin(fmax(rho, 0), MOST_CORRELATED);
    return (1 + rho) / (1 - rho);
}
