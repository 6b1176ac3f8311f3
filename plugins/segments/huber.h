/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * huber.h: the straight line through offsets along an axis, by Huber's M-estimate.
 */
#ifndef HUBER_H
#define HUBER_H

#include "lanes.h"

/* n measured offsets, in eights; those that fill up the last eight have weight 0. */
typedef struct huber_data {
    uint32_t n;
    const eight *t;      /* the places where they were measured */
    const eight *offset; /* what was measured */
    const eight *weight; /* 1 / sigma */
    bool portable;       /* without what only some machines have; the same bits */
} huber_data;

typedef struct huber_line {
    double offset, slope; /* offset + slope t */
    double normal[3]; /* sums of weight², weight² t, weight² t²: the inverse of the covariance */
    double misfit;    /* sum of the squared residuals in sigma, outliers counted by their limit */
    double spread;    /* variance of the offsets over what the weights claim */
} huber_line;

/* n >= 3. */
void huber_fit(const huber_data *d, huber_line *l);

/* The same variance as `spread`, from the means of neighbouring offsets: more than that where these
 * go together. 1 where there are too few to tell, or chance explains it. */
double huber_waves(const huber_data *d, const huber_line *l);

/* A variance in units of what is claimed: 1 unless it is above that by `sigma` of its own. */
double huber_beyond_chance(double variance, double dof, double sigma);

#endif
