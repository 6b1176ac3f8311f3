/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * dense.c: dense matrices (dense.h), by whole rows, which the compiler vectorises.
 */
#include "dense.h"

#include <math.h>

void dense_subtract(size_t n, double t, const double *restrict a, double *restrict y) {
    for (size_t i = 0; i < n; i++)
        y[i] -= t * a[i];
}

bool dense_factor(dense U, size_t n) {
    for (size_t k = 0; k < n; k++) {
        double root = sqrt(U[k][k]);
        if (!(root > 0))
            return false;
        for (size_t j = k; j < n; j++)
            U[k][j] /= root;
        for (size_t i = k + 1; i < n; i++)
            if (U[k][i] != 0)
                dense_subtract(n - i, U[k][i], U[k] + i, U[i] + i);
    }
    return true;
}

void dense_forward(const dense U, size_t from, size_t n, double *x) {
    for (size_t k = from; k < n; k++) {
        x[k] /= U[k][k];
        dense_subtract(n - k - 1, x[k], U[k] + k + 1, x + k + 1);
    }
}

void dense_backward(const dense U, size_t n, double *x) {
    for (size_t k = n; k-- > 0;) {
        for (size_t j = k + 1; j < n; j++)
            x[k] -= U[k][j] * x[j];
        x[k] /= U[k][k];
    }
}
