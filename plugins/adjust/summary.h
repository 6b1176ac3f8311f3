/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * summary.h: what an adjustment found, in words.
 */
#ifndef ADJUST_SUMMARY_H
#define ADJUST_SUMMARY_H

#include <stdio.h>

#include "record.h"

/* Root mean squares of what poses are off from other ones. */
typedef struct pose_errors {
    double position, rotation; /* mm, rad */
    double shape;              /* mm: when scale and rigid motion are taken out */
} pose_errors;

/* Of n poses against the true ones. */
pose_errors summary_compare(const adj_pose *a, const adj_pose *truth, uint32_t n);

/* A scan that was adjusted. */
typedef struct summary {
    const record *record;
    const arris_lines *before, *after;
    const adjusted *result;
    const char *solver;
    bool compared; /* with true poses: */
    pose_errors reported, adjusted;
} summary;

void summary_print(FILE *out, const summary *s);
void summary_json(FILE *out, const summary *s);

/* The numbers of the frames that are outliers, "3, 17, 40", cut with "..." when there are more
 * than fit; "none". */
void summary_outliers(const record *r, char *text, size_t n);

#endif
