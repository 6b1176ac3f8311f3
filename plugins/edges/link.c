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

enum { DONE = -1, BATCH = 64 };

/* ---- the tables ----------------------------------------------------------------------------- */

/* Pixels around an edgel are numbered row by row, 3x3 or 5x5, as their bits come from the rows. */
enum { NEAR = 3, FAR = LINK_ROWS, MIDDLE = NEAR * NEAR / 2 };

/* The octant of the gradient, which is also that of the direction along the edge. */
static inline int octant(int gx, int gy, int across) {
    return across << 2 | (gx < 0) << 1 | (gy < 0);
}

/* How badly the step to a pixel goes on in the direction (x, y): its length, then its turn. Length
 * comes first because it is the same seen from either end, so that both ends pick each other.
 * INFINITY for a pixel that is not ahead. */
static double step_cost(int pixel, int size, double x, double y, double least_cos) {
    int dx = pixel % size - size / 2, dy = pixel / size - size / 2;
    double d = hypot(dx, dy), along = d > 0 ? (dx * x + dy * y) / d : -1;
    return along > least_cos ? 2 * d * d - along : INFINITY;
}

static uint8_t best_near(double x, double y, int bits) {
    uint8_t best = MIDDLE;
    for (uint8_t k = 0; k < NEAR * NEAR; k++)
        if (bits >> k & 1 && step_cost(k, NEAR, x, y, 0) < step_cost(best, NEAR, x, y, 0))
            best = k;
    return best;
}

/* The pixels that are two away and within 60 degrees of the direction. */
static link_far sort_far(double x, double y) {
    link_far f = {.bits = 0};
    for (int i = 0, n = 0; i < FAR * FAR; i++) {
        double cost = step_cost(i, FAR, x, y, 0.5);
        if (cost == INFINITY || (abs(i % FAR - FAR / 2) < 2 && abs(i / FAR - FAR / 2) < 2))
            continue;
        int k = n++;
        for (; k > 0 && step_cost(f.pixel[k - 1], FAR, x, y, 0.5) > cost; k--)
            f.pixel[k] = f.pixel[k - 1];
        f.pixel[k] = (uint8_t)i;
        f.bits |= 1u << i;
    }
    return f;
}

static void set_tables(linker *l) {
    double most = cos(M_PI / 8), least = sin(M_PI / 8); /* the middle of an octant */
    for (int k = 0; k < LINK_OCTANTS; k++) {
        double gx = (k & 4 ? most : least) * (k & 2 ? -1 : 1);
        double gy = (k & 4 ? least : most) * (k & 1 ? -1 : 1);
        for (int bits = 0; bits < 1 << NEAR * NEAR; bits++)
            l->near[k][bits] = (link_near){best_near(gy, -gx, bits), best_near(-gy, gx, bits)};
        l->next_far[k] = sort_far(gy, -gx);
        l->prev_far[k] = sort_far(-gy, gx);
    }
}

int link_init(linker *l, int width, size_t max) {
    *l = (linker){.width = ((size_t)width / 64 + 2) * 64};
    set_tables(l);
    size_t columns = LINK_ROWS * l->width;
    int32_t *p = l->memory = malloc((4 * max + columns) * sizeof *p + columns / 8);
    if (!p)
        return ARRIS_E_MEMORY;
    l->next = p;
    l->prev = p + max;
    l->start = p + 2 * max;
    l->order = p + 3 * max;
    for (int i = 0; i < LINK_ROWS; i++) {
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

/* The bits of `size` columns with x in the middle. */
static inline unsigned window(const uint8_t *bits, unsigned x, int size) {
    uint16_t w;
    x -= (unsigned)size / 2;
    memcpy(&w, bits + x / 8, sizeof w);
    return (unsigned)w >> x % 8 & ((1u << size) - 1);
}

static void turn(linker *l) {
    int32_t *index = l->index[0];
    uint8_t *bits = l->bits[0];
    for (int k = 0; k < LINK_ROWS - 1; k++) {
        l->index[k] = l->index[k + 1];
        l->bits[k] = l->bits[k + 1];
    }
    l->index[LINK_ROWS - 1] = index;
    l->bits[LINK_ROWS - 1] = memset(bits, 0, l->width / 8);
}

static void enter_row(linker *l, const edgels *e, int y) {
    int32_t *index = l->index[LINK_ROWS - 1], i = (int32_t)e->row[y];
    uint8_t *bits = l->bits[LINK_ROWS - 1];
    const edgel *a = e->item + i, *end = e->item + e->row[y + 1];
    for (; a < end; a++, i++) {
        unsigned x = (unsigned)a->x;
        index[x] = i;
        bits[x / 8] |= (uint8_t)(1 << x % 8);
    }
}

/* The best edgel two pixels from column x of the middle row, where `bits` are its 5x5 pixels;
 * `none` when there is none. */
static inline int32_t far_neighbour(const linker *l, const link_far *f, unsigned bits, int x,
                                    int32_t none) {
    for (int k = 0; bits & f->bits; k++)
        if (bits >> f->pixel[k] & 1)
            return l->index[f->pixel[k] / FAR][x + f->pixel[k] % FAR - FAR / 2];
    return none;
}

/* For edgel i of the middle row, where one of the 3x3 pixels does not go on. */
static void link_far_ends(linker *l, const edgel *a, int32_t i) {
    int k = octant(a->gx, a->gy, a->across);
    unsigned bits = 0;
    for (int row = 0; row < FAR; row++)
        bits |= window(l->bits[row], (unsigned)a->x, FAR) << FAR * row;
    if (l->next[i] == i)
        l->next[i] = far_neighbour(l, &l->next_far[k], bits, a->x, i);
    if (l->prev[i] == i)
        l->prev[i] = far_neighbour(l, &l->prev_far[k], bits, a->x, i);
}

static void link_row(linker *l, const edgels *e, int y) {
    const uint8_t *up = l->bits[1], *mid = l->bits[2], *down = l->bits[3];
    int32_t *next = l->next, *prev = l->prev, *ends = l->start, n_ends = 0;
    const edgel *item = e->item;
    const int32_t *at[NEAR * NEAR];
    for (int k = 0; k < NEAR * NEAR; k++)
        at[k] = l->index[LINK_REACH - 1 + k / NEAR] + k % NEAR - 1;
    for (int32_t i = (int32_t)e->row[y], n = (int32_t)e->row[y + 1]; i < n; i++) {
        const edgel *a = &item[i];
        unsigned x = (unsigned)a->x;
        unsigned bits =
            window(up, x, NEAR) | window(mid, x, NEAR) << 3 | window(down, x, NEAR) << 6;
        link_near to = l->near[octant(a->gx, a->gy, a->across)][bits];
        next[i] = at[to.next][x];
        prev[i] = at[to.prev][x];
        ends[n_ends] = i;
        n_ends += (to.next == MIDDLE) | (to.prev == MIDDLE);
    }
    for (int k = 0; k < n_ends; k++)
        link_far_ends(l, &item[ends[k]], ends[k]);
}

void link_edgels(linker *l, const edgels *e, int height) {
    for (int k = 0; k < LINK_ROWS; k++)
        turn(l);
    for (int y = 0; y < height; y++, turn(l)) {
        enter_row(l, e, y);
        if (y >= LINK_REACH)
            link_row(l, e, y - LINK_REACH);
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
    if (out->n_chains == out->max_chains || kept < min_length) {
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
