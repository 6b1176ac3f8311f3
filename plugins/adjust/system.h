/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * system.h: the normal equations of a problem: blocks of 4x4 for each line, of 6x6 for each frame,
 * of 4x6 where a frame sees a line, and the common states' border.
 *
 * Lines come first, then frames. Solved in this order the lines are eliminated, each on its own,
 * and what is left is in the poses, a band as wide as lines stay in the picture. Where fewer lines
 * than that are seen at a time it is cheaper to go by S.order, frame after frame, each line as soon
 * as no more frame sees it; which of the two, the solver finds out (solve.h).
 */
#ifndef ADJUST_SYSTEM_H
#define ADJUST_SYSTEM_H

#include "problem.h"
#include "solve.h"

typedef struct adj_system {
    adj_matrix S;
    double *rhs;
    int poses, common;       /* the first rows of the frames and of the common states */
    int border;              /* and that of the common states' columns: the lens bears on lines */
    uint32_t *order, *first; /* the views by line: those of line l at first[l] .. */
    int *slot;               /* by view: where its line's rows begin in its frame's columns */
    int *own, *last;         /* by frame: likewise its own rows; scratch */
    size_t max_rows, max_entries;
    double predicted; /* what the last step should take off the cost */
} adj_system;

/* A view, linear: weighted rows, so that its part of the cost is |r + J d|². */
typedef struct adj_rows {
    double r[2], Jp[2][6], Jl[2][4], Jc[2][ADJ_LENS_TERMS];
} adj_rows;

/* False when the line is not in front of the camera. */
bool adj_linearise(const adj_problem *p, const adj_view *v, adj_rows *o);

/* Room for any problem that `p` has room for, but for its matrix. 0 or ARRIS_E_MEMORY. For
 * adj_system_free in any case. */
int adj_system_init(adj_system *s, const adj_problem *p);
void adj_system_free(adj_system *s);

/* The pattern: again when views, frames or common states were added. 0 or
 * ARRIS_E_MEMORY. */
int adj_system_plan(adj_system *s, const adj_problem *p);

/* Linearises where the problem is. The diagonals are raised by the share `damping` (Marquardt).
 * False when a line is behind a camera that sees it. */
bool adj_system_fill(adj_system *s, const adj_problem *p, double damping);

/* Moves the problem by the step `d`, which solves what was filled last. */
void adj_system_move(adj_system *s, adj_problem *p, const double *d);

#endif
