/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * info.h: what views say of the four parameters of a line: chi-square(x) = c - 2 g x + x H x. Such
 * sums add. No dependency on the runtime.
 */
#ifndef INFO_H
#define INFO_H

#include "view.h"

typedef struct info {
    mat4 H;
    double g[4], c;
    double squares; /* of the distances at the segments' ends, px² */
    double misfit;  /* the sum of the views' shares */
    double weight;  /* of the views; their number unless weighed */
    uint32_t n;     /* views */
} info;

/* Adds a view that was linearised about x: J (x' - x) + r = 0, weighted by its covariance. */
void info_add(info *in, const linear *l, const double x[4]);

/* The same of those that are taken of several views. */
void info_add_views(info *in, const linears *l, const bool take[VIEWS], const double x[4]);

/* Moves the segments of its views `px` to their right; they are as the one view, linear about x. */
void info_move(info *in, const linear *l, const double x[4], double px);

/* Adds b to a. */
void info_sum(info *a, const info *b);

/* As if every view stood for `weight` views. */
void info_weigh(info *in, double weight);

/* Half the slope of chi-square at x: g - H x. */
void info_slope(const info *in, const double x[4], double slope[4]);

/* chi-square at x. */
double info_chi2(const info *in, const double x[4]);

#endif
