/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * clear.c: takes out of the sightings what lies beside their edges (record.h), as `reconstruct`
 * does of those that it keeps.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "record.h"

/* Whether the segment runs from q to p. */
static bool is_turned(const record *r, const sighting *o, const arris_line *l) {
    const arris_pose *pose = &r->frame[o->frame].at;
    double p[2], q[2];
    arris_project(&r->camera, pose, l->p, &p[0], &p[1]);
    arris_project(&r->camera, pose, l->q, &q[0], &q[1]);
    return (q[0] - p[0]) * (o->x2 - o->x1) + (q[1] - p[1]) * (o->y2 - o->y1) < 0;
}

static void list_views(const record *r, const arris_line *l, const uint32_t *of, uint32_t n,
                       beside_view *v) {
    for (uint32_t i = 0; i < n; i++) {
        const sighting *o = &r->item[of[i]];
        bool turned = is_turned(r, o, l);
        v[i] = (beside_view){
            (double)o->blur, {(double)o->beside[turned], (double)o->beside[!turned]}, true};
    }
}

/* The sightings of line l are of[first[l]] to of[first[l + 1] - 1], in their order. */
static void sort_by_line(const record *r, uint32_t lines, uint32_t *first, uint32_t *of) {
    memset(first, 0, (lines + (size_t)2) * sizeof *first);
    for (uint32_t i = 0; i < r->n; i++)
        if (r->item[i].line >= 0)
            first[r->item[i].line + 2]++;
    for (uint32_t l = 2; l < lines + 2; l++)
        first[l] += first[l - 1];
    for (uint32_t i = 0; i < r->n; i++)
        if (r->item[i].line >= 0)
            of[first[r->item[i].line + 1]++] = i;
}

/* The blur of the edges that nothing moves. */
static double usual_blur(const record *r, const arris_lines *lines, const uint32_t *first,
                         const uint32_t *of, beside_view *v) {
    double sum = 0, weights = 0, weight;
    for (uint32_t l = 0; l < lines->n; l++) {
        uint32_t n = first[l + 1] - first[l];
        list_views(r, &lines->item[l], of + first[l], n, v);
        double blur = beside_blur(v, n, &weight);
        if (lines->item[l].state == ARRIS_MEASURED)
            sum += weight * blur, weights += weight;
    }
    return weights > 0 ? sum / weights : 0;
}

static void clear_line(const record *r, const arris_line *l, double usual, const uint32_t *of,
                       uint32_t n, beside_view *v, beside_move *to, beside_move *move) {
    list_views(r, l, of, n, v);
    if (!beside_find(v, n, usual, to))
        return;
    for (uint32_t i = 0; i < n; i++) {
        move[of[i]] = to[i];
        if (is_turned(r, &r->item[of[i]], l))
            move[of[i]].px = -to[i].px;
    }
}

int record_clear(const record *r, const arris_lines *lines, beside_move *move) {
    uint32_t *first = malloc((lines->n + (size_t)2) * sizeof *first);
    uint32_t *of = malloc((r->n + (size_t)1) * sizeof *of);
    beside_view *v = malloc((r->n + (size_t)1) * sizeof *v);
    beside_move *to = malloc((r->n + (size_t)1) * sizeof *to);
    int rc = first && of && v && to ? 0 : ARRIS_E_MEMORY;
    memset(move, 0, r->n * sizeof *move);
    if (rc == 0) {
        sort_by_line(r, lines->n, first, of);
        double usual = usual_blur(r, lines, first, of, v);
        for (uint32_t l = 0; l < lines->n; l++)
            clear_line(r, &lines->item[l], usual, of + first[l], first[l + 1] - first[l], v, to,
                       move);
    }
    free(first);
    free(of);
    free(v);
    free(to);
    return rc;
}
