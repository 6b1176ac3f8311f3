/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * split.c: chains to straight pieces (split.h).
 */
#include "split.h"

#include "lanes.h"

#include <math.h>
#include <string.h>

enum { FOUR = 4 };

typedef int32_t four_ints __attribute__((vector_size(4 * FOUR)));

/* A line from the point (x, y) to one that is (dx, dy) away. */
typedef struct chord {
    float x, y, dx, dy;
} chord;

/* The greatest distance of the points between a and b from the chord, times the chord's length; *at
 * is the first where. Four points are taken at a time, and each lane remembers its own greatest. */
INLINE float farthest(const arris_edge_point *p, uint32_t a, uint32_t b, chord c, uint32_t *at) {
    four most = {0};
    four_ints where = {0}, index = {0, 1, 2, 3};
    uint32_t i = a + 1;
    float best = 0;
    for (index += (int32_t)i; i + FOUR <= b; i += FOUR, index += FOUR) {
        four r[FOUR];
        for (int k = 0; k < FOUR; k++)
            memcpy(&r[k], &p[i + k], sizeof r[k]);
        four first = __builtin_shufflevector(r[0], r[1], 0, 4, 1, 5);
        four second = __builtin_shufflevector(r[2], r[3], 0, 4, 1, 5);
        four x = __builtin_shufflevector(first, second, 0, 1, 4, 5);
        four y = __builtin_shufflevector(first, second, 2, 3, 6, 7);
        four d = (x - c.x) * c.dy - (y - c.y) * c.dx;
        d = (four)((four_ints)d & INT32_MAX);
        four_ints more = d > most;
        most = (four)(((four_ints)d & more) | ((four_ints)most & ~more));
        where = (index & more) | (where & ~more);
    }
    for (int k = 0; k < FOUR; k++)
        if (most[k] > best || (most[k] == best && (uint32_t)where[k] < *at))
            best = most[k], *at = (uint32_t)where[k];
    for (; i < b; i++) {
        float d = fabsf((p[i].x - c.x) * c.dy - (p[i].y - c.y) * c.dx);
        if (d > best)
            best = d, *at = i;
    }
    return best;
}

/* Whether a point between a and b is farther than `tol` from the line through these two, or from a
 * when they are less than 1 px apart (a closed chain); *at is where it is farthest. */
INLINE bool strays(const arris_edge_point *p, uint32_t a, uint32_t b, float tol, uint32_t *at) {
    chord c = {p[a].x, p[a].y, p[b].x - p[a].x, p[b].y - p[a].y};
    float square = c.dx * c.dx + c.dy * c.dy, most = 0;
    *at = a;
    if (square >= 1) {
        most = farthest(p, a, b, c, at);
        return most * most > tol * tol * square;
    }
    for (uint32_t i = a + 1; i < b; i++) {
        float ex = p[i].x - c.x, ey = p[i].y - c.y, d = ex * ex + ey * ey;
        if (d > most)
            most = d, *at = i;
    }
    return most > tol * tol;
}

/* The found corners grow from the front of `corner`, the ends still to be reached from its back;
 * together they are never more than the points. */
INLINE uint32_t split(const arris_edge_point *p, uint32_t n, double tol, bool greedy,
                      uint32_t *corner) {
    uint32_t found = 0, top = n - 1, at;
    corner[found++] = 0;
    corner[top] = n - 1;
    while (top < n) {
        uint32_t first = corner[found - 1], last = corner[top];
        if (strays(p, first, last, (float)tol, &at)) {
            corner[--top] = at;
        } else {
            corner[found++] = last;
            top = greedy && last < n - 1 ? (corner[n - 1] = n - 1) : top + 1;
        }
    }
    return found;
}

static uint32_t split_portable(const arris_edge_point *p, uint32_t n, double tol, bool greedy,
                               uint32_t *corner) {
    return split(p, n, tol, greedy, corner);
}

AVX2_PATH static uint32_t split_avx2(const arris_edge_point *p, uint32_t n, double tol, bool greedy,
                                     uint32_t *corner) {
    return split(p, n, tol, greedy, corner);
}

uint32_t split_chain(const arris_edge_point *p, uint32_t n, double tol, bool greedy,
                     uint32_t *corner) {
    return (HAS_AVX2 ? split_avx2 : split_portable)(p, n, tol, greedy, corner);
}
