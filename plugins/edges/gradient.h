/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * gradient.h: one pass over the picture: smoothing, gradients, non-maximum suppression.
 */
#ifndef GRADIENT_H
#define GRADIENT_H

#include "arris_types.h"
#include "path.h"

enum { GRADIENT_MAX_RADIUS = 12, GRADIENT_BITS = 14 };

/* A pixel whose gradient is a maximum along its main axis. Gradients are in units: see
 * gradient_unit. */
typedef struct edgel {
    int16_t x, y, gx, gy;
    int16_t across;              /* 1: the main axis is x, |gx| >= |gy|; else 0 */
    int16_t before, here, after; /* the gradient's size here and one pixel to either side along the
                                    main axis, in some unit */
} edgel;

/* Row by row, from left to right. */
typedef struct edgels {
    uint32_t n, max, lost;
    edgel *item;
    uint32_t *row; /* row y has items row[y] .. row[y + 1] - 1; height + 1 entries */
} edgels;

typedef struct gradient {
    int radius;                            /* of the Gaussian, px; at least 2 */
    uint16_t tap[GRADIENT_MAX_RADIUS + 1]; /* from the middle outwards, 2^-16 */
    /* Rows that the pass keeps, the newest last: grey levels, smoothed ones, magnitudes. */
    int16_t *in[2 * GRADIENT_MAX_RADIUS + 1], *s[4], *m[3];
    int16_t *vertical;                                  /* a row smoothed in y only */
    const int16_t *column[2 * GRADIENT_MAX_RADIUS + 1]; /* the same from its i-th pixel on */
    uint8_t *mask;
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

/* All pixels of `im` whose gradient is at least `low` units and a maximum across the edge. */
void gradient_edgels(gradient *g, const arris_image *im, int shift, float low, edgels *e,
                     enum path path);

#endif
