/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * mat4.c: symmetric 4x4 matrices. The inverse is by Cholesky's factors of the matrix scaled to a
 * unit diagonal.
 */
#include "mat4.h"

#include <math.h>

void mat4_times(const mat4 *A, const double x[4], double y[4]) {
    for (int i = 0; i < 4; i++)
        y[i] = A->m[i][0] * x[0] + A->m[i][1] * x[1] + A->m[i][2] * x[2] + A->m[i][3] * x[3];
}

double mat4_form(const mat4 *A, const double x[4], const double y[4]) {
    double Ay[4];
    mat4_times(A, y, Ay);
    return x[0] * Ay[0] + x[1] * Ay[1] + x[2] * Ay[2] + x[3] * Ay[3];
}

/* A = L L' with A scaled by 1 / (d[i] d[j]). */
static bool cholesky(const mat4 *A, const double d[4], double L[4][4]) {
    for (int i = 0; i < 4; i++)
        for (int j = 0; j <= i; j++) {
            double sum = A->m[i][j] / (d[i] * d[j]);
            for (int k = 0; k < j; k++)
                sum -= L[i][k] * L[j][k];
            if (i == j && !(sum > 1e-15))
                return false;
            L[i][j] = i == j ? sqrt(sum) : sum / L[j][j];
        }
    return true;
}

bool mat4_invert(const mat4 *A, mat4 *inverse) {
    double d[4], L[4][4], M[4][4] = {{0}}; /* M is the inverse of L */
    for (int i = 0; i < 4; i++)
        d[i] = sqrt(A->m[i][i]);
    if (!cholesky(A, d, L))
        return false;
    for (int j = 0; j < 4; j++)
        for (int i = j; i < 4; i++) {
            double sum = i == j;
            for (int k = j; k < i; k++)
                sum -= L[i][k] * M[k][j];
            M[i][j] = sum / L[i][i];
        }
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) {
            double sum = 0;
            for (int k = i > j ? i : j; k < 4; k++)
                sum += M[k][i] * M[k][j];
            inverse->m[i][j] = sum / (d[i] * d[j]);
        }
    return true;
}
