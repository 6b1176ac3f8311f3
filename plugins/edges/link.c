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

/* Edgels: on a line of the cache, how many are asked for ahead, and how many are near anyway. */
enum { LINE = 4, AHEAD = 16384, NEARBY = 32768 };

/* ---- the tables ----------------------------------------------------------------------------- */

enum { NEAR = 3, FAR = 2 * LINK_REACH + 1 };

/* How badly the step to a pixel goes on in the direction (x, y): its length, then its turn. Length
 * comes first because it is the same seen from either end, so that both ends pick each other.
 * INFINITY for a pixel that is not ahead. */
static double step_cost(int pixel, double x, double y, double least_cos) {
    int dx = pixel / 8 - LINK_REACH, dy = pixel % 8 - LINK_REACH;
    double d = hypot(dx, dy), along = d > 0 ? (dx * x + dy * y) / d : -1;
    return along > least_cos ? 2 * d * d - along : INFINITY;
}

/* Of the 3x3 pixels whose bits are set, column by column; 0: none. */
static int best_near(double x, double y, int bits) {
    int best = 0;
    double least = INFINITY;
    for (int k = 0; k < NEAR * NEAR; k++) {
        int pixel = LINK_MIDDLE + 8 * (k / NEAR - 1) + k % NEAR - 1;
        double cost = step_cost(pixel, x, y, 0);
        if (bits >> k & 1 && cost < least)
            best = pixel, least = cost;
    }
    return best;
}

static link_pixels both_near(double x, double y, int bits) {
    int next = best_near(x, y, bits), prev = best_near(-x, -y, bits);
    int last = next ? 0 : LINK_LAST | LINK_OPEN;
    int first = prev ? 0 : LINK_FIRST | LINK_OPEN;
    return (link_pixels)(next | prev << 8 | last | first);
}

/* The pixels that are two away and within 60 degrees of the direction. */
static link_far sort_far(double x, double y, uint8_t none) {
    link_far f = {.set = 0};
    int pixel[LINK_FAR], n = 0;
    for (int i = 0; i < 8 * FAR; i++)
        if (i % 8 < FAR && step_cost(i, x, y, 0.5) < INFINITY &&
            (abs(i % 8 - LINK_REACH) == 2 || abs(i / 8 - LINK_REACH) == 2))
            pixel[n++] = i;
    for (int k = 0; k < LINK_FAR; k++)
        f.set |= UINT64_C(1) << pixel[k];
    for (int bits = 0; bits < 1 << LINK_FAR; bits++) {
        double least = INFINITY;
        f.best[bits] = none;
        for (int k = 0; k < LINK_FAR; k++) {
            double cost = step_cost(pixel[k], x, y, 0.5);
            if (bits >> k & 1 && cost < least)
                f.best[bits] = (uint8_t)pixel[k], least = cost;
        }
    }
    return f;
}

static void set_tables(linker *l) {
    double most = cos(M_PI / 8), least = sin(M_PI / 8); /* the middle of an octant */
    for (int k = 0; k < LINK_OCTANTS; k++) {
        double gx = (k & 4 ? most : least) * (k & 2 ? -1 : 1);
        double gy = (k & 4 ? least : most) * (k & 1 ? -1 : 1);
        for (int bits = 0; bits < 1 << NEAR * NEAR; bits++)
            l->near[k][bits] = both_near(gy, -gx, bits);
        l->next_far[k] = sort_far(gy, -gx, LINK_LAST);
        l->prev_far[k] = sort_far(-gy, gx, LINK_MIDDLE);
    }
}

int link_init(linker *l, int width, size_t max) {
    *l = (linker){.width = ((size_t)width / 64 + 2) * 64, .end = (uint32_t)max};
    set_tables(l);
    max++;
    l->memory = calloc(1, max * (2 * sizeof *l->next + sizeof *l->pixels) +
                              l->width * (LINK_KEPT * sizeof **l->index + 2));
    if (!l->memory)
        return ARRIS_E_MEMORY;
    l->next = l->memory;
    l->start = l->next + max;
    l->pixels = (link_pixels *)(l->start + max);
    for (size_t i = 0; i < LINK_KEPT; i++)
        l->index[i] = (uint16_t *)(l->pixels + max) + i * l->width;
    l->set = (uint8_t *)(l->index[0] + LINK_KEPT * l->width);
    l->fresh = l->set + l->width;
    for (uint32_t i = 0; i < l->end; i++)
        l->next[i] = l->end;
    return 0;
}

void link_free(linker *l) {
    free(l->memory);
    *l = (linker){0};
}

/* ---- neighbours ----------------------------------------------------------------------------- */

/* Takes up row y, and gives up the oldest one. Its edgels are marked in `fresh` first, and the row
 * is in `set` when the next one is taken up: bytes that are read as words must have been stored
 * long before. */
INLINE void enter_row(linker *l, const edgels *e, int y) {
    uint16_t *index = l->index[0];
    uint8_t *set = l->set, *fresh = l->fresh;
    const edgel *a = e->item + e->row[y];
    for (int k = 0; k < LINK_KEPT - 1; k++)
        l->index[k] = l->index[k + 1];
    l->index[LINK_KEPT - 1] = index;
    for (size_t x = 0, width = l->width; x < width; x++) {
        set[x] = (uint8_t)(set[x] >> 1 | fresh[x]);
        fresh[x] = 0;
    }
    for (uint32_t i = 0, n = e->row[y + 1] - e->row[y]; i < n; i++) {
        uint16_t x = a[i].x;
        index[x] = (uint16_t)i;
        fresh[x] = 1 << (FAR - 1);
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

/* Those of the 3x3 pixels around an edgel in column x that are edgels. */
INLINE unsigned near_set(const linker *l, int x, enum path path) {
    uint32_t w; /* little-endian, as all our targets are */
    memcpy(&w, l->set + x - 1, sizeof w);
    return path == PATH_AVX2 ? extract(w, 0x0E0E0E, path)
                             : (w >> 1 & 7) | (w >> 6 & 7 << 3) | (w >> 11 & 7 << 6);
}

/* Finds what goes on farther away where none of the pixels around an edgel does. */
INLINE link_pixels look_far(const linker *l, edgel a, link_pixels near, enum path path) {
    const link_far *next = &l->next_far[a.octant], *prev = &l->prev_far[a.octant];
    uint64_t bits;
    memcpy(&bits, l->set + a.x - LINK_REACH, sizeof bits);
    int after = next->best[extract(bits, next->set, path)];
    int before = prev->best[extract(bits, prev->set, path)];
    after &= -(near / LINK_LAST & 1); /* a condition would be a branch, which cannot be foreseen */
    before &= -(near / LINK_FIRST & 1);
    return (link_pixels)(after | before << 8 | (near & (LINK_PIXEL | LINK_PIXEL << 8)));
}

/* Finds which pixels go on to the edgels of row y. Those where it must look farther are listed
 * first, beyond the starts: which they are cannot be foreseen, and would be waited for. */
INLINE void find_row(linker *l, const edgels *e, int y, enum path path) {
    const edgel *item = e->item;
    link_pixels *pixels = l->pixels;
    uint32_t *open = l->start + l->n_starts, n = 0;
    for (uint32_t i = e->row[y], end = e->row[y + 1]; i < end; i++) {
        link_pixels near = l->near[item[i].octant][near_set(l, item[i].x, path)];
        pixels[i] = near;
        open[n] = i;
        n += near / LINK_OPEN;
    }
    for (uint32_t k = 0; k < n; k++)
        pixels[open[k]] = look_far(l, item[open[k]], pixels[open[k]], path);
}

/* Joins the edgels of row y to those before them, where both pick each other; the others begin a
 * chain. */
INLINE void join_row(linker *l, const edgels *e, int y) {
    const uint16_t *index[FAR];
    const edgel *item = e->item;
    const link_pixels *pixels = l->pixels;
    uint32_t *next = l->next, *start = l->start + l->n_starts, base[FAR];
    for (int k = 0; k < FAR; k++) {
        index[k] = l->index[k] - LINK_REACH;
        base[k] = e->row[y + k - LINK_REACH];
    }
    for (uint32_t i = e->row[y], end = e->row[y + 1]; i < end; i++) {
        int pixel = pixels[i] >> 8, row = pixel % 8, column = pixel / 8;
        uint32_t prev = base[row] + index[row][item[i].x + column];
        if (__builtin_expect((pixels[prev] & UINT8_MAX) + pixel == 2 * LINK_MIDDLE, 1))
            next[prev] = i;
        else
            *start++ = i;
    }
    l->n_starts = (uint32_t)(start - l->start);
}

/* A row is looked at when those around it are in `set`, and joined when these have been. The first
 * and the last rows of a picture, within the gradient's reach, have no edgels. */
INLINE void link_all(linker *l, const edgels *e, int height, enum path path) {
    const int found = LINK_REACH + 1, joined = found + LINK_REACH;
    memset(l->set, 0, l->width);
    memset(l->fresh, 0, l->width);
    l->n_starts = 0;
    for (int y = 0; y < height + EDGELS_AFTER - 1; y++) {
        if (e->row[y + 1] == e->row[y < LINK_KEPT ? 0 : y - LINK_KEPT])
            continue;
        enter_row(l, e, y);
        if (y < joined + LINK_REACH)
            continue;
        find_row(l, e, y - found, path);
        join_row(l, e, y - joined);
    }
}

static void link_portable(linker *l, const edgels *e, int height) {
    link_all(l, e, height, PATH_VECTOR);
}

AVX2_PATH static void link_avx2(linker *l, const edgels *e, int height) {
#if defined(__x86_64__)
    link_all(l, e, height, PATH_AVX2);
#else
    link_portable(l, e, height);
#endif
}

void link_edgels(linker *l, const edgels *e, int height, enum path path) {
    (path == PATH_AVX2 ? link_avx2 : link_portable)(l, e, height);
}

/* ---- chains --------------------------------------------------------------------------------- */

/* Walks one chain from edgel `first` on, and uses it up. Returns how many edgels it has. */
static uint32_t walk(linker *l, const edgels *e, uint32_t first, bool closed, float high2,
                     uint32_t min_length, arris_edges *out) {
    arris_edge_point *point = out->point + out->n;
    uint32_t room = out->max - out->n, n = 0, i = first, next;
    float most = 0;
    for (bool more = true; more; n++, i = next) {
        arris_edge_point p = e->point[i];
        float g2 = p.gx * p.gx + p.gy * p.gy;
        most = g2 > most ? g2 : most;
        if (n < room)
            point[n] = p;
        next = l->next[i];
        l->next[i] = l->end;
        more = next != l->end && next != first;
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
        __builtin_prefetch(&l->next[*ready]);
    }
}

void link_chains(linker *l, const edgels *e, float high, uint32_t min_length, arris_edges *out) {
    uint32_t left = e->n, ready = e->n > NEARBY ? 0 : e->n;
    for (uint32_t k = 0; k < l->n_starts; k++) {
        prepare(l, e, l->start[k], &ready);
        left -= walk(l, e, l->start[k], false, high * high, min_length, out);
    }
    for (uint32_t i = 0; left > 0; i++)
        if (l->next[i] != l->end)
            left -= walk(l, e, i, true, high * high, min_length, out);
}
