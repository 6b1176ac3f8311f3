/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * judge.h: from deviations to verdicts. No dependency on the runtime.
 */
#ifndef JUDGE_H
#define JUDGE_H

#include "match.h"

/* ISO 14253-1: PASS when |deviation| + U <= tolerance, FAIL when |deviation| - U > tolerance,
 * INDETERMINATE otherwise and when a number isn't finite. */
enum arris_judgement judge(double deviation, double U, double tolerance);

/* Of two verdicts that one part has to hold: a FAIL, else an INDETERMINATE, else a PASS. */
enum arris_judgement judge_both(enum arris_judgement a, enum arris_judgement b);

/* Fills deviation, U, worst, worst_U, at and the verdict from a piece that has a line; k is the
 * coverage factor. The mean and the worst point must both hold. */
void judge_piece(const piece *e, double k, double tolerance, arris_feature *f);

/* The length of a vector (x, y) across an edge of the covariance c00, c01, c11. Its expanded
 * uncertainty U is k u along the vector, and what k u square to it would add to the length. */
double length_across(double x, double y, double c00, double c01, double c11, double k, double *U);

#endif
