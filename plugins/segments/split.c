/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * split.c: chains to straight pieces (split.h).
 */
#include "split.h"

#include "lanes.h"

#include <math.h>
#include <string.h>

/* A line from the point (x, y) to one that is (dx, dy) away. */
typedef struct chord {
    float x, y, dx, dy;
} chord;

/* Of each lane the greatest distance so far, times the chord's length, and where it was. */
typedef struct greatest {
    eight most;
    eight_ints where;
} greatest;

/* Looks at the points i .. i + LANES - 1, in some order. */
INLINE void look(const arris_edge_point *p, uint32_t i, const chord *c, greatest *g) {
    const eight_ints order = {0, 2, 4, 6, 1, 3, 5, 7};
    eight r[4], xy[2];
    for (int k = 0; k < 4; k++)
        eight_load(&p[i + 2 * k], &r[k]);
    for (int k = 0; k < 2; k++)
        xy[k] = __builtin_shufflevector(r[2 * k], r[2 * k + 1], 0, 1, 8, 9, 4, 5, 12, 13);
    eight x = __builtin_shufflevector(xy[0], xy[1], 0, 2, 8, 10, 4, 6, 12, 14);
    eight y = __builtin_shufflevector(xy[0], xy[1], 1, 3, 9, 11, 5, 7, 13, 15);
    eight d = EIGHT_ABS((x - c->x) * c->dy - (y - c->y) * c->dx);
    eight_ints more = d > g->most, index = order + (int32_t)i;
    g->most = EIGHT_CHOOSE(more, d, g->most);
    g->where = (index & more) | (g->where & ~more);
}

/* The greatest distance of the points between a and b from the chord, times the chord's length; *at
 * is the first where. */
INLINE float farthest(const arris_edge_point *p, uint32_t a, uint32_t b, chord c, uint32_t *at) {
    uint32_t i = a + 1;
    float best = 0;
    if (i + LANES <= b) {
        greatest g = {{0}, {0}};
        for (; i + LANES <= b; i += LANES)
            look(p, i, &c, &g);
        if (i < b) /* some of them again */
            look(p, b - LANES, &c, &g);
        i = b;
        for (int k = 0; k < LANES; k++)
            if (g.most[k] > best || (g.most[k] == best && (uint32_t)g.where[k] < *at))
                best = g.most[k], *at = (uint32_t)g.where[k];
    }
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
