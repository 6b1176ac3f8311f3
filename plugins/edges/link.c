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

#if defined(__x86_64__)
#include <immintrin.h>
#endif

/* Edgels: on a line of the cache, how many are asked for ahead, and how many are near anyway. */
enum { LINE = 4, AHEAD = 16384, NEARBY = 32768 };

/* ---- the tables ----------------------------------------------------------------------------- */

/* Pixels around an edgel, 3x3 or 5x5, are numbered column by column. */
enum { NEAR = 3, FAR = 2 * LINK_REACH + 1, AROUND = NEAR * NEAR - 1 };

/* How badly the step to a pixel goes on in the direction (x, y): its length, then its turn. Length
 * comes first because it is the same seen from either end, so that both ends pick each other.
 * INFINITY for a pixel that is not ahead. */
static double step_cost(int pixel, int size, double x, double y, double least_cos) {
    int dx = pixel / size - size / 2, dy = pixel % size - size / 2;
    double d = hypot(dx, dy), along = d > 0 ? (dx * x + dy * y) / d : -1;
    return along > least_cos ? 2 * d * d - along : INFINITY;
}

/* The number in the 3x3 of the k-th of the pixels around the middle one. */
static int near_pixel(int k) {
    return k + (k >= AROUND / 2);
}

static uint8_t best_near(double x, double y, int bits) {
    uint8_t best = AROUND;
    double least = INFINITY;
    for (uint8_t k = 0; k < AROUND; k++) {
        double cost = step_cost(near_pixel(k), NEAR, x, y, 0);
        if (bits >> near_pixel(k) & 1 && cost < least)
            best = k, least = cost;
    }
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
    max += LINK_BLOCK;
    l->memory =
        calloc(1, 3 * max * sizeof *l->next + (LINK_KEPT + 1) * l->width * sizeof **l->index);
    if (!l->memory)
        return ARRIS_E_MEMORY;
    l->next = l->memory;
    l->prev = l->next + max;
    l->start = l->prev + max;
    for (size_t i = 0; i < LINK_KEPT; i++)
        l->index[i] = (uint16_t *)(l->start + max) + l->width * i;
    l->set = (uint8_t *)((uint16_t *)(l->start + max) + l->width * LINK_KEPT);
    l->fresh = l->set + l->width;
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
        index[a[i].x] = (uint16_t)i;
        fresh[a[i].x] = 1 << (LINK_KEPT - 2);
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

/* For edgel i of row y, the middle one, where none of the pixels around it goes on. */
INLINE uint32_t far_end(const linker *l, const edgels *e, uint32_t i, int y, const link_far *far,
                        enum path path) {
    edgel a = e->item[i];
    uint64_t bits; /* little-endian, as all our targets are */
    memcpy(&bits, l->set + a.x - LINK_REACH, sizeof bits);
    far += a.octant;
    int best = far->best[extract(bits, far->set, path)], column = best / 8, row = best % 8;
    return e->row[y + row - LINK_REACH] + l->index[row][a.x + column - LINK_REACH];
}

/* Where the k-th pixel around an edgel of row y is: the first edgel of its row, and how far its
 * place among the indices is from that of the edgel in the first row kept. */
typedef struct near_rows {
    uint32_t base[AROUND];
    int32_t leap[AROUND];
} near_rows;

static near_rows rows_near(const linker *l, const edgels *e, int y) {
    near_rows r;
    for (int k = 0; k < AROUND; k++) {
        int row = near_pixel(k) % NEAR - 1, column = near_pixel(k) / NEAR - 1;
        r.base[k] = e->row[y + row];
        r.leap[k] = (int32_t)(l->index[LINK_REACH + row] - l->index[0]) + column;
    }
    return r;
}

/* Links the edgels i .. end - 1 of a row, LINK_BLOCK at most, to the best of the pixels around
 * them. Sets the bits of those that have none. */
typedef void near_linker(linker *l, const edgels *e, const near_rows *r, uint32_t i, uint32_t end,
                         uint64_t *last, uint64_t *first);

static uint32_t near_end(const uint16_t *index, const near_rows *r, uint8_t pixel, uint32_t self) {
    return pixel < AROUND ? r->base[pixel] + index[r->leap[pixel]] : self;
}

static void link_near_portable(linker *l, const edgels *e, const near_rows *r, uint32_t i,
                               uint32_t end, uint64_t *last, uint64_t *first) {
    for (uint32_t k = 0; i < end; i++, k++) {
        edgel a = e->item[i];
        uint32_t set; /* little-endian, as all our targets are */
        memcpy(&set, l->set + a.x - 1, sizeof set);
        set = (set >> 1 & 7) | (set >> 6 & 7 << 3) | (set >> 11 & 7 << 6);
        link_near to = l->near[a.octant][set];
        l->next[i] = near_end(l->index[0] + a.x, r, to.next, i);
        l->prev[i] = near_end(l->index[0] + a.x, r, to.prev, i);
        *last |= (uint64_t)(to.next == AROUND) << k;
        *first |= (uint64_t)(to.prev == AROUND) << k;
    }
}

#if defined(__x86_64__)
/* The numbers i to i + 7. */
AVX2_PATH static inline __m256i eight_from(uint32_t i) {
    return _mm256_add_epi32(_mm256_set1_epi32((int)i), _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
}

AVX2_PATH static inline __m256i masked(__m256i v, int right, int mask) {
    return _mm256_and_si256(_mm256_srli_epi32(v, right), _mm256_set1_epi32(mask));
}

/* near_end of eight edgels in the columns x. */
AVX2_PATH static inline __m256i near_eight(const uint16_t *index, const near_rows *r, __m256i x,
                                           __m256i pixel, __m256i self) {
    __m256i base = _mm256_loadu_si256((const void *)r->base);
    __m256i leap = _mm256_loadu_si256((const void *)r->leap);
    __m256i at = _mm256_add_epi32(x, _mm256_permutevar8x32_epi32(leap, pixel));
    __m256i to = masked(_mm256_i32gather_epi32((const void *)index, at, 2), 0, UINT16_MAX);
    to = _mm256_add_epi32(to, _mm256_permutevar8x32_epi32(base, pixel));
    return _mm256_blendv_epi8(to, self, _mm256_cmpgt_epi32(pixel, _mm256_set1_epi32(AROUND - 1)));
}

/* Those of eight for which there is none. */
AVX2_PATH static inline uint64_t none_of_eight(__m256i pixel, __m256i in) {
    __m256i none = _mm256_cmpeq_epi32(pixel, _mm256_set1_epi32(AROUND));
    return (uint64_t)_mm256_movemask_ps(_mm256_castsi256_ps(_mm256_and_si256(none, in)));
}

AVX2_PATH static void link_near_avx2(linker *l, const edgels *e, const near_rows *r, uint32_t i,
                                     uint32_t end, uint64_t *last, uint64_t *first) {
    for (int k = 0; i < end; i += 8, k += 8) {
        __m256i self = eight_from(i), in = _mm256_cmpgt_epi32(_mm256_set1_epi32((int)end), self);
        __m256i item = _mm256_and_si256(_mm256_loadu_si256((const void *)(e->item + i)), in);
        __m256i x = masked(item, 0, UINT16_MAX), octant = masked(item, 16, LINK_OCTANTS - 1);
        __m256i set = _mm256_i32gather_epi32((const void *)(l->set - 1), x, 1);
        set =
            _mm256_or_si256(_mm256_or_si256(masked(set, 1, 7), masked(set, 6, 7 << 3)),
                            _mm256_or_si256(masked(set, 11, 7 << 6), _mm256_slli_epi32(octant, 9)));
        __m256i to = _mm256_i32gather_epi32((const void *)l->near, set, sizeof **l->near);
        __m256i next = masked(to, 0, UINT8_MAX), prev = masked(to, 8, UINT8_MAX);
        _mm256_storeu_si256((void *)(l->next + i), near_eight(l->index[0], r, x, next, self));
        _mm256_storeu_si256((void *)(l->prev + i), near_eight(l->index[0], r, x, prev, self));
        *last |= none_of_eight(next, in) << k;
        *first |= none_of_eight(prev, in) << k;
    }
}
#endif

INLINE void link_row(linker *l, const edgels *e, int y, near_linker *near, enum path path) {
    uint32_t i = e->row[y], end = e->row[y + 1];
    if (i == end)
        return;
    near_rows rows = rows_near(l, e, y);
    for (; i < end; i += LINK_BLOCK) {
        uint64_t last = 0, first = 0;
        near(l, e, &rows, i, end - i < LINK_BLOCK ? end : i + LINK_BLOCK, &last, &first);
        for (; last; last &= last - 1) {
            uint32_t k = i + (uint32_t)__builtin_ctzll(last);
            l->next[k] = far_end(l, e, k, y, l->next_far, path);
        }
        for (; first; first &= first - 1) {
            uint32_t k = i + (uint32_t)__builtin_ctzll(first);
            l->prev[k] = far_end(l, e, k, y, l->prev_far, path);
        }
    }
}

/* Keeps those links that both ends want. Returns which of the edgels from i on begin a chain. */
typedef uint64_t joiner(linker *l, uint32_t i);

static uint64_t join_portable(linker *l, uint32_t i) {
    uint64_t starts = 0;
    for (uint32_t k = 0; k < LINK_BLOCK; k++, i++) {
        uint32_t next = l->next[i], prev = l->prev[i];
        starts |= (uint64_t)((prev == i) | (l->next[prev] != i)) << k;
        l->next[i] = l->prev[next] == i ? next : i;
    }
    return starts;
}

#if defined(__x86_64__)
AVX2_PATH static uint64_t join_avx2(linker *l, uint32_t i) {
    uint64_t starts = 0;
    for (uint32_t k = 0; k < LINK_BLOCK; k += 8, i += 8) {
        __m256i self = eight_from(i);
        __m256i next = _mm256_loadu_si256((const void *)(l->next + i));
        __m256i prev = _mm256_loadu_si256((const void *)(l->prev + i));
        __m256i forth = _mm256_i32gather_epi32((const void *)l->next, prev, 4);
        __m256i back = _mm256_i32gather_epi32((const void *)l->prev, next, 4);
        __m256i goes_on =
            _mm256_andnot_si256(_mm256_cmpeq_epi32(prev, self), _mm256_cmpeq_epi32(forth, self));
        next = _mm256_blendv_epi8(self, next, _mm256_cmpeq_epi32(back, self));
        _mm256_storeu_si256((void *)(l->next + i), next);
        starts |= (uint64_t)(uint8_t)~_mm256_movemask_ps(_mm256_castsi256_ps(goes_on)) << k;
    }
    return starts;
}
#endif

/* Joins what goes on to each other, and lists where chains begin. */
INLINE void join_all(linker *l, uint32_t n, joiner *join) {
    l->n_starts = 0;
    for (uint32_t i = n; i % LINK_BLOCK; i++)
        l->next[i] = l->prev[i] = i;
    for (uint32_t i = 0; i < n; i += LINK_BLOCK) {
        uint64_t starts = join(l, i);
        if (n - i < LINK_BLOCK)
            starts &= (UINT64_C(1) << (n - i)) - 1;
        for (; starts; starts &= starts - 1)
            l->start[l->n_starts++] = i + (uint32_t)__builtin_ctzll(starts);
    }
}

/* The last rows of a picture have no edgels. */
INLINE void link_all(linker *l, const edgels *e, int height, near_linker *near, joiner *join,
                     enum path path) {
    const int behind = LINK_KEPT - LINK_REACH - 1;
    memset(l->set, 0, l->width);
    memset(l->fresh, 0, l->width);
    for (int y = 0; y < height; y++) {
        enter_row(l, e, y);
        if (y >= behind)
            link_row(l, e, y - behind, near, path);
    }
    join_all(l, e->n, join);
}

static void link_portable(linker *l, const edgels *e, int height) {
    link_all(l, e, height, link_near_portable, join_portable, PATH_VECTOR);
}

AVX2_PATH static void link_avx2(linker *l, const edgels *e, int height) {
#if defined(__x86_64__)
    link_all(l, e, height, link_near_avx2, join_avx2, PATH_AVX2);
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
        l->next[i] = i;
        more = next != i && next != first;
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
        if (l->next[i] != i)
            left -= walk(l, e, i, true, high * high, min_length, out);
}
