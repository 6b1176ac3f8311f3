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

/* Makes g->found those pixels of the middle of three rows whose bits are set in g->marked, from
 * column x on, but those whose gradient is below `low`. */
typedef void collector(gradient *g, int x, int words, int32_t low);

INLINE void collect(gradient *g, int x, int words, int32_t low) {
    int16_t *to = g->found.field;
    for (int k = 0; k < words; k++, x += 64) {
        const int16_t *up = g->s[0] + x, *mid = g->s[1] + x, *down = g->s[2] + x;
        const int16_t *here = g->m[1] + x;
        const int16_t *before[] = {g->m[0] + x, here - 1}, *after[] = {g->m[2] + x, here + 1};
        for (uint64_t bits = g->marked[k]; bits; bits &= bits - 1) {
            int i = __builtin_ctzll(bits);
            int gx = mid[i + 1] - mid[i - 1], gy = down[i] - up[i], across = here[i] & 1;
            to[ROW_X] = (int16_t)(x + i);
            to[ROW_GX] = (int16_t)gx;
            to[ROW_GY] = (int16_t)gy;
            to[ROW_BEFORE] = before[across][i];
            to[ROW_HERE] = here[i];
            to[ROW_AFTER] = after[across][i];
            to += gx * gx + gy * gy >= low * low;
        }
    }
    g->found.n = (int32_t)(to - g->found.field);
}

#if defined(__x86_64__)
/* Lists eights of pixels that cover all marks: 2^16 times the first column, and its eight bits. How
 * many a word has cannot be foreseen, so four are taken at once. */
AVX2_PATH static inline const uint32_t *list_eights(gradient *g, int x, int words) {
    uint32_t *to = g->eights;
    for (int k = 0; k < words; k++, x += 64)
        for (uint64_t bits = g->marked[k]; bits;)
            for (int step = 0; step < 4; step++) {
                unsigned i = (unsigned)_tzcnt_u64(bits) & 63;
                *to = ((unsigned)x + i) << 16 | (bits >> i & 0xFF);
                to += bits != 0;
                bits &= ~(UINT64_C(0xFF) << i);
            }
    return to;
}

AVX2_PATH static inline __m128i eight_at(const int16_t *p) {
    return _mm_loadu_si128((const void *)p);
}

AVX2_PATH static inline void put_eight(int16_t *to, __m128i v, __m128i squeeze) {
    _mm_storeu_si128((void *)to, _mm_shuffle_epi8(v, squeeze));
}

AVX2_PATH static inline void collect_avx2(gradient *g, int x, int words, int32_t low) {
    const __m128i order = _mm_set_epi16(7, 6, 5, 4, 3, 2, 1, 0);
    const __m128i below = _mm_set1_epi32(low * low - 1);
    const int16_t *s0 = g->s[0], *s1 = g->s[1], *s2 = g->s[2];
    const int16_t *m0 = g->m[0], *m1 = g->m[1], *m2 = g->m[2];
    const uint32_t *end = list_eights(g, x, words);
    int16_t *to = g->found.field;
    for (const uint32_t *eight = g->eights; eight < end; eight++) {
        ptrdiff_t c = *eight >> 16;
        __m128i gx = _mm_sub_epi16(eight_at(s1 + c + 1), eight_at(s1 + c - 1));
        __m128i gy = _mm_sub_epi16(eight_at(s2 + c), eight_at(s0 + c));
        __m128i here = eight_at(m1 + c), across = _mm_srai_epi16(_mm_slli_epi16(here, 15), 15);
        __m128i before = _mm_blendv_epi8(eight_at(m0 + c), eight_at(m1 + c - 1), across);
        __m128i after = _mm_blendv_epi8(eight_at(m2 + c), eight_at(m1 + c + 1), across);
        __m128i lo = _mm_unpacklo_epi16(gx, gy), hi = _mm_unpackhi_epi16(gx, gy);
        lo = _mm_cmpgt_epi32(_mm_madd_epi16(lo, lo), below);
        hi = _mm_cmpgt_epi32(_mm_madd_epi16(hi, hi), below);
        lo = _mm_packs_epi16(_mm_packs_epi32(lo, hi), lo);
        unsigned set = *eight & (unsigned)_mm_movemask_epi8(lo) & 0xFF;
        __m128i squeeze = _mm_loadu_si128((const void *)g->squeeze[set]);
        put_eight(to + ROW_X, _mm_add_epi16(_mm_set1_epi16((int16_t)c), order), squeeze);
        put_eight(to + ROW_GX, gx, squeeze);
        put_eight(to + ROW_GY, gy, squeeze);
        put_eight(to + ROW_BEFORE, before, squeeze);
        put_eight(to + ROW_HERE, here, squeeze);
        put_eight(to + ROW_AFTER, after, squeeze);
        to += __builtin_popcount(set);
    }
    g->found.n = (int32_t)(to - g->found.field);
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

/* The points of BATCH edgels of a row, from the first on. (x, y) is added to each. */
INLINE void points(const int16_t *e, float unit, float x, float y, arris_edge_point *restrict out) {
    float row[4][BATCH];
    for (int k = 0; k < BATCH; k++) {
        float d = peak(e[ROW_BEFORE + k], e[ROW_HERE + k], e[ROW_AFTER + k]);
        float across = (float)(e[ROW_HERE + k] & 1);
        row[0][k] = e[ROW_X + k] + x + across * d;
        row[1][k] = y + (1 - across) * d;
        row[2][k] = e[ROW_GX + k] * unit;
        row[3][k] = e[ROW_GY + k] * unit;
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

/* Columns and octants of eight edgels of a row, from the first on. */
INLINE void items(const int16_t *e, edgel *out) {
    eight_shorts x, gx, gy, here, octant, both[2];
    memcpy(&x, e + ROW_X, sizeof x);
    memcpy(&gx, e + ROW_GX, sizeof gx);
    memcpy(&gy, e + ROW_GY, sizeof gy);
    memcpy(&here, e + ROW_HERE, sizeof here);
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
            items(row->field + i + k, e->item + e->n + i + k);
        points(row->field + i, unit, x, y, e->point + e->n + i);
    }
    e->n += (uint32_t)row->n;
}

#endif
