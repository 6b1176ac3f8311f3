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

/* Eight floats from anywhere, read at once: what is copied in parts cannot be, for a while. */
INLINE void eight_load(const void *from, eight *to) {
    typedef float unaligned __attribute__((vector_size(32), aligned(4), may_alias));
    *to = *(const unaligned *)from;
}

INLINE float eight_sum(const eight *a) {
    return ((*a)[0] + (*a)[4] + ((*a)[2] + (*a)[6])) + ((*a)[1] + (*a)[5] + ((*a)[3] + (*a)[7]));
}

/* The two halves' sum. */
INLINE four eight_halves(const eight *a) {
    return __builtin_shufflevector(*a, *a, 0, 1, 2, 3) +
           __builtin_shufflevector(*a, *a, 4, 5, 6, 7);
}

/* eight_sum of four at once. */
INLINE four eight_sums(const eight a[4]) {
    four w = eight_halves(a), x = eight_halves(a + 1);
    four y = eight_halves(a + 2), z = eight_halves(a + 3);
    four first =
        __builtin_shufflevector(w, x, 0, 4, 1, 5) + __builtin_shufflevector(w, x, 2, 6, 3, 7);
    four last =
        __builtin_shufflevector(y, z, 0, 4, 1, 5) + __builtin_shufflevector(y, z, 2, 6, 3, 7);
    return __builtin_shufflevector(first, last, 0, 1, 4, 5) +
           __builtin_shufflevector(first, last, 2, 3, 6, 7);
}

/* Whether a comparison was true in all lanes. */
INLINE bool eight_all(const eight_ints *a) {
    typedef int64_t pairs __attribute__((vector_size(32), aligned(16)));
    pairs p = (pairs)*a;
    return (p[0] & p[1] & (p[2] & p[3])) == -1;
}

/* Rows to columns. */
INLINE void eight_transpose(const eight from[LANES], eight to[LANES]) {
    eight a[LANES], b[LANES];
    for (int i = 0; i < LANES; i += 2) {
        a[i] = __builtin_shufflevector(from[i], from[i + 1], 0, 8, 1, 9, 4, 12, 5, 13);
        a[i + 1] = __builtin_shufflevector(from[i], from[i + 1], 2, 10, 3, 11, 6, 14, 7, 15);
    }
    for (int i = 0; i < LANES; i += 4)
        for (int k = 0; k < 2; k++) {
            b[i + 2 * k] =
                __builtin_shufflevector(a[i + k], a[i + k + 2], 0, 1, 8, 9, 4, 5, 12, 13);
            b[i + 2 * k + 1] =
                __builtin_shufflevector(a[i + k], a[i + k + 2], 2, 3, 10, 11, 6, 7, 14, 15);
        }
    for (int i = 0; i < LANES / 2; i++) {
        to[i] = __builtin_shufflevector(b[i], b[i + 4], 0, 1, 2, 3, 8, 9, 10, 11);
        to[i + 4] = __builtin_shufflevector(b[i], b[i + 4], 4, 5, 6, 7, 12, 13, 14, 15);
    }
}

#define EIGHT_ABS(a) ((eight)((eight_ints)(a)&INT32_MAX))

/* a where the bits are set, elsewhere b */
#define EIGHT_CHOOSE(where, a, b)                                                                  \
    ((eight)(((eight_ints)(a) & (where)) | ((eight_ints)(b) & ~(where))))

/* The lesser and the greater of whole numbers */
#define EIGHT_LEAST(a, b) (((a) & ((a) < (b))) | ((b) & ~((a) < (b))))
#define EIGHT_MOST(a, b) (((a) & ((a) > (b))) | ((b) & ~((a) > (b))))

#endif
