/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * dense.h: a dense symmetric matrix of up to DENSE rows, of which the upper half counts, and its
 * Cholesky factor.
 */
#ifndef ADJUST_DENSE_H
#define ADJUST_DENSE_H

#include <stdbool.h>
#include <stddef.h>

enum { DENSE = 256 };
typedef double dense[DENSE][DENSE];

/* y -= t a, n numbers of each, which do not overlap. */
void dense_subtract(size_t n, double t, const double *a, double *y);

/* U becomes its factor: U' U is what it was. False when that is not positive definite. */
bool dense_factor(dense U, size_t n);
/* x becomes U'^-1 x, where the first `from` of x are 0. */
void dense_forward(const dense U, size_t from, size_t n, double *x);
/* x becomes U^-1 x. */
void dense_backward(const dense U, size_t n, double *x);

#endif
