/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * align.h: lays the nominal edges on the measured lines, as a rigid body. No dependency on the
 * runtime.
 *
 * Weighted least squares of the deviations across the edges by Gauss-Newton. How well the edges fit
 * each other is estimated with it; edges that fit much worse than that weigh little (Geman and
 * McClure 1987), which sets in step by step. A motion that the lines say nothing of is not made,
 * and its variance is that of the search. What follows for an edge from the noise of the lines is
 * propagated with the edge's own part in the alignment (JCGM 100, 5.2).
 */
#ifndef ALIGN_H
#define ALIGN_H

#include "match.h"

/* The place in which the nominal was drawn: no motion, no variance. */
void place_identity(place *w, const nominal *m);

/* Moves `where` so that the edges for which use[i] is true (NULL: all) lie on their lines. The
 * pieces are matched to the lines anew and stay so. Returns how many edges took part; 0: `where` is
 * as it was. */
uint32_t align(place *where, const nominal *m, piece *e, const bool *use, const arris_lines *lines,
               double search, candidates *c, int32_t *owner);

/* Adds to the covariance of an edge's deviation what the alignment does to it. */
void align_spread(const place *where, piece *e);

#endif
