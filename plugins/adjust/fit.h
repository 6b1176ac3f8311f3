/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * fit.h: how well its views fit a line, and what that says of their noise.
 */
#ifndef ADJUST_FIT_H
#define ADJUST_FIT_H

#include "problem.h"

/* What a line's views sum up to, each by its weight. */
typedef struct adj_fit {
    double chi2, views;     /* by the stated variance, expected to be two each; their number */
    double agree;           /* of them, that are no outliers */
    double product, square; /* of offsets in successive views, px² */
    double before;          /* the last offset, px */
    double squares;         /* of the distances at the ends, px², */
    double weights;         /* and of how many */
    double misfit;          /* the shares of the variance that no profile explained: the caller's */
} adj_fit;

/* What weighted squared distances are on average over 2, for Gaussian noise. */
double adj_expected_share(const adj_problem *p);

/* Adds a view whose residuals by the line are r; `expected` is adj_expected_share. */
void adj_fit_add(adj_fit *f, const adj_problem *p, const adj_view *v, const double r[2],
                 double expected);

/* The sums of all lines' views, but for those apart; `fits` has a place for each line. */
void adj_fits(const adj_problem *p, adj_fit *fits);

/* Of the distances at the ends, px. */
double adj_fit_rms(const adj_fit *f);

/* Successive views that count as one, since they err alike. */
double adj_fit_memory(const adj_fit *f);

/* What is usual of n lines' views: their variance over the stated one; `share` of a residual is
 * what the poses leave of it. */
double adj_usual_variance(const adj_fit *f, uint32_t n, double share);

/* The same of one line, for which the usual one counts as some residuals. */
double adj_fit_variance(const adj_fit *f, double share, double usual);

#endif
