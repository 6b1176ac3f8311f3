/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * lane.h: four views at once, as lanes.h has eight floats. No dependency on the runtime.
 */
#ifndef LANE_H
#define LANE_H

#include <string.h>

#include "lanes.h"
#include "view.h"

/* A value for each view, and its bits. */
typedef double lane __attribute__((vector_size(32), aligned(8), may_alias));
typedef int64_t lane_bits __attribute__((vector_size(32), aligned(8), may_alias));

_Static_assert(VIEWS == 4, "a lane has a value for each view");

/* Four successive numbers of each view, from those that lie `offset` bytes into it. */
INLINE void lane_load(const view *const v[VIEWS], size_t offset, lane to[4]) {
    lane a[4], b[4];
    for (int k = 0; k < VIEWS; k++)
        memcpy(&a[k], (const char *)v[k] + offset, sizeof a[k]);
    for (int k = 0; k < VIEWS; k += 2) {
        b[k] = __builtin_shufflevector(a[k], a[k + 1], 0, 4, 2, 6);
        b[k + 1] = __builtin_shufflevector(a[k], a[k + 1], 1, 5, 3, 7);
    }
    for (int k = 0; k < 2; k++) {
        to[k] = __builtin_shufflevector(b[k], b[k + 2], 0, 1, 4, 5);
        to[k + 2] = __builtin_shufflevector(b[k], b[k + 2], 2, 3, 6, 7);
    }
}

/* Of fixed vectors and of those of each view. */
#define DOT(a, b) ((a)[0] * (b)[0] + (a)[1] * (b)[1] + (a)[2] * (b)[2])

INLINE void cross_fixed(const double a[3], const lane b[3], lane c[3]) {
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

INLINE void cross(const lane a[3], const lane b[3], lane c[3]) {
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

#endif
