/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * lanes.h: four or eight floats at once. The compiler makes of it what the machine has; every lane
 * is plain IEEE arithmetic in the order that is written, so all machines give the same bits.
 */
#ifndef LANES_H
#define LANES_H

#include <stdint.h>

#define INLINE static inline __attribute__((always_inline))

/* The alignment is the same for all machines that a function is compiled for. */
typedef float eight __attribute__((vector_size(32), aligned(16)));
typedef float four __attribute__((vector_size(16)));
typedef uint8_t bytes __attribute__((vector_size(16)));
typedef int32_t eight_ints __attribute__((vector_size(32), aligned(16)));
/* All bits of a lane where it is true. */
typedef int32_t four_bits __attribute__((vector_size(16)));

INLINE float four_sum(four a) {
    return (a[0] + a[2]) + (a[1] + a[3]);
}

INLINE float eight_sum(const eight *a) {
    return ((*a)[0] + (*a)[4] + ((*a)[2] + (*a)[6])) + ((*a)[1] + (*a)[5] + ((*a)[3] + (*a)[7]));
}

INLINE four four_abs(four a) {
    return (four)((four_bits)a & INT32_MAX);
}

/* a where the bits are set, elsewhere b */
INLINE four four_choose(four_bits where, four a, four b) {
    return (four)(((four_bits)a & where) | ((four_bits)b & ~where));
}

#endif
