/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * rigid.c: rigid motions.
 */
#include "rigid.h"

#include <math.h>
#include <string.h>

void rigid_matrix(const double q[4], double R[9]) {
    double w = q[0], x = q[1], y = q[2], z = q[3];
    R[0] = 1 - 2 * (y * y + z * z);
    R[1] = 2 * (x * y - w * z);
    R[2] = 2 * (x * z + w * y);
    R[3] = 2 * (x * y + w * z);
    R[4] = 1 - 2 * (x * x + z * z);
    R[5] = 2 * (y * z - w * x);
    R[6] = 2 * (x * z - w * y);
    R[7] = 2 * (y * z + w * x);
    R[8] = 1 - 2 * (x * x + y * y);
}

/* By the greatest of the four components, so that nothing is divided by a small one (Shepperd
 * 1978). */
void rigid_quaternion(const double R[9], double q[4]) {
    double square[4] = {1 + R[0] + R[4] + R[8], 1 + R[0] - R[4] - R[8], 1 - R[0] + R[4] - R[8],
                        1 - R[0] - R[4] + R[8]};
    double sum[4][4] = {{0, R[7] - R[5], R[2] - R[6], R[3] - R[1]},
                        {R[7] - R[5], 0, R[1] + R[3], R[2] + R[6]},
                        {R[2] - R[6], R[1] + R[3], 0, R[5] + R[7]},
                        {R[3] - R[1], R[2] + R[6], R[5] + R[7], 0}};
    int k = 0;
    for (int i = 1; i < 4; i++)
        k = square[i] > square[k] ? i : k;
    double twice = sqrt(square[k]), sign = k > 0 && sum[k][0] < 0 ? -1 : 1;
    for (int i = 0; i < 4; i++)
        q[i] = sign * (i == k ? twice / 2 : sum[k][i] / (2 * twice));
}

static double norm(const double q[4]) {
    return sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
}

bool rigid_normalise(double q[4]) {
    double n = norm(q);
    if (!(fabs(n - 1) < 1e-3))
        return false;
    for (int i = 0; i < 4; i++)
        q[i] /= n;
    return true;
}

void rigid_slerp(const double a[4], const double b[4], double f, double q[4]) {
    double dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3], sign = dot < 0 ? -1 : 1;
    double wa = 1 - f, wb = f, angle = acos(fmin(fabs(dot), 1));
    if (angle > 1e-6) { /* below, the chord is the arc to 1e-13 */
        wa = sin((1 - f) * angle) / sin(angle);
        wb = sin(f * angle) / sin(angle);
    }
    for (int i = 0; i < 4; i++)
        q[i] = wa * a[i] + sign * wb * b[i];
    double n = norm(q);
    for (int i = 0; i < 4; i++)
        q[i] /= n;
}

/* ---- a pose moved along ---------------------------------------------------------------------- */

/* The place of (i, j) in an upper triangle of 6x6, row by row. */
static int at(int i, int j) {
    int a = i < j ? i : j, b = i < j ? j : i;
    return a * 6 - a * (a - 1) / 2 + b - a;
}

/* cov = J cov J', with J = (1, -[v]x; 0, 1). */
static void move_covariance(double cov[21], const double v[3]) {
    double J[6][6] = {{1, 0, 0, 0, v[2], -v[1]}, {0, 1, 0, -v[2], 0, v[0]},
                      {0, 0, 1, v[1], -v[0], 0}, {0, 0, 0, 1, 0, 0},
                      {0, 0, 0, 0, 1, 0},        {0, 0, 0, 0, 0, 1}};
    double old[21];
    memcpy(old, cov, sizeof old);
    for (int i = 0; i < 6; i++)
        for (int j = i; j < 6; j++) {
            double sum = 0;
            for (int k = 0; k < 6; k++)
                for (int m = 0; m < 6; m++)
                    sum += J[i][k] * old[at(k, m)] * J[j][m];
            cov[at(i, j)] = sum;
        }
}

void rigid_move(arris_pose *pose, const double t[3], const double q[4]) {
    double X[9], R[9], v[3];
    rigid_matrix(q, X);
    for (int i = 0; i < 3; i++)
        v[i] = pose->R[i] * t[0] + pose->R[3 + i] * t[1] + pose->R[6 + i] * t[2];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            R[3 * i + j] =
                X[i] * pose->R[j] + X[3 + i] * pose->R[3 + j] + X[6 + i] * pose->R[6 + j];
    memcpy(pose->R, R, sizeof R);
    for (int i = 0; i < 3; i++)
        pose->C[i] += v[i];
    move_covariance(pose->cov, v);
}
