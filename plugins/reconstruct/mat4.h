/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * mat4.h: symmetric 4x4 matrices: a line has four parameters.
 */
#ifndef MAT4_H
#define MAT4_H

#include <stdbool.h>

typedef struct mat4 {
    double m[4][4];
} mat4;

/* y = A x */
void mat4_times(const mat4 *A, const double x[4], double y[4]);

/* x' A y */
double mat4_form(const mat4 *A, const double x[4], const double y[4]);

/* The inverse of a positive definite matrix; false when it isn't one. */
bool mat4_invert(const mat4 *A, mat4 *inverse);

#endif
