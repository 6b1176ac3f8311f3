/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * factor.c: what is done with the factors, whoever made them (solve.h).
 */
#include "solve.h"

void adj_factor_solve(const adj_factor *f, const double *b, double *x, double *work) {
    for (int j = 0; j < f->n; j++)
        work[j] = b[f->perm[j]];
    for (int j = 0; j < f->n; j++)
        for (int k = f->ptr[j] + 1; k < f->ptr[j] + f->nz[j]; k++)
            work[f->row[k]] -= f->val[k] * work[j];
    for (int j = f->n - 1; j >= 0; j--) {
        double sum = work[j] / f->val[f->ptr[j]];
        for (int k = f->ptr[j] + 1; k < f->ptr[j] + f->nz[j]; k++)
            sum -= f->val[k] * work[f->row[k]];
        work[j] = sum;
    }
    for (int j = 0; j < f->n; j++)
        x[f->perm[j]] = work[j];
}

/* Column j of the inverse Z, Z = D⁻¹ L⁻¹ + (1 - L') Z, from those after it: the rows of those are
 * known where j has rows, since whoever eliminates j joins them. */
static void invert_column(const adj_factor *f, int j, double *inverse, const int *place,
                          double *column) {
    int first = f->ptr[j] + 1, end = f->ptr[j] + f->nz[j];
    for (int k = first; k < end; k++)
        column[k - first] = 0;
    for (int k = first; k < end; k++) {
        int q = f->row[k], at = f->ptr[q], last = at + f->nz[q];
        double l = f->val[k], sum = inverse[at] * l;
        while (++at < last) {
            int i = place[f->row[at]];
            if (i < 0)
                continue;
            column[i] -= inverse[at] * l;
            sum += inverse[at] * f->val[first + i];
        }
        column[k - first] -= sum;
    }
    double diagonal = 1 / f->val[first - 1];
    for (int k = first; k < end; k++) {
        inverse[k] = column[k - first];
        diagonal -= f->val[k] * inverse[k];
    }
    inverse[first - 1] = diagonal;
}

void adj_factor_invert(const adj_factor *f, double *inverse, int *work, double *column) {
    for (int j = f->n - 1; j >= 0; j--) {
        int first = f->ptr[j] + 1, n = f->nz[j] - 1;
        for (int k = 0; k < n; k++)
            work[f->row[first + k]] = k;
        invert_column(f, j, inverse, work, column);
        for (int k = 0; k < n; k++)
            work[f->row[first + k]] = -1;
    }
}
