/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * crowd.c: a bit a pixel for every edge point (crowd.h). Every row and column has a word of zeros
 * before it and two behind it, so that no look at the neighbours needs a test.
 */
#include "crowd.h"

#include "lens.h"

#include <stdlib.h>
#include <string.h>

static size_t words(int n) {
    return (size_t)n / 64 + 4;
}

int crowd_init(crowd *c, int width, int height) {
    c->bits[0] = malloc((size_t)height * words(width) * sizeof(uint64_t));
    c->bits[1] = malloc((size_t)width * words(height) * sizeof(uint64_t));
    return c->bits[0] && c->bits[1] ? 0 : ARRIS_E_MEMORY;
}

void crowd_free(crowd *c) {
    free(c->bits[0]);
    free(c->bits[1]);
}

/* Sets up to LANES points in their rows; `from` maps them to the picture, or is NULL. */
INLINE void set_points(crowd *c, const arris_edge_point *p, uint32_t n, int width, int height,
                       const lens *from) {
    eight x, y;
    for (uint32_t k = 0; k < LANES; k++) /* the first one again where there are no more */
        x[k] = p[k < n ? k : 0].x, y[k] = p[k < n ? k : 0].y;
    if (from)
        lens_distort(from, &x, &y);
    x += 0.5f, y += 0.5f;
    eight_ints in = (x > 0) & (y > 0) & (x < (float)width) & (y < (float)height);
    eight_ints at = __builtin_convertvector((eight)((eight_ints)x & in), eight_ints);
    eight_ints line = __builtin_convertvector((eight)((eight_ints)y & in), eight_ints);
    eight_ints word = line * (int32_t)c->stride[0] + (at >> 6) + 1;
    for (uint32_t k = 0; k < LANES; k++)
        c->bits[0][word[k]] |= (uint64_t)(in[k] & 1) << (at[k] & 63);
}

/* Four rows of 64 bits. */
typedef uint64_t rows4 __attribute__((vector_size(32), aligned(16)));

/* Swaps the blocks of `size` bits that the mask leaves out of a with those that it has of b. */
INLINE void swap_blocks(rows4 *a, rows4 *b, int size, uint64_t mask) {
    rows4 t = (*a >> size ^ *b) & mask;
    *a ^= t << size, *b ^= t;
}

/* Transposes 64x64 bits (Warren, Hacker's Delight, 7-3). */
INLINE void transpose(rows4 *a) {
    for (int i = 0; i < 8; i++)
        swap_blocks(&a[i], &a[i + 8], 32, 0x00000000FFFFFFFF);
    for (int i = 0; i < 16; i += i % 8 == 3 ? 5 : 1)
        swap_blocks(&a[i], &a[i + 4], 16, 0x0000FFFF0000FFFF);
    for (int i = 0; i < 16; i += i % 4 == 1 ? 3 : 1)
        swap_blocks(&a[i], &a[i + 2], 8, 0x00FF00FF00FF00FF);
    for (int i = 0; i < 16; i += 2) {
        swap_blocks(&a[i], &a[i + 1], 4, 0x0F0F0F0F0F0F0F0F);
        rows4 b = __builtin_shufflevector(a[i], a[i + 1], 0, 1, 4, 5);
        rows4 c = __builtin_shufflevector(a[i], a[i + 1], 2, 3, 6, 7);
        swap_blocks(&b, &c, 2, 0x3333333333333333);
        rows4 d = __builtin_shufflevector(b, c, 0, 4, 2, 6);
        rows4 e = __builtin_shufflevector(b, c, 1, 5, 3, 7);
        swap_blocks(&d, &e, 1, 0x5555555555555555);
        a[i] = __builtin_shufflevector(d, e, 0, 4, 1, 5);
        a[i + 1] = __builtin_shufflevector(d, e, 2, 6, 3, 7);
    }
}

/* Sets in the columns what is set in the 64 rows from `line` on, in the word of columns from `at`
 * on. */
INLINE void turn_block(crowd *c, int line, int at, int width, int height) {
    rows4 block[16] = {{0}};
    uint64_t *a = (uint64_t *)block, any = 0;
    const uint64_t *row = c->bits[0] + line * c->stride[0] + at / 64 + 1;
    for (int k = 0; k < 64 && line + k < height; k++, row += c->stride[0])
        any |= a[k] = *row;
    if (!any)
        return;
    transpose(block);
    uint64_t *column = c->bits[1] + at * c->stride[1] + line / 64 + 1;
    for (int k = 0; k < 64 && at + k < width; k++, column += c->stride[1])
        *column = a[k];
}

INLINE void fill(crowd *c, const arris_edges *e, int width, int height, const lens *from) {
    c->stride[0] = words(width), c->stride[1] = words(height);
    memset(c->bits[0], 0, (size_t)height * c->stride[0] * sizeof(uint64_t));
    memset(c->bits[1], 0, (size_t)width * c->stride[1] * sizeof(uint64_t));
    for (uint32_t i = 0; i < e->n; i += LANES)
        if (i + LANES <= e->n)
            set_points(c, e->point + i, LANES, width, height, from);
        else
            set_points(c, e->point + i, e->n - i, width, height, from);
    for (int line = 0; line < height; line += 64)
        for (int at = 0; at < width; at += 64)
            turn_block(c, line, at, width, height);
}

static void fill_portable(crowd *c, const arris_edges *e, int width, int height, const lens *from) {
    fill(c, e, width, height, from);
}

AVX2_PATH static void fill_avx2(crowd *c, const arris_edges *e, int width, int height,
                                const lens *from) {
    fill(c, e, width, height, from);
}

void crowd_fill(crowd *c, const arris_edges *e, int width, int height, const arris_camera *camera) {
    lens from = camera ? lens_of(camera) : (lens){0};
    (HAS_AVX2 ? fill_avx2 : fill_portable)(c, e, width, height, camera ? &from : NULL);
}

static void set(uint64_t *bits, size_t stride, unsigned line, unsigned at) {
    bits[line * stride + at / 64 + 1] |= (uint64_t)1 << at % 64;
}

void crowd_add(crowd *c, float x, float y) {
    unsigned at = (unsigned)(int)(x + 0.5f), line = (unsigned)(int)(y + 0.5f);
    set(c->bits[0], c->stride[0], line, at);
    set(c->bits[1], c->stride[1], at, line);
}
