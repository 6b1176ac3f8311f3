/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * append.h: pixels that are marked to edgels and their sub-pixel points; a part of gradient.c.
 */
#ifndef APPEND_H
#define APPEND_H

#include "gradient.h"

#include <string.h>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

enum { BATCH = EDGELS_BATCH, AHEAD = 8 * BATCH /* edgels that memory is asked for before */ };

typedef float four __attribute__((vector_size(16)));
typedef int16_t eight_shorts __attribute__((vector_size(16)));

/* Appends to g->found the pixels of the middle of three rows whose bits are set, from column x on,
 * but those whose gradient is below `low`. */
typedef void appender(gradient *g, ptrdiff_t x, uint64_t bits, int32_t low);

INLINE void append(gradient *g, ptrdiff_t x, uint64_t bits, int32_t low) {
    const int16_t *up = g->s[0] + x, *mid = g->s[1] + x, *down = g->s[2] + x, *here = g->m[1] + x;
    const int16_t *before[] = {g->m[0] + x, here - 1}, *after[] = {g->m[2] + x, here + 1};
    edgel_row *e = &g->found;
    int32_t n = e->n;
    for (; bits; bits &= bits - 1) {
        ptrdiff_t i = __builtin_ctzll(bits);
        int gx = mid[i + 1] - mid[i - 1], gy = down[i] - up[i], across = here[i] & 1;
        e->x[n] = (int16_t)(x + i);
        e->gx[n] = (int16_t)gx;
        e->gy[n] = (int16_t)gy;
        e->before[n] = before[across][i];
        e->here[n] = here[i];
        e->after[n] = after[across][i];
        n += gx * gx + gy * gy >= low * low;
    }
    e->n = n;
}

#if defined(__x86_64__)
AVX2_PATH static inline __m128i eight_at(const int16_t *p) {
    return _mm_loadu_si128((const void *)p);
}

/* Those of eight pixels from x on that are in the set. */
AVX2_PATH static inline unsigned append_eight(gradient *g, ptrdiff_t x, unsigned set,
                                              __m128i below) {
    const __m128i order = _mm_set_epi16(7, 6, 5, 4, 3, 2, 1, 0);
    edgel_row *e = &g->found;
    const int16_t *mid = g->s[1] + x, *m = g->m[1] + x;
    __m128i gx = _mm_sub_epi16(eight_at(mid + 1), eight_at(mid - 1));
    __m128i gy = _mm_sub_epi16(eight_at(g->s[2] + x), eight_at(g->s[0] + x));
    __m128i here = eight_at(m), across = _mm_srai_epi16(_mm_slli_epi16(here, 15), 15);
    __m128i before = _mm_blendv_epi8(eight_at(g->m[0] + x), eight_at(m - 1), across);
    __m128i after = _mm_blendv_epi8(eight_at(g->m[2] + x), eight_at(m + 1), across);
    __m128i lo = _mm_unpacklo_epi16(gx, gy), hi = _mm_unpackhi_epi16(gx, gy);
    lo = _mm_cmpgt_epi32(_mm_madd_epi16(lo, lo), below);
    hi = _mm_cmpgt_epi32(_mm_madd_epi16(hi, hi), below);
    lo = _mm_packs_epi16(_mm_packs_epi32(lo, hi), lo);
    set &= (unsigned)_mm_movemask_epi8(lo);
    __m128i squeeze = _mm_loadu_si128((const void *)g->squeeze[set]);
    int32_t n = e->n;
    __m128i at = _mm_add_epi16(_mm_set1_epi16((int16_t)x), order);
    _mm_storeu_si128((void *)(e->x + n), _mm_shuffle_epi8(at, squeeze));
    _mm_storeu_si128((void *)(e->gx + n), _mm_shuffle_epi8(gx, squeeze));
    _mm_storeu_si128((void *)(e->gy + n), _mm_shuffle_epi8(gy, squeeze));
    _mm_storeu_si128((void *)(e->before + n), _mm_shuffle_epi8(before, squeeze));
    _mm_storeu_si128((void *)(e->here + n), _mm_shuffle_epi8(here, squeeze));
    _mm_storeu_si128((void *)(e->after + n), _mm_shuffle_epi8(after, squeeze));
    return (unsigned)__builtin_popcount(set);
}

AVX2_PATH static inline void append_avx2(gradient *g, ptrdiff_t x, uint64_t bits, int32_t low) {
    __m128i below = _mm_set1_epi32(low * low - 1);
    while (bits) {
        int i = __builtin_ctzll(bits);
        g->found.n += (int32_t)append_eight(g, x + i, bits >> i & 0xFF, below);
        bits &= ~(UINT64_C(0xFF) << i);
    }
}
#endif

/* A blurred step is steepest where a Gaussian through the gradients of three pixels along the main
 * axis has its maximum: at (u - v) / (u + v) / 2, where u and v are the logarithms of the middle
 * one over either other, ln(h / a) = 3 (h² - a²) / (h² + 4 h a + a²) to within 1 % up to h = 3 a.
 * Never more than half a pixel off. */
INLINE float peak(float a, float h, float b) {
    float u = (h * h - a * a) * (h * h + 4 * h * b + b * b);
    float v = (h * h - b * b) * (h * h + 4 * h * a + a * a);
    return 0.5f * (u - v) / (u + v + 1e-9f);
}

/* The points of BATCH edgels of a row, from the i-th on. (x, y) is added to each. */
INLINE void points(const edgel_row *e, int32_t i, float unit, float x, float y,
                   arris_edge_point *restrict out) {
    float row[4][BATCH];
    for (int k = 0; k < BATCH; k++) {
        float d = peak(e->before[i + k], e->here[i + k], e->after[i + k]);
        float across = (float)(e->here[i + k] & 1);
        row[0][k] = e->x[i + k] + x + across * d;
        row[1][k] = y + (1 - across) * d;
        row[2][k] = e->gx[i + k] * unit;
        row[3][k] = e->gy[i + k] * unit;
    }
    for (int k = 0; k < BATCH; k += 4) {
        four r[4], to[4];
        for (int c = 0; c < 4; c++)
            memcpy(&r[c], row[c] + k, sizeof r[c]);
        four a = __builtin_shufflevector(r[0], r[1], 0, 4, 1, 5);
        four b = __builtin_shufflevector(r[2], r[3], 0, 4, 1, 5);
        four c = __builtin_shufflevector(r[0], r[1], 2, 6, 3, 7);
        four d = __builtin_shufflevector(r[2], r[3], 2, 6, 3, 7);
        to[0] = __builtin_shufflevector(a, b, 0, 1, 4, 5);
        to[1] = __builtin_shufflevector(a, b, 2, 3, 6, 7);
        to[2] = __builtin_shufflevector(c, d, 0, 1, 4, 5);
        to[3] = __builtin_shufflevector(c, d, 2, 3, 6, 7);
        memcpy(out + k, to, sizeof to);
    }
}

/* Columns and octants of eight edgels of a row, from the i-th on. */
INLINE void items(const edgel_row *e, int32_t i, edgel *out) {
    eight_shorts x, gx, gy, here, octant, both[2];
    memcpy(&x, e->x + i, sizeof x);
    memcpy(&gx, e->gx + i, sizeof gx);
    memcpy(&gy, e->gy + i, sizeof gy);
    memcpy(&here, e->here + i, sizeof here);
    octant = (here & 1) << 2 | (gx >> 15 & 2) | (gy >> 15 & 1);
    both[0] = __builtin_shufflevector(x, octant, 0, 8, 1, 9, 2, 10, 3, 11);
    both[1] = __builtin_shufflevector(x, octant, 4, 12, 5, 13, 6, 14, 7, 15);
    memcpy(out, both, sizeof both);
}

/* Appends the row's edgels to `e`, which has room for BATCH more. Where the points are more than
 * the near caches hold, each line of them would be waited for when it is written. */
INLINE void append_row(const edgel_row *row, float unit, float x, float y, edgels *e) {
    for (int32_t i = 0; i < row->n; i += BATCH) {
        for (int k = 0; k < BATCH; k += 4)
            __builtin_prefetch(e->point + e->n + i + k + AHEAD, 1);
        for (int k = 0; k < BATCH; k += 8)
            items(row, i + k, e->item + e->n + i + k);
        points(row, i, unit, x, y, e->point + e->n + i);
    }
    e->n += (uint32_t)row->n;
}

#endif
