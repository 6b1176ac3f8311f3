/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * gradient.h: one pass over the picture: smoothing, gradients, non-maximum suppression.
 */
#ifndef GRADIENT_H
#define GRADIENT_H

#include "arris_types.h"
#include "path.h"

enum {
    GRADIENT_MAX_RADIUS = 12,
    GRADIENT_BITS = 14,
    EDGELS_BATCH = 16, /* written at once */
    EDGELS_AFTER = 2,  /* entries after those of the rows: the end of the last, and of one more */
    EDGELS_ROW = 8192 + EDGELS_BATCH
};

/* Where a point was found: the column of its pixel, and the octant of its gradient, 4 times whether
 * |gx| >= |gy|, 2 times gx < 0, gy < 0. */
typedef struct edgel {
    uint16_t x, octant;
} edgel;

/* Pixels whose gradient is a maximum along its main axis, row by row, from left to right. The
 * arrays have room for EDGELS_BATCH more than `max`. */
typedef struct edgels {
    uint32_t n, max, lost;
    edgel *item;
    arris_edge_point *point; /* of each */
    uint32_t *row; /* row y has items row[y] .. row[y + 1] - 1; height + EDGELS_AFTER entries */
} edgels;

/* Edgels of the row that is being worked on, field by field: the column, the gradient, and its size
 * here and one pixel to either side along the main axis, in some unit; the lowest bit of ROW_HERE
 * says that this is x. */
enum {
    ROW_X,
    ROW_GX = EDGELS_ROW,
    ROW_GY = 2 * EDGELS_ROW,
    ROW_BEFORE = 3 * EDGELS_ROW,
    ROW_HERE = 4 * EDGELS_ROW,
    ROW_AFTER = 5 * EDGELS_ROW,
    ROW_END = 6 * EDGELS_ROW
};
typedef struct edgel_row {
    int32_t n;
    int16_t field[ROW_END];
} edgel_row;

typedef struct gradient {
    int radius;                            /* of the Gaussian, px; at least 2 */
    uint16_t tap[GRADIENT_MAX_RADIUS + 1]; /* from the middle outwards, 2^-16 */
    /* Rows that the pass keeps, the newest last: grey levels, smoothed ones, magnitudes. */
    int16_t *in[2 * GRADIENT_MAX_RADIUS + 1], *s[4], *m[3];
    int16_t *vertical;                                  /* a row smoothed in y only */
    const int16_t *column[2 * GRADIENT_MAX_RADIUS + 1]; /* the same from its i-th pixel on */
    uint64_t marked[EDGELS_ROW / 64]; /* the pixels of a row that may be edgels, by bits */
    uint32_t eights[EDGELS_ROW / 8];
    edgel_row found;
    /* For each set of eight pixels: where in them the bytes are of those that are in it. */
    uint8_t squeeze[256][16];
    void *memory;
} gradient;

/* Taps for `sigma` and row buffers for pictures up to `width`. 0 or ARRIS_E_MEMORY. */
int gradient_init(gradient *g, int width, double sigma);
void gradient_free(gradient *g);

/* Bits by which grey levels are shifted to the left (right when negative) to fill 14 bits. */
int gradient_shift(const arris_image *im);

/* Grey levels per px of one unit of gx and gy. */
float gradient_unit(int shift);

/* Standard deviation of gx and of gy, grey levels per px, from noise of one level per pixel. */
double gradient_noise(const gradient *g);

/* All pixels of `im` whose gradient is at least `low` units and a maximum across the edge. (dx, dy)
 * is added to every point. */
void gradient_edgels(gradient *g, const arris_image *im, int shift, float low, float dx, float dy,
                     edgels *e, enum path path);

#endif
