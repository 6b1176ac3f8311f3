/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * link.c: edgels to chains. On either side an edgel picks the neighbour that goes on best; two are
 * joined when each picks the other. So a chain goes straight on through a junction while the
 * branches end there: none is swallowed, and the result does not depend on any order.
 */
#include "link.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { DONE = -1, MIDDLE = 4, BATCH = 64 };

/* ---- the table ------------------------------------------------------------------------------ */

/* The 3x3 pixels, numbered as their bits come from three rows. */
static const int8_t step_x[9] = {-1, 0, 1, -1, 0, 1, -1, 0, 1};
static const int8_t step_y[9] = {-1, -1, -1, 0, 0, 0, 1, 1, 1};

/* The octant of the gradient, which is also that of the direction along the edge. */
static inline int octant(int gx, int gy, int across) {
    return across << 2 | (gx < 0) << 1 | (gy < 0);
}

/* Of the pixels in `bits` ahead in the direction (tx, ty): by distance and part across it. */
static uint8_t best_step(double tx, double ty, int bits) {
    uint8_t best = MIDDLE;
    double least = INFINITY;
    for (uint8_t k = 0; k < 9; k++) {
        double d2 = step_x[k] * step_x[k] + step_y[k] * step_y[k];
        double along = step_x[k] * tx + step_y[k] * ty;
        double cost = 4 * d2 - 3 * along * along;
        if (bits >> k & 1 && along > 1e-9 && cost < least)
            least = cost, best = k;
    }
    return best;
}

static void set_table(linker *l) {
    double most = cos(M_PI / 8), least = sin(M_PI / 8); /* the middle of an octant */
    for (int k = 0; k < LINK_OCTANTS; k++) {
        double gx = (k & 4 ? most : least) * (k & 2 ? -1 : 1);
        double gy = (k & 4 ? least : most) * (k & 1 ? -1 : 1);
        for (int bits = 0; bits < LINK_PATTERNS; bits++)
            l->best[k][bits] = (link_steps){best_step(gy, -gx, bits), best_step(-gy, gx, bits)};
    }
}

int link_init(linker *l, int width, size_t max) {
    *l = (linker){.width = (size_t)width + 64};
    set_table(l);
    size_t columns = 3 * l->width;
    int32_t *p = l->memory = malloc((4 * max + columns) * sizeof *p + columns / 8);
    if (!p)
        return ARRIS_E_MEMORY;
    l->next = p;
    l->prev = p + max;
    l->start = p + 2 * max;
    l->order = p + 3 * max;
    for (int i = 0; i < 3; i++) {
        l->index[i] = p + 4 * max + l->width * (size_t)i;
        l->bits[i] = (uint8_t *)(p + 4 * max + columns) + l->width / 8 * (size_t)i;
    }
    return 0;
}

void link_free(linker *l) {
    free(l->memory);
    *l = (linker){0};
}

/* ---- neighbours ----------------------------------------------------------------------------- */

/* The bits of columns x - 1 to x + 1. */
static inline unsigned window(const uint8_t *bits, unsigned x) {
    uint16_t w;
    memcpy(&w, bits + (x - 1) / 8, sizeof w);
    return (unsigned)w >> (x - 1) % 8 & 7;
}

static void enter_row(linker *l, const edgels *e, int y) {
    int32_t *index = l->index[0], i = (int32_t)e->row[y];
    uint8_t *bits = memset(l->bits[0], 0, l->width / 8);
    const edgel *a = e->item + i, *end = e->item + e->row[y + 1];
    for (; a < end; a++, i++) {
        unsigned x = (unsigned)a->x;
        index[x] = i;
        bits[x / 8] |= (uint8_t)(1 << x % 8);
    }
    l->index[0] = l->index[1], l->index[1] = l->index[2], l->index[2] = index;
    l->bits[0] = l->bits[1], l->bits[1] = l->bits[2], l->bits[2] = bits;
}

static void link_row(linker *l, const edgels *e, int y) {
    const uint8_t *up = l->bits[0], *mid = l->bits[1], *down = l->bits[2];
    const edgel *a = e->item + e->row[y], *end = e->item + e->row[y + 1];
    int32_t *next = l->next + e->row[y], *prev = l->prev + e->row[y];
    const int32_t *at[9];
    for (int k = 0; k < 9; k++)
        at[k] = l->index[1 + step_y[k]] + step_x[k];
    for (; a < end; a++) {
        unsigned x = (unsigned)a->x;
        unsigned bits = window(up, x) | window(mid, x) << 3 | window(down, x) << 6;
        link_steps to = l->best[octant(a->gx, a->gy, a->across)][bits];
        *next++ = at[to.next][x];
        *prev++ = at[to.prev][x];
    }
}

void link_edgels(linker *l, const edgels *e, int height) {
    memset(l->bits[1], 0, l->width / 8);
    memset(l->bits[2], 0, l->width / 8);
    for (int y = 0; y < height; y++) {
        enter_row(l, e, y);
        if (y > 0)
            link_row(l, e, y - 1);
    }
}

/* ---- chains --------------------------------------------------------------------------------- */

/* Lists the edgels that no other goes on to. */
static uint32_t find_starts(linker *l, int32_t n) {
    uint32_t found = 0;
    for (int32_t i = 0; i < n; i++) {
        int32_t prev = l->prev[i];
        l->start[found] = i;
        found += (prev == i) | (l->next[prev] != i);
    }
    return found;
}

/* Walks one chain from edgel i on, and uses it up. */
static void walk(linker *l, const edgels *e, int32_t i, bool closed, int32_t high2,
                 uint32_t min_length, arris_edges *out) {
    int32_t *order = l->order + out->n, most = 0;
    uint32_t room = out->max - out->n, n = 0;
    for (bool more = true; more; n++) {
        int32_t gx = e->item[i].gx, gy = e->item[i].gy, g = gx * gx + gy * gy, next = l->next[i];
        most = g > most ? g : most;
        order[n] = i;
        l->prev[i] = DONE;
        more = l->prev[next] == i; /* not so when next is i itself */
        i = next;
    }
    if (most < high2 || n < min_length)
        return;
    uint32_t kept = n < room ? n : room;
    out->lost += n - kept;
    if (out->n_chains == out->max_chains || kept == 0) {
        out->lost_chains++;
        out->lost += kept;
        return;
    }
    out->chain[out->n_chains++] = (arris_chain){out->n, kept, closed && kept == n};
    out->n += kept;
}

/* A blurred step is steepest where a Gaussian through the gradients of three pixels along the main
 * axis has its maximum: at (u - v) / (u + v) / 2, where u and v are the logarithms of the middle
 * one over either other, ln(h / a) = 3 (h² - a²) / (h² + 4 h a + a²) to within 1 % up to h = 3 a.
 * Never more than half a pixel off. */
INLINE void points(const edgel *item, const int32_t *order, uint32_t n, float unit, float dx,
                   float dy, arris_edge_point *restrict out) {
    edgel t[BATCH];
    for (uint32_t i = 0; i < n; i++)
        t[i] = item[order[i]];
    for (uint32_t i = 0; i < n; i++) {
        float h = t[i].here, a = t[i].before, b = t[i].after;
        float u = (h * h - a * a) * (h * h + 4 * h * b + b * b);
        float v = (h * h - b * b) * (h * h + 4 * h * a + a * a);
        float d = 0.5f * (u - v) / (u + v + 1e-9f), across = t[i].across;
        out[i].x = t[i].x + dx + across * d;
        out[i].y = t[i].y + dy + (1 - across) * d;
        out[i].gx = t[i].gx * unit;
        out[i].gy = t[i].gy * unit;
    }
}

SCALAR_PATH static void points_scalar(const edgel *item, const int32_t *order, uint32_t n,
                                      float unit, float dx, float dy, arris_edge_point *out) {
    points(item, order, n, unit, dx, dy, out);
}

static void points_vector(const edgel *item, const int32_t *order, uint32_t n, float unit, float dx,
                          float dy, arris_edge_point *out) {
    points(item, order, n, unit, dx, dy, out);
}

AVX2_PATH static void points_avx2(const edgel *item, const int32_t *order, uint32_t n, float unit,
                                  float dx, float dy, arris_edge_point *out) {
    points(item, order, n, unit, dx, dy, out);
}

void link_chains(linker *l, const edgels *e, float unit, float high, uint32_t min_length, float dx,
                 float dy, arris_edges *out, enum path path) {
    static void (*const set_points[])(const edgel *, const int32_t *, uint32_t, float, float, float,
                                      arris_edge_point *) = {points_scalar, points_vector,
                                                             points_avx2};
    int32_t high2 = (int32_t)fminf(high * high, (float)(INT32_MAX / 2));
    uint32_t n = find_starts(l, (int32_t)e->n);
    for (uint32_t i = 0; i < n; i++)
        walk(l, e, l->start[i], false, high2, min_length, out);
    for (uint32_t i = 0; i < e->n; i++)
        if (l->prev[i] != DONE)
            walk(l, e, (int32_t)i, true, high2, min_length, out);
    for (uint32_t i = 0; i < out->n; i += BATCH)
        set_points[path](e->item, l->order + i, out->n - i < BATCH ? out->n - i : BATCH, unit, dx,
                         dy, out->point + i);
}
