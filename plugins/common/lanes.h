/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * lanes.h: eight floats at once. The compiler makes of it what the machine has; every lane is plain
 * IEEE arithmetic in the order that is written, so all machines give the same bits.
 *
 * A function that gains by it is written INLINE, and wrapped twice: once as it is, and once as an
 * AVX2_PATH, which is taken where HAS_AVX2.
 */
#ifndef LANES_H
#define LANES_H

#include <stdbool.h>
#include <stdint.h>

#define INLINE static inline __attribute__((always_inline))

#if defined(__x86_64__)
#define AVX2_PATH __attribute__((target("avx2,bmi,bmi2")))
#define HAS_AVX2 (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi2"))
#else
#define AVX2_PATH
#define HAS_AVX2 false
#endif

enum { LANES = 8 };

/* The alignment is the same for all machines that a function is compiled for. */
typedef float eight __attribute__((vector_size(32), aligned(16)));
typedef float four __attribute__((vector_size(16)));
typedef uint8_t bytes __attribute__((vector_size(16)));
/* Of a comparison: all bits of a lane where it is true. */
typedef int32_t eight_ints __attribute__((vector_size(32), aligned(16)));
typedef uint32_t eight_bits __attribute__((vector_size(32), aligned(16)));

INLINE float eight_sum(const eight *a) {
    return ((*a)[0] + (*a)[4] + ((*a)[2] + (*a)[6])) + ((*a)[1] + (*a)[5] + ((*a)[3] + (*a)[7]));
}

#define EIGHT_ABS(a) ((eight)((eight_ints)(a)&INT32_MAX))

/* a where the bits are set, elsewhere b */
#define EIGHT_CHOOSE(where, a, b)                                                                  \
    ((eight)(((eight_ints)(a) & (where)) | ((eight_ints)(b) & ~(where))))

/* The lesser and the greater of whole numbers */
#define EIGHT_LEAST(a, b) (((a) & ((a) < (b))) | ((b) & ~((a) < (b))))
#define EIGHT_MOST(a, b) (((a) & ((a) > (b))) | ((b) & ~((a) > (b))))

#endif
