/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * invert.c: the inverse of a small matrix (invert.h).
 */
#include "invert.h"

#include <math.h>

static const double SINGULAR = 1e-12; /* pivot of the scaled matrix */

static void scale(double *A, int n, int stride, const double *s) {
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++)
            A[i * stride + j] *= s[i] * s[j];
}

bool invert(double *A, int n, int stride) {
    double s[INVERT_MAX] = {0};
    for (int i = 0; i < n; i++) {
        s[i] = 1 / sqrt(A[i * stride + i]);
        if (!isfinite(s[i]))
            return false;
    }
    scale(A, n, stride, s);
    for (int i = 0; i < n; i++) {
        double *row = A + i * stride, d = row[i];
        if (!(d > SINGULAR))
            return false;
        row[i] = 1;
        for (int j = 0; j < n; j++)
            row[j] /= d;
        for (int k = 0; k < n; k++) {
            double *other = A + k * stride, l = other[i];
            if (k == i)
                continue;
            other[i] = 0;
            for (int j = 0; j < n; j++)
                other[j] -= l * row[j];
        }
    }
    scale(A, n, stride, s);
    return true;
}
