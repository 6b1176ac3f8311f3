/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * work.h: what it takes to solve a problem (adjust.h), between the files that do.
 */
#ifndef ADJUST_WORK_H
#define ADJUST_WORK_H

#include "adjust.h"
#include "system.h"

struct adj_work {
    const adj_backend *backend;
    adj_solver *solver;
    adj_system system;
    adj_factor factor;
    bool factored;                         /* `factor` is good for what is near to it */
    bool planned;                          /* for what the problem is made of */
    double *step;                          /* a number for each row */
    double *scratch;                       /* ADJ_CONJUGATE for each */
    int *place;                            /* likewise */
    adj_pose *poses;                       /* as they were before a step */
    double (*lines)[4], state[ADJ_COMMON]; /* likewise */
    double *inverse;                       /* in the places of the factor's values */
    size_t max_inverse;
};

/* Factors what was filled last. 0, or an error of the back end's. */
int adj_work_factor(adj_work *w);

/* For the problem's pattern, unless it is planned. 0 or ARRIS_E_MEMORY. */
int adj_work_plan(adj_work *w, const adj_problem *p);

/* Moves each line to where most of its views agree with it, by poses as they are, and sets the
 * others of them apart; `variance` is of views that agree, over the stated one. */
void adj_agree(adj_problem *p, const adj_system *s, double variance);

#endif
