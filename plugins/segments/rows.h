/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * rows.h: the grey levels across a line, as the picture has them.
 *
 * A line that is steep in the picture is cut by the picture's rows, another by its columns; both
 * are called rows here. Every pixel near the line belongs to one row, none is interpolated, so
 * noise stays white. The line may be in ideal coordinates while the picture is the lens's: then it
 * is bent there, and each row knows where it crosses and by how much an offset grows.
 */
#ifndef ROWS_H
#define ROWS_H

#include "crowd.h"
#include "lens.h"
#include "step.h"

/* fmin and fmax of numbers, without a call. */
INLINE double lesser(double a, double b) {
    return a < b ? a : b;
}

INLINE double greater(double a, double b) {
    return a > b ? a : b;
}

/* A line from (x, y) along the unit vector (dx, dy), over [0, length] px. */
typedef struct row_line {
    double x, y, dx, dy, length;
} row_line;

/* Where a row is in the picture. */
typedef struct row_place {
    int16_t line;   /* its number */
    int16_t at;     /* the first pixel behind the line */
    uint8_t half;   /* px to either side that are free of other edges */
    uint8_t filter; /* of those of a scale */
    uint16_t none;
} row_place;

/* The pixels of a row less the base, STEP_HALF to either side. */
typedef int16_t sixteen __attribute__((vector_size(32), aligned(16)));

/* Sums over the rows; those of lanes are weighted by the filters' responses. */
typedef struct row_sums {
    eight answer, answer_t;            /* answers, and times t */
    eight weight, weight_t, weight_tt; /* responses, and times t, t² */
    eight squares;                     /* of the pixels, spread over the lanes */
    eight explained;                   /* of the answers */
    four total;                        /* of the filters' parts: STEP_SUM and so on */
} row_sums;

typedef struct rows {
    const step_table *steps;
    const crowd *crowd;
    int moved[2]; /* px in x and y that the line has moved since it was filled */
    const arris_image *image;
    bool bent; /* by the lens: the line's coordinates are ideal */
    lens lens;
    bool clear_only; /* faint points are no neighbours */
    bool portable;   /* without what only some machines have; the same bits */
    uint32_t n, max;
    float pull;    /* sum of the px by which other edges may move the step */
    uint32_t room; /* sum of the half-widths, px */
    bool columns;  /* the rows are columns of the picture */
    float slant;   /* px of a row that the step covers per px across it */
    bool whole;    /* the line's ends are the edge's own */
    int clear;     /* px of a row that are kept from another edge */
    float end;     /* px along the line that are kept from its end */
    row_sums sum;
    row_place *place; /* of each row */
    sixteen *pixels;  /* likewise, in units of `unit` levels */
    float unit;
    /* likewise, in eights; the last is not filled up */
    eight *t;      /* place along the line from its middle, px */
    eight *across; /* px across the line, to its right, per px of the row */
    eight *shift;  /* px of the row from the place that the filter assumes to the line */
    /* of each row */
    eight *answers; /* of the filters, grey levels */
    eight *offset;  /* of the filter of the offset (step.h) */
} rows;

/* Reserves rows for pictures of up to this size. 0 or ARRIS_E_MEMORY; rows_free in either case. */
int rows_init(rows *r, int width, int height);
void rows_free(rows *r);

/* Finds the rows of a line. Those nearer than `trim` px to an end are left out, and those where
 * another edge, the border or the line's end leaves less than STEP_MIN px to either side. `blur` is
 * the step's as far as it is known, px. */
void rows_trace(rows *r, const row_line *l, double trim, float blur);

#define ROWS_CLEAR 2.5f /* a neighbour's step is over at this many of its blurs */

/* What `clear` would be for a step of this blur, px. */
INLINE int rows_clear(const rows *r, float blur) {
    return (int)(ROWS_CLEAR * blur * r->slant + 0.5f);
}

enum { ROWS_PROBED = 6 };

/* The mean grey levels of a few of the rows: `reach` px before the line or as far as the row goes,
 * at the two pixels before and the two behind it, and as far behind it. There must be rows. */
void rows_probe(const rows *r, int reach, double mean[ROWS_PROBED]);

/* Fetches the rows' pixels. There must be rows. `base` is a grey level near those of the step,
 * taken off, and 2^shift levels are the unit: what is further off than STEP_MOST of them is cut. */
void rows_fetch(rows *r, int base, int shift);

/* Measures the rows that were fetched by the filters of a scale. */
void rows_measure(rows *r, int scale);

#endif
