/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * path.h: how a kernel's inner loops are compiled. All paths give the same bits.
 *
 * A kernel writes its loops as INLINE functions of plain C, and wraps them in one function a path:
 * SCALAR_PATH, one without a mark for what every machine of the target has (SSE2, NEON), AVX2_PATH.
 */
#ifndef EDGES_PATH_H
#define EDGES_PATH_H

#include <stdbool.h>

enum path { PATH_SCALAR, PATH_VECTOR, PATH_AVX2 };

#define INLINE static inline __attribute__((always_inline))

#if defined(__clang__)
#define SCALAR_PATH /* clang has no attribute for it */
#else
#define SCALAR_PATH __attribute__((optimize("no-tree-vectorize")))
#endif

#if defined(__x86_64__)
#define AVX2_PATH __attribute__((target("avx2,bmi,bmi2")))
static inline bool path_available(enum path p) {
    return p != PATH_AVX2 || (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi2"));
}
#else
#define AVX2_PATH
static inline bool path_available(enum path p) {
    return p != PATH_AVX2;
}
#endif

static inline enum path path_fastest(void) {
    return path_available(PATH_AVX2) ? PATH_AVX2 : PATH_VECTOR;
}

#endif
