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

#define DONE UINT32_MAX

/* ---- the tables ----------------------------------------------------------------------------- */

/* Pixels around an edgel are numbered row by row, 3x3 or 5x5, as their bits come from the rows. */
enum { NEAR = 3, FAR = LINK_ROWS, MIDDLE = NEAR * NEAR / 2 };

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
    l->to = l->memory = malloc(max * (sizeof *l->to + sizeof *l->start) +
                               columns * sizeof **l->index + columns / 8);
    if (!l->to)
        return ARRIS_E_MEMORY;
    l->start = (uint32_t *)(l->to + max);
    for (int i = 0; i < LINK_ROWS; i++) {
        l->index[i] = (uint16_t *)(l->start + max) + l->width * (size_t)i;
        l->bits[i] = (uint8_t *)(l->index[0] + columns) + l->width / 8 * (size_t)i;
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
    uint16_t *index = l->index[0];
    uint8_t *bits = l->bits[0];
    for (int k = 0; k < LINK_ROWS - 1; k++) {
        l->index[k] = l->index[k + 1];
        l->bits[k] = l->bits[k + 1];
    }
    l->index[LINK_ROWS - 1] = index;
    l->bits[LINK_ROWS - 1] = memset(bits, 0, l->width / 8);
}

static void enter_row(linker *l, const edgels *e, int y) {
    uint16_t *index = l->index[LINK_ROWS - 1];
    uint8_t *bits = l->bits[LINK_ROWS - 1];
    const edgel *a = e->item + e->row[y];
    for (uint32_t i = 0, n = e->row[y + 1] - e->row[y]; i < n; i++) {
        unsigned x = a[i].x;
        index[x] = (uint16_t)i;
        bits[x / 8] |= (uint8_t)(1 << x % 8);
    }
}

/* The best edgel two pixels from column x of row y, the middle one, where `bits` are its 5x5
 * pixels; `none` when there is none. */
static inline uint32_t far_neighbour(const linker *l, const edgels *e, const link_far *f,
                                     unsigned bits, int x, int y, uint32_t none) {
    for (int k = 0; bits & f->bits; k++) {
        int row = f->pixel[k] / FAR;
        if (bits >> f->pixel[k] & 1)
            return e->row[y + row - FAR / 2] + l->index[row][x + f->pixel[k] % FAR - FAR / 2];
    }
    return none;
}

/* For edgel i of row y, the middle one, where one of the 3x3 pixels does not go on. */
static void link_far_ends(linker *l, const edgels *e, uint32_t i, int y) {
    edgel a = e->item[i];
    neighbours *to = &l->to[i];
    unsigned bits = 0;
    for (int row = 0; row < FAR; row++)
        bits |= window(l->bits[row], a.x, FAR) << FAR * row;
    if (to->next == i)
        to->next = far_neighbour(l, e, &l->next_far[a.octant], bits, a.x, y, i);
    if (to->prev == i)
        to->prev = far_neighbour(l, e, &l->prev_far[a.octant], bits, a.x, y, i);
}

static void link_row(linker *l, const edgels *e, int y) {
    const uint8_t *up = l->bits[1], *mid = l->bits[2], *down = l->bits[3];
    uint32_t *ends = l->start, n_ends = 0, first[NEAR * NEAR];
    const uint16_t *index[NEAR * NEAR];
    if (e->row[y] == e->row[y + 1])
        return;
    for (int k = 0; k < NEAR * NEAR; k++) {
        first[k] = e->row[y + k / NEAR - 1];
        index[k] = l->index[LINK_REACH - 1 + k / NEAR] + k % NEAR - 1;
    }
    for (uint32_t i = e->row[y], n = e->row[y + 1]; i < n; i++) {
        unsigned x = e->item[i].x;
        unsigned bits =
            window(up, x, NEAR) | window(mid, x, NEAR) << 3 | window(down, x, NEAR) << 6;
        link_near to = l->near[e->item[i].octant][bits];
        l->to[i].next = first[to.next] + index[to.next][x];
        l->to[i].prev = first[to.prev] + index[to.prev][x];
        ends[n_ends] = i;
        n_ends += (to.next == MIDDLE) | (to.prev == MIDDLE);
    }
    for (uint32_t k = 0; k < n_ends; k++)
        link_far_ends(l, e, ends[k], y);
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
static uint32_t find_starts(linker *l, uint32_t n) {
    uint32_t found = 0;
    for (uint32_t i = 0; i < n; i++) {
        uint32_t prev = l->to[i].prev;
        l->start[found] = i;
        found += (prev == i) | (l->to[prev].next != i);
    }
    return found;
}

/* Walks one chain from edgel i on, and uses it up. */
static void walk(linker *l, const edgels *e, uint32_t i, bool closed, float high2,
                 uint32_t min_length, arris_edges *out) {
    arris_edge_point *point = out->point + out->n;
    uint32_t room = out->max - out->n, n = 0;
    float most = 0;
    for (bool more = true; more; n++) {
        arris_edge_point p = e->point[i];
        uint32_t next = l->to[i].next;
        float g2 = p.gx * p.gx + p.gy * p.gy;
        most = g2 > most ? g2 : most;
        if (n < room)
            point[n] = p;
        l->to[i].prev = DONE;
        more = l->to[next].prev == i; /* not so when next is i itself */
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

void link_chains(linker *l, const edgels *e, float high, uint32_t min_length, arris_edges *out) {
    uint32_t n = find_starts(l, e->n);
    for (uint32_t i = 0; i < n; i++)
        walk(l, e, l->start[i], false, high * high, min_length, out);
    for (uint32_t i = 0; i < e->n; i++)
        if (l->to[i].prev != DONE)
            walk(l, e, i, true, high * high, min_length, out);
}
