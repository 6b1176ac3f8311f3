/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * marginals.c: covariances of poses and lines (adjust.h): of the inverse, those entries that lie
 * where the factor has some.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "work.h"

static int reserve(adj_work *w) {
    const adj_factor *f = &w->factor;
    size_t n = 0;
    for (int j = 0; j < f->n; j++) {
        size_t end = (size_t)f->ptr[j] + (size_t)f->nz[j];
        n = end > n ? end : n;
    }
    if (n <= w->max_inverse)
        return 0;
    free(w->inverse);
    w->inverse = malloc(n * sizeof *w->inverse);
    w->max_inverse = w->inverse ? n : 0;
    return w->inverse ? 0 : ARRIS_E_MEMORY;
}

int adj_marginals(adj_problem *p, adj_work *w) {
    int rc = adj_work_plan(w, p);
    if (rc)
        return rc;
    if (!adj_system_fill(&w->system, p, 0))
        return ARRIS_E_INPUT;
    rc = adj_work_factor(w);
    rc = rc ? rc : reserve(w);
    if (rc)
        return rc;
    for (int j = 0; j < w->factor.n; j++)
        w->place[j] = -1;
    adj_factor_invert(&w->factor, w->inverse, w->place, w->scratch);
    for (int j = 0; j < w->factor.n; j++)
        w->place[w->factor.perm[j]] = j;
    return 0;
}

/* The entry of the inverse for two unknowns of one pose or line. */
static double at(const adj_work *w, int i, int j) {
    const adj_factor *f = &w->factor;
    int a = w->place[i], b = w->place[j];
    int column = a < b ? a : b, row = a < b ? b : a;
    int low = f->ptr[column], high = low + f->nz[column] - 1;
    while (low < high) {
        int mid = (low + high) / 2;
        if (f->row[mid] < row)
            low = mid + 1;
        else
            high = mid;
    }
    return w->inverse[low];
}

static void block(const adj_work *w, int first, int n, double *cov) {
    for (int r = 0; r < n; r++)
        for (int c = 0; c < n; c++)
            cov[n * r + c] = at(w, first + r, first + c);
}

void adj_pose_covariance(const adj_work *w, uint32_t frame, double cov[36]) {
    block(w, w->system.poses + 6 * (int)frame, 6, cov);
}

void adj_line_covariance(const adj_work *w, uint32_t line, double cov[16]) {
    block(w, 4 * (int)line, 4, cov);
}

double adj_state_variance(const adj_work *w, int state) {
    return at(w, w->system.common + state, w->system.common + state);
}

void adj_error_variance(const adj_work *w, const adj_problem *p, uint32_t frame, double v[6]) {
    double e[6], G[6][ADJ_COMMON], scale = adj_scale(p);
    int first = w->system.poses + 6 * (int)frame, common = w->system.common, n = adj_n_common(p);
    adj_error(p, frame, e, NULL, G);
    for (int k = 0; k < 6; k++) {
        double D = k < 3 ? 1 / scale : 1;
        v[k] = D * D * at(w, first + k, first + k);
        for (int i = 0; i < n; i++) {
            v[k] -= 2 * D * G[k][i] * at(w, first + k, common + i);
            for (int j = 0; j < n; j++)
                v[k] += G[k][i] * G[k][j] * at(w, common + i, common + j);
        }
    }
}
