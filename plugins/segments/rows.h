/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * rows.h: the grey levels across a line, as the picture has them.
 *
 * A line that is steep in the picture is cut by the picture's rows, another by its columns; both are
 * called rows here. Every pixel near the line belongs to one row, none is interpolated, so noise
 * stays white. The line may be in ideal coordinates while the picture is the lens's: then it is bent
 * there, and each row knows where it crosses and by how much an offset grows.
 */
#ifndef ROWS_H
#define ROWS_H

#include "crowd.h"
#include "step.h"

/* A line from (x, y) along the unit vector (dx, dy), over [0, length] px. */
typedef struct row_line {
    double x, y, dx, dy, length;
} row_line;

/* One row: how far the step stands behind where the filter assumes it, px of the row, when it is on
 * the line. */
typedef struct row {
    eight answer; /* of the filters, grey levels; that of the mean is relative to `base` */
    const step_filter *filter;
    float t;      /* place along the line from its middle, px */
    float across; /* px across the line, to its right, per px of the row */
    float shift;  /* px of the row from the place that the filter assumes to the line */
} row;

/* Sums over the rows; those of lanes are weighted by the filters' responses. */
typedef struct row_sums {
    eight answer, answer_t;    /* answers, and times t */
    eight weight, weight_t, weight_tt; /* responses, and times t, t² */
    float step, tilt;          /* Phi over all pixels; what slopes add to the contrast's answers */
    four squares;              /* of the pixels, spread over the lanes */
    eight explained;           /* of the answers */
    float dof;                 /* pixels less filters */
    uint32_t wide;             /* rows that can tell slopes */
} row_sums;

typedef struct rows {
    const step_table *steps;
    const crowd *crowd;
    const arris_image *image;
    const arris_camera *lens; /* NULL: the line's coordinates are the picture's */
    bool portable;            /* without what only some machines have; the same bits */
    uint32_t n, max;
    row *item;
    row_sums sum;
    bool columns; /* the rows are columns of the picture */
    float slant;  /* px of a row that the step covers per px across it */
    float base;
} rows;

/* Reserves rows for pictures of up to this size. 0 or ARRIS_E_MEMORY; rows_free in either case. */
int rows_init(rows *r, int width, int height);
void rows_free(rows *r);

/* Measures the rows of a line by the filters for a blur of `blur` px. Those nearer than `trim` px to
 * an end are left out, and those where another edge, the border or the line's end leaves less than
 * STEP_MIN px to either side. `base` is a level that is taken off first. */
void rows_measure(rows *r, const row_line *l, double trim, float blur, float base);

/* The mean grey levels `d` px to the left and to the right of the line, from a few places. */
void rows_probe(rows *r, const row_line *l, double d, double *left, double *right);

#endif
