/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * adjust.h: solves a problem, and says how sure the solution is. No dependency on the runtime.
 *
 * In order: adj_work_new, adj_minimise (or adj_estimate, which finds the noise as well), then
 * adj_marginals, and after it the covariances.
 */
#ifndef ADJUST_H
#define ADJUST_H

#include "problem.h"
#include "solve.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct adj_work adj_work;

/* What it takes to solve the problem, whose frames, lines, views and common states stay the same
 * from then on. NULL: no memory. */
adj_work *adj_work_new(const adj_problem *p, const adj_backend *backend);
void adj_work_free(adj_work *w); /* NULL is allowed */

/* Moves the problem to the least cost, by Levenberg and Marquardt: until a step would take off less
 * than `least` of chi-square, or `rounds` are over. Returns the steps that were taken, or
 * ARRIS_E_MEMORY, or ARRIS_E_INPUT: the problem cannot be linearised where it is. */
int adj_minimise(adj_problem *p, adj_work *w, int rounds, double least);

/* What the estimate says of itself. */
typedef struct adj_quality {
    double dof;             /* residuals minus what is estimated of them */
    double chi2;            /* of the segments by their stated variances, weighted */
    double factor;          /* its noise factor: the root of that over what is expected */
    double significance;    /* probability of so large a chi2 by chance, by the stated variances */
    double scale_sigma;     /* relative */
    double sigma[ADJ_POSE]; /* of the reported poses */
    double memory;          /* frames that count as one, since their errors hang together */
    bool determined[ADJ_POSE]; /* sigma could be told from the residuals, or was given */
    uint32_t outliers;         /* frames */
    int rounds;                /* of everything */
} adj_quality;

/* Minimises and estimates what is not known of the noise: of the poses by axis where sigma[] of the
 * problem is 0, of each line, which of its views are another edge's, and which frames' reported
 * poses are outliers (variance components: Förstner 1979; MacKay 1992). A robot's errors last for
 * some frames, so that all together tell less than their number: for adj_marginals, which this
 * calls in the end, the problem's sigma is raised by the root of `memory`. *q comes zeroed, or from
 * an earlier estimate of nearly the same, at which this begins. Returns 0 or an error of
 * adj_minimise. */
int adj_estimate(adj_problem *p, adj_work *w, adj_quality *q);

/* Prepares the covariances where the problem is. 0 or an error of adj_minimise. */
int adj_marginals(adj_problem *p, adj_work *w);

/* The covariance of a pose (6x6, of adj_pose_move's step) and of a line's x; row by row. They
 * contain that of the scan's place and scale, and the common states'. */
void adj_pose_covariance(const adj_work *w, uint32_t frame, double cov[36]);
void adj_line_covariance(const adj_work *w, uint32_t line, double cov[16]);

double adj_state_variance(const adj_work *w, int state); /* of a common one */

/* The variances of what is left of a pose's error (adj_error) by axis. */
void adj_error_variance(const adj_work *w, const adj_problem *p, uint32_t frame, double v[6]);

/* The covariance (7x7) of what no segment tells: rotation (rad) about `centre`, translation (mm)
 * and relative scale of everything, by the prior alone; row by row. `centre` is the reported
 * positions' mean. False when the prior does not tell either. */
bool adj_gauge(const adj_problem *p, double centre[3], double cov[49]);

#ifdef __cplusplus
}
#endif
#endif
