/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * conjugate.c: solves by conjugate gradients (solve.h; Hestenes and Stiefel 1952; as Saad 2003,
 * algorithm 9.1, has them).
 */
#include <string.h>

#include "solve.h"

/* y = A x */
static void times(const adj_matrix *A, const double *x, double *y) {
    memset(y, 0, (size_t)A->n * sizeof *y);
    for (int j = 0; j < A->n; j++) {
        int end = A->ptr[j + 1] - 1;
        double sum = A->val[end] * x[j];
        for (int k = A->ptr[j]; k < end; k++) {
            sum += A->val[k] * x[A->row[k]];
            y[A->row[k]] += A->val[k] * x[j];
        }
        y[j] += sum;
    }
}

static double dot(const double *a, const double *b, int n) {
    double sum = 0;
    for (int i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

/* a += t b */
static void add(double *a, double t, const double *b, int n) {
    for (int i = 0; i < n; i++)
        a[i] += t * b[i];
}

int adj_conjugate(const adj_matrix *A, const adj_factor *f, const double *b, double *x, int most,
                  double share, double *work) {
    int n = A->n;
    double *r = work, *z = r + n, *d = z + n, *Ad = d + n, *scratch = Ad + n;
    memcpy(r, b, (size_t)n * sizeof *r);
    memset(x, 0, (size_t)n * sizeof *x);
    adj_factor_solve(f, r, z, scratch);
    memcpy(d, z, (size_t)n * sizeof *d);
    double rz = dot(r, z, n), first = rz;
    for (int i = 1; i <= most; i++) {
        times(A, d, Ad);
        double t = rz / dot(d, Ad, n), was = rz;
        add(x, t, d, n);
        add(r, -t, Ad, n);
        adj_factor_solve(f, r, z, scratch);
        rz = dot(r, z, n);
        if (rz <= share * first)
            return i;
        for (int k = 0; k < n; k++)
            d[k] = z[k] + rz / was * d[k];
    }
    return 0;
}
