/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * tell.h: from an adjusted line to what is told of it.
 */
#ifndef ADJUST_TELL_H
#define ADJUST_TELL_H

#include "problem.h"

/* Moves the ends p and q of `out` square onto the line, and sets their covariance: across the line
 * that of l->x (4x4), along it what it was. */
void tell_line(const adj_line *l, const double cov[16], arris_line *out);

#endif
