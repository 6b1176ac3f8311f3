/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * step.h: linear filters that measure a blurred step, lo + (hi - lo) Phi(d / s), in one row of
 * pixels across it.
 *
 * The row's model is linearised at the place where the step is thought to be, and its parts are
 * made orthonormal in this order: the mean level, the step, its offset, its blur, a slope that
 * differs between the two sides, a slope common to both. So each filter's answer has the variance
 * of one pixel's noise and is independent of the others', and both levels are free in every row.
 * Two more ask what is left of all that on either side: a second step BESIDE px away.
 */
#ifndef STEP_H
#define STEP_H

#include <string.h>

#include "lanes.h"

enum {
    STEP_HALF = 8,              /* the widest half-width, px */
    STEP_MIN = 2,               /* the narrowest */
    STEP_WIDTH = 2 * STEP_HALF, /* px */
    STEP_PHASES = 8,            /* places of the step between two pixels */
    STEP_SCALES = 30            /* blurs, eight to an octave, from 0.44 to 5.8 px */
};

enum {
    STEP_MEAN,
    STEP_CONTRAST,
    STEP_OFFSET,
    STEP_BLUR,
    STEP_KINK,
    STEP_SLOPE,
    STEP_BEFORE,
    STEP_BEHIND,
    STEP_FILTERS,
    STEP_PARTS = STEP_BEFORE
};

#define STEP_UNIT 32768 /* of the weights; answers to pixels within +-STEP_MOST stay below 2^31 */
#define STEP_MOST 8191

/* Phi over the row, pixels less filters, and what the common slope adds to the sums of contrast and
 * blur, per its own answer. */
enum { STEP_SUM, STEP_DOF, STEP_TILT, STEP_FLARE };

/* Its response; by how much that grows, relatively, as blur does by a factor of e; what slopes add
 * to the answer, per their own answers and per level per px; how much sigma grows, relatively, when
 * that is taken out. */
enum {
    STEP_RESPONSE,
    STEP_GAIN,
    STEP_PER_KINK,
    STEP_PER_SLOPE,
    STEP_BY_KINK,
    STEP_BY_SLOPE,
    STEP_UNSURE
};

/* For one blur, half-width and phase. Pixel j is j - STEP_HALF + (phase + 0.5) / STEP_PHASES px
 * from the step; those outside of the half-width have weight 0. */
typedef struct step_filter {
    int16_t w[STEP_WIDTH / 2][8][2]; /* of each pair of pixels in each filter */
    int16_t inside[STEP_WIDTH];      /* -1 for pixels within the half-width, 0 else */
    /* What the filters answer to one level, one level of contrast, per level of contrast one px
     * towards the dark and blur that grows by a factor of e, and slopes of one level per px. */
    eight response;
    /* Of the offset's, by STEP_RESPONSE and so on. */
    eight offset;
    /* What the row adds to sums, by STEP_SUM and so on. */
    four part;
} step_filter;

typedef struct step_table {
    step_filter f[STEP_SCALES][STEP_HALF + 1 - STEP_MIN][STEP_PHASES];
} step_table;

void step_init(step_table *t);

/* A float's bits from the exponent to the third of the mantissa count eighths of octaves. */
enum { STEP_EIGHTH = 1 << 20, STEP_FIRST = 0x3EE00000 /* 0.4375 */ };

/* The scale whose filters suit a blur (px), and the blur that they are for. */
INLINE int step_scale(float blur) {
    int32_t bits;
    memcpy(&bits, &blur, sizeof bits);
    int k = (bits - STEP_FIRST) / STEP_EIGHTH;
    return k < 0 ? 0 : k < STEP_SCALES ? k : STEP_SCALES - 1;
}

INLINE float step_blur(int scale) {
    int32_t bits = STEP_FIRST + scale * STEP_EIGHTH + STEP_EIGHTH / 2;
    float blur;
    memcpy(&blur, &bits, sizeof blur);
    return blur;
}

#endif
