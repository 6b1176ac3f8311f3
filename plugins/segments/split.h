/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * split.h: chains to straight pieces.
 */
#ifndef SPLIT_H
#define SPLIT_H

#include "arris_types.h"

/* Splits the n >= 2 points of a chain where they deviate by more than `tol` px from the infinite
 * chord (Kovesi's lineseg and maxlinedev). Writes the indices of the pieces' ends to `corner`,
 * which has room for n, from 0 to n - 1 in rising order, and returns how many. `greedy` as in
 * Kovesi's: after every piece it looks again from there to the chain's end, which takes up to O(n)
 * for each piece. Otherwise what was split once stays split. */
uint32_t split_chain(const arris_edge_point *p, uint32_t n, double tol, bool greedy,
                     uint32_t *corner);

#endif
