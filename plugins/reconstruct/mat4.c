/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * mat4.c: symmetric 4x4 matrices. The inverse is by elimination of the matrix scaled to a unit
 * diagonal.
 */
#include "mat4.h"

#include <math.h>

static const double LEAST = 1e-15; /* of a scaled pivot: less is rounding */

void mat4_times(const mat4 *A, const double x[4], double y[4]) {
    for (int i = 0; i < 4; i++)
        y[i] = A->m[i][0] * x[0] + A->m[i][1] * x[1] + A->m[i][2] * x[2] + A->m[i][3] * x[3];
}

double mat4_form(const mat4 *A, const double x[4], const double y[4]) {
    double Ay[4];
    mat4_times(A, y, Ay);
    return x[0] * Ay[0] + x[1] * Ay[1] + x[2] * Ay[2] + x[3] * Ay[3];
}

/* In blocks of 2x2 of the scaled matrix: [P Q; Q' R] has the inverse
 * [P^-1 + E S^-1 E', -E S^-1; -S^-1 E', S^-1] with E = P^-1 Q and S = R - Q' E. */
bool mat4_invert(const mat4 *A, mat4 *inverse) {
    double d[4], a[4][4], E[2][2], T[2][2];
    for (int i = 0; i < 4; i++)
        d[i] = 1 / sqrt(A->m[i][i]);
    for (int i = 0; i < 4; i++)
        for (int j = 0; j <= i; j++)
            a[i][j] = a[j][i] = A->m[i][j] * (d[i] * d[j]);
    double det = a[0][0] * a[1][1] - a[0][1] * a[0][1];
    if (!(det > LEAST))
        return false;
    double p = a[1][1] / det, q = -a[0][1] / det, r = a[0][0] / det;
    for (int j = 0; j < 2; j++) {
        E[0][j] = p * a[0][2 + j] + q * a[1][2 + j];
        E[1][j] = q * a[0][2 + j] + r * a[1][2 + j];
    }
    double s = a[2][2] - a[2][0] * E[0][0] - a[2][1] * E[1][0];
    double t = a[2][3] - a[2][0] * E[0][1] - a[2][1] * E[1][1];
    double u = a[3][3] - a[3][0] * E[0][1] - a[3][1] * E[1][1];
    det = s * u - t * t;
    if (!(s > LEAST && det > LEAST * s))
        return false;
    a[2][2] = u / det, a[2][3] = a[3][2] = -t / det, a[3][3] = s / det;
    for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++) {
            T[i][j] = E[i][0] * a[2][2 + j] + E[i][1] * a[3][2 + j];
            a[i][2 + j] = a[2 + j][i] = -T[i][j];
        }
    a[0][0] = p + T[0][0] * E[0][0] + T[0][1] * E[0][1];
    a[0][1] = a[1][0] = q + T[0][0] * E[1][0] + T[0][1] * E[1][1];
    a[1][1] = r + T[1][0] * E[1][0] + T[1][1] * E[1][1];
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++)
            inverse->m[i][j] = a[i][j] * (d[i] * d[j]);
    return true;
}
