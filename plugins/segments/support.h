/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * support.h: where along a foreseen line its step is in the picture: seen, hidden, or longer than
 * was known. The grey levels across it are looked at in every row of the picture (column, where the
 * line is flat), near where it is foreseen and nowhere else.
 */
#ifndef SUPPORT_H
#define SUPPORT_H

#include "arris_geometry.h"
#include "refit.h"

/* What the picture has at the line in one row. */
typedef struct support_row {
    float u, t; /* where the line crosses it: px in the row, px along the line */
    float step; /* from left to right, grey levels; 0 outside of the picture */
    float off;  /* step times the px by which it is farther in the row */
    float core; /* the part of the step within 1.5 px */
} support_row;

typedef struct support {
    const arris_image *image;
    const arris_camera *lens; /* NULL: the line's coordinates are the picture's */
    bool columns;             /* the rows are columns of the picture */
    int first, end;           /* rows looked at */
    int from, to;             /* those that support the line, to - 1 the last */
    support_row *row;         /* of all in the picture */
} support;

/* For pictures of up to this size. 0 or ARRIS_E_MEMORY; support_free in either case. */
int support_init(support *s, int width, int height);
void support_free(support *s);

/* Finds the longest stretch with a step of at least `step` grey levels that is brighter on the
 * line's right, some px at most from where it is foreseen, and beyond the foreseen ends as far as
 * it goes on. False when it is shorter than `length` px. Else *start is the line as it is seen
 * there, but for its noise. */
bool support_find(support *s, const arris_foreseen *line, double step, double length,
                  refit_start *start);

#endif
