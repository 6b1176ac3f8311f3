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

INLINE void set(uint64_t *bits, size_t stride, unsigned line, unsigned at) {
    bits[line * stride + at / 64 + 1] |= (uint64_t)1 << at % 64;
}

/* Sets up to LANES points; `from` maps them to the picture, or is NULL. */
INLINE void set_points(crowd *c, const arris_edge_point *p, uint32_t n, int width, int height,
                       const lens *from) {
    eight x, y;
    for (uint32_t k = 0; k < LANES; k++)
        x[k] = p[k < n ? k : 0].x, y[k] = p[k < n ? k : 0].y;
    if (from)
        lens_distort(from, &x, &y);
    x += 0.5f, y += 0.5f;
    eight_ints in = (x > 0) & (y > 0) & (x < (float)width) & (y < (float)height);
    eight_ints at = __builtin_convertvector((eight)((eight_ints)x & in), eight_ints);
    eight_ints line = __builtin_convertvector((eight)((eight_ints)y & in), eight_ints);
    for (uint32_t k = 0; k < n; k++)
        if (in[k]) {
            set(c->bits[0], c->stride[0], (unsigned)line[k], (unsigned)at[k]);
            set(c->bits[1], c->stride[1], (unsigned)at[k], (unsigned)line[k]);
        }
}

INLINE void fill(crowd *c, const arris_edges *e, int width, int height, const lens *from) {
    uint32_t i = 0;
    c->stride[0] = words(width), c->stride[1] = words(height);
    memset(c->bits[0], 0, (size_t)height * c->stride[0] * sizeof(uint64_t));
    memset(c->bits[1], 0, (size_t)width * c->stride[1] * sizeof(uint64_t));
    for (; i + LANES <= e->n; i += LANES)
        set_points(c, e->point + i, LANES, width, height, from);
    if (i < e->n)
        set_points(c, e->point + i, e->n - i, width, height, from);
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

void crowd_add(crowd *c, float x, float y) {
    unsigned at = (unsigned)(int)(x + 0.5f), line = (unsigned)(int)(y + 0.5f);
    set(c->bits[0], c->stride[0], line, at);
    set(c->bits[1], c->stride[1], at, line);
}
