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

/* Edgels: on a line of the cache, how many are asked for ahead, and how many are near anyway. */
enum { LINE = 4, AHEAD = 16384, NEARBY = 32768 };

/* ---- the tables ----------------------------------------------------------------------------- */

/* Pixels around an edgel, 3x3 or 5x5, are numbered column by column. */
enum { NEAR = 3, FAR = LINK_ROWS, MIDDLE = NEAR * NEAR / 2 };

/* How badly the step to a pixel goes on in the direction (x, y): its length, then its turn. Length
 * comes first because it is the same seen from either end, so that both ends pick each other.
 * INFINITY for a pixel that is not ahead. */
static double step_cost(int pixel, int size, double x, double y, double least_cos) {
    int dx = pixel / size - size / 2, dy = pixel % size - size / 2;
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
    link_far f = {.set = 0};
    int pixel[LINK_FAR], n = 0;
    for (int i = 0; i < FAR * FAR; i++)
        if (step_cost(i, FAR, x, y, 0.5) < INFINITY &&
            (abs(i % FAR - FAR / 2) == 2 || abs(i / FAR - FAR / 2) == 2))
            pixel[n++] = i;
    for (int k = 0; k < LINK_FAR; k++)
        f.set |= UINT64_C(1) << (8 * (pixel[k] / FAR) + pixel[k] % FAR);
    for (int bits = 0; bits < 1 << LINK_FAR; bits++) {
        int best = FAR * FAR / 2;
        for (int k = 0; k < LINK_FAR; k++)
            if (bits >> k & 1 &&
                step_cost(pixel[k], FAR, x, y, 0.5) < step_cost(best, FAR, x, y, 0.5))
                best = pixel[k];
        f.best[bits] = (uint8_t)(8 * (best / FAR) + best % FAR);
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
    if (max < 2 * l->width) /* for link_row */
        max = 2 * l->width;
    size_t links = max * sizeof *l->to, starts = max * sizeof *l->start;
    l->memory =
        malloc(links + starts + LINK_KEPT * l->width * (sizeof **l->index + sizeof **l->set));
    if (!l->memory)
        return ARRIS_E_MEMORY;
    l->to = l->memory;
    l->start = (uint32_t *)(l->to + max);
    for (size_t i = 0; i < LINK_KEPT; i++) {
        l->index[i] = (uint16_t *)(l->start + max) + l->width * i;
        l->set[i] = (uint8_t *)((uint16_t *)(l->start + max) + l->width * LINK_KEPT) + l->width * i;
    }
    return 0;
}

void link_free(linker *l) {
    free(l->memory);
    *l = (linker){0};
}

/* ---- neighbours ----------------------------------------------------------------------------- */

/* Takes up row y, and gives up the oldest one. */
static void enter_row(linker *l, const edgels *e, int y) {
    uint16_t *index = l->index[0];
    uint8_t *set = l->set[0];
    const edgel *a = e->item + e->row[y];
    for (int k = 0; k < LINK_KEPT - 1; k++) {
        l->index[k] = l->index[k + 1];
        l->set[k] = l->set[k + 1];
    }
    l->index[LINK_KEPT - 1] = index;
    l->set[LINK_KEPT - 1] = memset(set, 0, l->width);
    for (uint32_t i = 0, n = e->row[y + 1] - e->row[y]; i < n; i++) {
        index[a[i].x] = (uint16_t)i;
        set[a[i].x] = 1;
    }
}

/* Those of the bits that are in `set`, side by side. Every machine with AVX2 that path_available
 * lets through has an instruction for it. */
INLINE unsigned extract(uint64_t bits, uint64_t set, enum path path) {
#if defined(__x86_64__)
    if (path == PATH_AVX2) {
        uint64_t found;
        __asm__("pext %2, %1, %0" : "=r"(found) : "r"(bits), "r"(set));
        return (unsigned)found;
    }
#endif
    (void)path;
    unsigned found = 0;
    for (int k = 0; set; set &= set - 1, k++)
        found |= (unsigned)(bits >> __builtin_ctzll(set) & 1) << k;
    return found;
}

/* For edgel i of row y, the middle one, where none of the 3x3 pixels goes on. */
INLINE uint32_t link_far_end(const linker *l, const edgels *e, uint32_t i, int y,
                             const link_far *far, enum path path) {
    edgel a = e->item[i];
    uint64_t bits = 0;
    for (int row = 0; row < FAR; row++) {
        uint64_t set;
        memcpy(&set, l->set[row] + a.x - LINK_REACH, sizeof set);
        bits |= set << row;
    }
    far += a.octant;
    int best = far->best[extract(bits, far->set, path)], column = best / 8, row = best % 8;
    return e->row[y + row - LINK_REACH] + l->index[row][a.x + column - LINK_REACH];
}

/* The 3x3 pixels in the columns from x on. Little-endian, as all our targets are. */
INLINE unsigned near_bits(const uint8_t *up, const uint8_t *mid, const uint8_t *down, unsigned x,
                          enum path path) {
    uint32_t a, b, c;
    memcpy(&a, up + x, sizeof a);
    memcpy(&b, mid + x, sizeof b);
    memcpy(&c, down + x, sizeof c);
    a |= b << 1 | c << 2;
    if (path == PATH_AVX2)
        return extract(a, 0x070707, path);
    return (a & 7) | (a >> 5 & 7 << 3) | (a >> 10 & 7 << 6);
}

INLINE void link_row(linker *l, const edgels *e, int y, enum path path) {
    const uint8_t *up = l->set[1], *mid = l->set[2], *down = l->set[3];
    uint32_t *last = l->start, *first = l->start + l->width, n_last = 0, n_first = 0;
    uint32_t base[NEAR * NEAR];
    const uint16_t *index[NEAR * NEAR];
    if (e->row[y] == e->row[y + 1])
        return;
    for (int k = 0; k < NEAR * NEAR; k++) {
        base[k] = e->row[y + k % NEAR - 1];
        index[k] = l->index[LINK_REACH - 1 + k % NEAR] + k / NEAR - 1;
    }
    for (uint32_t i = e->row[y], n = e->row[y + 1]; i < n; i++) {
        unsigned x = e->item[i].x;
        link_near to = l->near[e->item[i].octant][near_bits(up, mid, down, x - 1, path)];
        l->to[i].next = base[to.next] + index[to.next][x];
        l->to[i].prev = base[to.prev] + index[to.prev][x];
        last[n_last] = i;
        n_last += to.next == MIDDLE;
        first[n_first] = i;
        n_first += to.prev == MIDDLE;
    }
    for (uint32_t k = 0; k < n_last; k++)
        l->to[last[k]].next = link_far_end(l, e, last[k], y, l->next_far, path);
    for (uint32_t k = 0; k < n_first; k++)
        l->to[first[k]].prev = link_far_end(l, e, first[k], y, l->prev_far, path);
}

/* A row is taken up one before its bytes are read, so that they are sure to be stored by then. */
INLINE void link_rows(linker *l, const edgels *e, int height, enum path path) {
    for (int k = 0; k < LINK_KEPT; k++)
        memset(l->set[k], 0, l->width);
    for (int y = 0; y < height; y++) {
        enter_row(l, e, y);
        if (y >= LINK_KEPT - LINK_REACH - 1)
            link_row(l, e, y - (LINK_KEPT - LINK_REACH - 1), path);
    }
}

static void link_portable(linker *l, const edgels *e, int height) {
    link_rows(l, e, height, PATH_VECTOR);
}

AVX2_PATH static void link_avx2(linker *l, const edgels *e, int height) {
    link_rows(l, e, height, PATH_AVX2);
}

void link_edgels(linker *l, const edgels *e, int height, enum path path) {
    (path == PATH_AVX2 ? link_avx2 : link_portable)(l, e, height);
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

/* Walks one chain from edgel i on, and uses it up. Returns how many edgels it has. */
static uint32_t walk(linker *l, const edgels *e, uint32_t i, bool closed, float high2,
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
        return n;
    uint32_t kept = n < room ? n : room;
    out->lost += n - kept;
    if (out->n_chains == out->max_chains || kept < min_length) {
        out->lost_chains++;
        out->lost += kept;
        return n;
    }
    out->chain[out->n_chains++] = (arris_chain){out->n, kept, closed && kept == n};
    out->n += kept;
    return n;
}

/* Asks for what chains from edgel i on will need: they leap from row to row, and where there is too
 * much of it for the near caches, each leap would wait. */
static void prepare(const linker *l, const edgels *e, uint32_t i, uint32_t *ready) {
    uint32_t end = i + AHEAD < e->n ? i + AHEAD : e->n;
    for (; *ready < end; *ready += LINE) {
        __builtin_prefetch(&e->point[*ready]);
        __builtin_prefetch(&l->to[*ready]);
    }
}

void link_chains(linker *l, const edgels *e, float high, uint32_t min_length, arris_edges *out) {
    uint32_t n = find_starts(l, e->n), left = e->n, ready = e->n > NEARBY ? 0 : e->n;
    for (uint32_t i = 0; i < n; i++) {
        prepare(l, e, l->start[i], &ready);
        left -= walk(l, e, l->start[i], false, high * high, min_length, out);
    }
    for (uint32_t i = 0; left > 0; i++)
        if (l->to[i].prev != DONE)
            left -= walk(l, e, i, true, high * high, min_length, out);
}
