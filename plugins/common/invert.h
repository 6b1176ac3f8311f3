/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * invert.h: the inverse of a small matrix.
 */
#ifndef INVERT_H
#define INVERT_H

#include <stdbool.h>

enum { INVERT_MAX = 32 }; /* rows, at most */

/* Puts the inverse of a symmetric positive definite n x n matrix in its place, whose rows lie
 * `stride` numbers apart: scaled to a unit diagonal, by Gauss and Jordan. False when it is
 * singular: what it holds then is of no use. */
bool invert(double *A, int n, int stride);

#endif
