/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * gauge.c: how sure the place, the direction and the scale of everything are (adjust.h). What is
 * seen stays the same when cameras and lines are turned, moved and scaled together; so these are
 * only as good as the reported poses, and their covariance is the inverse of what the prior says
 * in these seven directions, and of the common states with them.
 */
#include <math.h>
#include <string.h>

#include "adjust.h"
#include "invert.h"

enum { GAUGE = 7, MOST = GAUGE + ADJ_COMMON };
_Static_assert((int)MOST <= (int)INVERT_MAX, "invert has room");

/* How the error of a frame moves with the gauge, and with the common states. */
static void directions(const adj_problem *p, uint32_t frame, const double centre[3],
                       double U[6][MOST]) {
    double e[6], G[6][ADJ_COMMON], d[3];
    int n = adj_n_common(p);
    memset(U, 0, 6 * sizeof *U);
    adj_error(p, frame, e, NULL, G);
    for (int i = 0; i < 3; i++)
        d[i] = p->frame[frame].reported.C[i] - centre[i];
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        U[j][i] = -d[k], U[k][i] = d[j]; /* e_i x d */
        U[3 + i][i] = 1;
        U[i][3 + i] = 1;
        U[i][6] = d[i];
    }
    for (int i = 0; i < 6; i++)
        for (int k = 0; k < n; k++)
            U[i][GAUGE + k] = -G[i][k];
}

static void add(double M[MOST][MOST], const double a[MOST], double t) {
    for (int i = 0; i < MOST; i++)
        for (int j = 0; j < MOST; j++)
            M[i][j] += t * a[i] * a[j];
}

static void sum_prior(const adj_problem *p, const double centre[3], double M[MOST][MOST]) {
    double U[6][MOST];
    for (uint32_t i = 0; i < p->n_frames; i++) {
        directions(p, i, centre, U);
        for (int k = 0; k < 6; k++)
            add(M, U[k], adj_precision(p, k, i));
    }
    for (int k = 0; k < adj_n_common(p); k++)
        M[GAUGE + k][GAUGE + k] += 1 / (p->state_sigma[k] * p->state_sigma[k]);
}

bool adj_gauge(const adj_problem *p, double centre[3], double cov[49]) {
    double M[MOST][MOST] = {{0}};
    for (int k = 0; k < 3; k++) {
        centre[k] = 0;
        for (uint32_t i = 0; i < p->n_frames; i++)
            centre[k] += p->frame[i].reported.C[k] / p->n_frames;
    }
    sum_prior(p, centre, M);
    if (!invert(&M[0][0], GAUGE + adj_n_common(p), MOST))
        return false;
    for (int i = 0; i < GAUGE; i++)
        for (int j = 0; j < GAUGE; j++)
            cov[GAUGE * i + j] = M[i][j];
    return true;
}
