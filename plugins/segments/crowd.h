/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * crowd.h: where a picture's edge points are, a bit a pixel, by rows and by columns: tells how near
 * the neighbours of a line are. The clear ones are there once more: to a line that is much stronger
 * the faint ones do not matter.
 */
#ifndef CROWD_H
#define CROWD_H

#include <stdbool.h>
#include <string.h>

#include "arris_geometry.h"
#include "lanes.h"

enum { CROWD_REACH = 12 }; /* px */

typedef struct crowd {
    size_t stride[2];  /* words of a row, of a column */
    uint64_t *bits[2]; /* of clear points, by rows and by columns; those of all points are */
    size_t to_all;     /* words behind */
    float clear;       /* the least gradient that is, levels per px */
} crowd;

/* 0 or ARRIS_E_MEMORY; crowd_free in either case. */
int crowd_init(crowd *c, int width, int height);
void crowd_free(crowd *c);

/* Holds these points and no others. The picture's size is at most that of crowd_init; points
 * outside of it are ignored. The lens of `camera` maps ideal points to the picture; NULL: none. */
void crowd_fill(crowd *c, const arris_edges *e, int width, int height, const arris_camera *camera);

enum { CROWD_FIRST = 64 - CROWD_REACH };

/* The bytes of all rows (of all columns when `columns`), one after another, of all points or the
 * clear ones only; *stride: how many a row takes. The points around pixel `at`, those CROWD_REACH
 * px to either side, are the bits from at + CROWD_FIRST on. Little-endian, as all our targets are.
 */
INLINE const uint8_t *crowd_view(const crowd *c, bool columns, bool clear_only, size_t *stride) {
    *stride = c->stride[columns] * sizeof(uint64_t);
    return (const uint8_t *)(c->bits[columns] + (clear_only ? 0 : c->to_all));
}

/* Of eight pixels, the distance in px to the nearest of the points around them that is more than
 * `own` px away, own < CROWD_REACH; CROWD_REACH + 1 when there is none. */
INLINE void crowd_nearest(const eight_ints *around, int own, eight_ints *distance) {
    /* bit CROWD_REACH is the pixel's; another beyond the reach stands for none */
    eight_ints clear = *around & ~(((2 << 2 * own) - 1) << (CROWD_REACH - own));
    eight_ints before = clear & ((1 << CROWD_REACH) - 1);
    eight_ints after = clear >> (CROWD_REACH + 1) | 1 << CROWD_REACH;
    after &= -after;
    /* a float's exponent is the place of the highest bit */
    eight_ints left = (eight_ints) __builtin_convertvector(before, eight) >> 23;
    eight_ints right = (eight_ints) __builtin_convertvector(after, eight) >> 23;
    left = CROWD_REACH + 127 - left, right -= 126;
    *distance = EIGHT_LEAST(left, right);
}

#endif
