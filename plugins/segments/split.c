/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * split.c: chains to straight pieces (split.h).
 */
#include "split.h"

#include <math.h>

/* The greatest distance of the points between a and b from the line through these two, or from a
 * when they are less than 1 px apart (a closed chain); *at is where. */
static float deviation(const arris_edge_point *p, uint32_t a, uint32_t b, uint32_t *at) {
    float x = p[a].x, y = p[a].y, dx = p[b].x - x, dy = p[b].y - y, most = 0;
    float length = sqrtf(dx * dx + dy * dy);
    *at = a;
    if (length < 1) {
        for (uint32_t i = a + 1; i < b; i++) {
            float ex = p[i].x - x, ey = p[i].y - y, d = ex * ex + ey * ey;
            if (d > most)
                most = d, *at = i;
        }
        return sqrtf(most);
    }
    dx /= length, dy /= length;
    for (uint32_t i = a + 1; i < b; i++) {
        float d = fabsf((p[i].x - x) * dy - (p[i].y - y) * dx);
        if (d > most)
            most = d, *at = i;
    }
    return most;
}

/* The found corners grow from the front of `corner`, the ends still to be reached from its back;
 * together they are never more than the points. */
uint32_t split_chain(const arris_edge_point *p, uint32_t n, double tol, bool greedy,
                     uint32_t *corner) {
    uint32_t found = 0, top = n - 1, at;
    corner[found++] = 0;
    corner[top] = n - 1;
    while (top < n) {
        uint32_t first = corner[found - 1], last = corner[top];
        if (deviation(p, first, last, &at) > (float)tol) {
            corner[--top] = at;
        } else {
            corner[found++] = last;
            top = greedy && last < n - 1 ? (corner[n - 1] = n - 1) : top + 1;
        }
    }
    return found;
}
