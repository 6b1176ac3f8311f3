/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * crowd.h: where a picture's edge points are, a bit a pixel, by rows and by columns: tells how near
 * the neighbours of a line are.
 */
#ifndef CROWD_H
#define CROWD_H

#include <stdbool.h>

#include "arris_geometry.h"
#include "lanes.h"

enum { CROWD_REACH = 12 }; /* px */

typedef struct crowd {
    size_t stride[2]; /* words of a row, of a column */
    uint64_t *bits[2];
} crowd;

/* 0 or ARRIS_E_MEMORY; crowd_free in either case. */
int crowd_init(crowd *c, int width, int height);
void crowd_free(crowd *c);

/* Holds these points and no others. The picture's size is at most that of crowd_init; points
 * outside of it are ignored. `lens` maps ideal points to the picture, or is NULL. */
void crowd_fill(crowd *c, const arris_edges *e, int width, int height, const arris_camera *lens);

/* Adds a point of the picture. */
void crowd_add(crowd *c, float x, float y);

/* The distance in px from pixel `at` of row `line` (of a column when `column`) to the nearest point
 * in it that is more than `own` px away, own < CROWD_REACH; CROWD_REACH + 1 when there is none. The
 * pixel must be in the picture. */
INLINE int crowd_nearest(const crowd *c, bool column, int line, int at, int own) {
    unsigned bit = (unsigned)at + 64 - CROWD_REACH, side = (unsigned)(CROWD_REACH - own);
    const uint64_t *w = c->bits[column] + (size_t)line * c->stride[column] + bit / 64;
    uint64_t bits = w[0] >> bit % 64 | w[1] << 1 << (63 - bit % 64);
    /* the one nearest to the pixel is bit `side` before it and bit 0 after it; another bit beyond
     * the reach stands for none */
    uint32_t before = (uint32_t)bits << 1 & ((2u << side) - 1);
    uint32_t after = (uint32_t)(bits >> (CROWD_REACH + 1 + own));
    int left = __builtin_clz(before | 1) - (31 - (int)side);
    int right = __builtin_ctz(after | 1u << side);
    return own + 1 + (left < right ? left : right);
}

#endif
