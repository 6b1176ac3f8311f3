/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * tell.c: what is told of a line (tell.h).
 */
#include "tell.h"

#include <math.h>

/* Moves the end onto the line, and returns its place there: -1 and 1 are at l->x's two points. */
static double settle(const adj_line *l, double end[3]) {
    double P[3], Q[3], d[3], e[3];
    adj_line_points(l, P, Q);
    for (int i = 0; i < 3; i++)
        d[i] = Q[i] - P[i], e[i] = end[i] - P[i];
    double t = arris_dot(e, d) / arris_dot(d, d);
    for (int i = 0; i < 3; i++)
        end[i] = P[i] + t * d[i];
    return 2 * t - 1;
}

/* The variances along u of p and q. */
static void variances_along(const double cov[21], const double u[3], double along[2]) {
    along[0] = along[1] = 0;
    for (int i = 0, n = 0; i < 6; i++)
        for (int j = i; j < 6; j++, n++)
            if (i / 3 == j / 3)
                along[i / 3] += (i == j ? 1 : 2) * u[i % 3] * cov[n] * u[j % 3];
}

void tell_line(const adj_line *l, const double cov[16], arris_line *out) {
    double place[2] = {settle(l, out->p), settle(l, out->q)}, u[3], along[2], A[6][4];
    for (int i = 0; i < 3; i++)
        u[i] = out->q[i] - out->p[i];
    arris_unit(u);
    variances_along(out->cov, u, along);
    for (int i = 0; i < 6; i++)
        for (int k = 0; k < 4; k++) {
            const double *b = k % 2 ? l->b : l->a;
            double share = (k < 2 ? 1 - place[i / 3] : 1 + place[i / 3]) / 2;
            A[i][k] = share * (b[i % 3] - arris_dot(b, u) * u[i % 3]);
        }
    for (int i = 0, n = 0; i < 6; i++)
        for (int j = i; j < 6; j++, n++) {
            out->cov[n] = i / 3 == j / 3 ? fmax(along[i / 3], 0) * u[i % 3] * u[j % 3] : 0;
            for (int k = 0; k < 4; k++)
                for (int m = 0; m < 4; m++)
                    out->cov[n] += A[i][k] * cov[4 * k + m] * A[j][m];
        }
}
