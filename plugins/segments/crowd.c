/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * crowd.c: a bit a pixel for every edge point (crowd.h). Every row and column has a word of zeros
 * before it and two behind it, so that no look at the neighbours needs a test.
 */
#include "crowd.h"

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

INLINE void set(uint64_t *bits, size_t stride, unsigned line, unsigned at) {
    bits[line * stride + at / 64 + 1] |= (uint64_t)1 << at % 64;
}

INLINE void fill(crowd *c, const arris_edges *e, int width, int height, const arris_camera *lens) {
    float right = (float)width - 0.5f, bottom = (float)height - 0.5f;
    size_t row = c->stride[0] = words(width), column = c->stride[1] = words(height);
    uint64_t *by_row = c->bits[0], *by_column = c->bits[1];
    memset(by_row, 0, (size_t)height * row * sizeof *by_row);
    memset(by_column, 0, (size_t)width * column * sizeof *by_column);
    for (uint32_t i = 0; i < e->n; i++) {
        float x = e->point[i].x, y = e->point[i].y;
        if (lens) {
            double u, v;
            arris_distort(lens, (double)x, (double)y, &u, &v);
            x = (float)u, y = (float)v;
        }
        if (!(x > -0.5f && y > -0.5f && x < right && y < bottom))
            continue;
        unsigned at = (unsigned)(int)(x + 0.5f), line = (unsigned)(int)(y + 0.5f);
        set(by_row, row, line, at);
        set(by_column, column, at, line);
    }
}

static void fill_portable(crowd *c, const arris_edges *e, int width, int height,
                          const arris_camera *lens) {
    fill(c, e, width, height, lens);
}

AVX2_PATH static void fill_avx2(crowd *c, const arris_edges *e, int width, int height,
                                const arris_camera *lens) {
    fill(c, e, width, height, lens);
}

void crowd_fill(crowd *c, const arris_edges *e, int width, int height, const arris_camera *lens) {
    (HAS_AVX2 ? fill_avx2 : fill_portable)(c, e, width, height, lens);
}

void crowd_add(crowd *c, float x, float y) {
    unsigned at = (unsigned)(int)(x + 0.5f), line = (unsigned)(int)(y + 0.5f);
    set(c->bits[0], c->stride[0], line, at);
    set(c->bits[1], c->stride[1], at, line);
}
