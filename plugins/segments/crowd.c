/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * crowd.c: a bit a pixel for every edge point (crowd.h). Every row and column has a word of zeros
 * before it and two behind it, so that no look at the neighbours needs a test.
 */
#include "crowd.h"

#include "lens.h"

#include <stdlib.h>
#include <string.h>

#define CLEAR 3.5f /* times a pixel's noise, the gradient per px from which a point is clear */

static size_t words(int n) {
    return (size_t)n / 64 + 4;
}

int crowd_init(crowd *c, int width, int height) {
    size_t rows = (size_t)height * words(width), columns = (size_t)width * words(height);
    c->to_all = rows + columns;
    c->bits[0] = malloc(2 * c->to_all * sizeof(uint64_t));
    c->bits[1] = c->bits[0] + rows;
    return c->bits[0] ? 0 : ARRIS_E_MEMORY;
}

void crowd_free(crowd *c) {
    free(c->bits[0]);
}

/* The coordinates and gradients of LANES points, in some order. */
INLINE void take_apart(const arris_edge_point *p, eight *x, eight *y, eight *gx, eight *gy) {
    eight in[4], a[4];
    for (int i = 0; i < 4; i++)
        eight_load(&p[2 * i], &in[i]);
    for (int i = 0; i < 4; i += 2) {
        a[i] = __builtin_shufflevector(in[i], in[i + 1], 0, 8, 1, 9, 4, 12, 5, 13);
        a[i + 1] = __builtin_shufflevector(in[i], in[i + 1], 2, 10, 3, 11, 6, 14, 7, 15);
    }
    *x = __builtin_shufflevector(a[0], a[2], 0, 1, 8, 9, 4, 5, 12, 13);
    *y = __builtin_shufflevector(a[0], a[2], 2, 3, 10, 11, 6, 7, 14, 15);
    *gx = __builtin_shufflevector(a[1], a[3], 0, 1, 8, 9, 4, 5, 12, 13);
    *gy = __builtin_shufflevector(a[1], a[3], 2, 3, 10, 11, 6, 7, 14, 15);
}

/* Sets LANES points in their rows; `from` maps them to the picture, or is NULL. */
INLINE void set_points(crowd *c, const arris_edge_point *p, int width, int height,
                       const lens *from) {
    eight x, y, gx, gy;
    take_apart(p, &x, &y, &gx, &gy);
    if (from)
        lens_distort(from, &x, &y);
    x += 0.5f, y += 0.5f;
    eight_ints in = (x > 0) & (y > 0) & (x < (float)width) & (y < (float)height);
    eight_ints at = __builtin_convertvector((eight)((eight_ints)x & in), eight_ints);
    eight_ints line = __builtin_convertvector((eight)((eight_ints)y & in), eight_ints);
    eight_ints bit = line * (int32_t)(64 * c->stride[0]) + at + 64;
    eight_ints faint = gx * gx + gy * gy < c->clear * c->clear;
    bit = (bit + (faint & (int32_t)(64 * c->to_all))) & in; /* the first bit where it is outside */
    for (uint32_t k = 0; k < LANES; k++)
        c->bits[0][bit[k] >> 6] |= (uint64_t)1 << (bit[k] & 63);
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
INLINE void turn_block(crowd *c, size_t plane, int line, int at, int width, int height) {
    rows4 block[16] = {{0}};
    uint64_t *a = (uint64_t *)block, any = 0;
    const uint64_t *row = c->bits[0] + plane + line * c->stride[0] + at / 64 + 1;
    int rows = height - line < 64 ? height - line : 64, columns = width - at < 64 ? width - at : 64;
    for (int k = 0; k < rows; k++, row += c->stride[0])
        any |= a[k] = *row;
    if (!any)
        return;
    transpose(block);
    uint64_t *column = c->bits[1] + plane + at * c->stride[1] + line / 64 + 1;
    for (int k = 0; k < columns; k++, column += c->stride[1])
        *column = a[k];
}

/* Adds the clear points to those of all. */
INLINE void add_clear(crowd *c, int columns, size_t n) {
    uint64_t *from = c->bits[columns], *to = from + c->to_all;
    for (size_t i = 0; i < n; i++)
        to[i] |= from[i];
}

/* Line by line, as long ones are cleared byte by byte. */
INLINE void clear(uint64_t *bits, int lines, size_t stride) {
    for (int i = 0; i < lines; i++, bits += stride)
        memset(bits, 0, stride * sizeof *bits);
}

INLINE void fill(crowd *c, const arris_edges *e, int width, int height, const lens *from) {
    c->stride[0] = words(width), c->stride[1] = words(height);
    size_t rows = height * c->stride[0], columns = width * c->stride[1];
    uint32_t whole = e->n / LANES * LANES;
    arris_edge_point last[LANES];
    for (size_t plane = 0; plane <= c->to_all; plane += c->to_all) {
        clear(c->bits[0] + plane, height, c->stride[0]);
        clear(c->bits[1] + plane, width, c->stride[1]);
    }
    for (uint32_t i = 0; i < whole; i += LANES)
        set_points(c, e->point + i, width, height, from);
    for (uint32_t k = 0; k < LANES && whole < e->n; k++) /* the first again where there is none */
        last[k] = e->point[whole + (whole + k < e->n ? k : 0)];
    if (whole < e->n)
        set_points(c, last, width, height, from);
    c->bits[0][0] = 0; /* points outside of the picture */
    for (size_t plane = 0; plane <= c->to_all; plane += c->to_all)
        for (int line = 0; line < height; line += 64)
            for (int at = 0; at < width; at += 64)
                turn_block(c, plane, line, at, width, height);
    add_clear(c, 0, rows);
    add_clear(c, 1, columns);
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
    c->clear = CLEAR * e->noise;
    (HAS_AVX2 ? fill_avx2 : fill_portable)(c, e, width, height, camera ? &from : NULL);
}
