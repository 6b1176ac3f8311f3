/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * index.c: a grid of square cells over the picture (index.h). A segment stands in the cells of
 * points along it. The grid repeats itself, so that it has no border: what is far away may be taken
 * for near, which costs a look.
 */
#include "index.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define CELL 32.0 /* px */
#define FAR 1e6   /* px: no coordinate is beyond */

enum {
    SIDE = 64,
    PLACES = 16 /* on average, of a segment */,
    MOST_PLACES = 512,
    FARTHEST = 3 /* cells */
};

typedef struct place {
    uint32_t segment, next; /* next: counted from 1; 0: the last one */
} place;

struct segment_index {
    size_t max, n_places;
    place *place;
    uint32_t head[SIDE][SIDE], crowd; /* crowd: the segments that found no room, in every cell */
    uint32_t *seen, turn;             /* by segment: the look that it was last found in */
    uint32_t *found;
};

segment_index *index_new(size_t max) {
    segment_index *x = calloc(1, sizeof *x);
    if (!x)
        return NULL;
    x->max = max;
    x->place = calloc(max * (PLACES + 1), sizeof *x->place);
    x->seen = calloc(max, sizeof *x->seen);
    x->found = calloc(max, sizeof *x->found);
    if (x->place && x->seen && x->found)
        return x;
    index_free(x);
    return NULL;
}

void index_free(segment_index *x) {
    if (!x)
        return;
    free(x->place);
    free(x->seen);
    free(x->found);
    free(x);
}

static bool usable(const arris_segment *s) {
    return fabs(s->x1) < FAR && fabs(s->y1) < FAR && fabs(s->x2) < FAR && fabs(s->y2) < FAR &&
           (s->x1 != s->x2 || s->y1 != s->y2);
}

static void enter(segment_index *x, uint32_t *head, uint32_t segment) {
    if (*head > 0 && x->place[*head - 1].segment == segment)
        return;
    x->place[x->n_places++] = (place){segment, *head};
    *head = (uint32_t)x->n_places;
}

static uint32_t *cell(segment_index *x, int column, int row) {
    return &x->head[row & (SIDE - 1)][column & (SIDE - 1)];
}

/* Steps of `pitch` px that lead along s, but not too many. */
static int steps(const arris_segment *s, double pitch) {
    return 1 + (int)fmin(hypot(s->x2 - s->x1, s->y2 - s->y1) / pitch, MOST_PLACES);
}

void index_fill(segment_index *x, const arris_segment *s, uint32_t n) {
    memset(x->head, 0, sizeof x->head);
    x->crowd = 0;
    x->n_places = 0;
    for (uint32_t i = 0; i < n && i < x->max; i++) {
        x->seen[i] = 0;
        if (!usable(&s[i]))
            continue;
        int m = steps(&s[i], CELL / 2);
        if (x->n_places + (size_t)m + 1 > x->max * PLACES) {
            enter(x, &x->crowd, i);
            continue;
        }
        double dx = (s[i].x2 - s[i].x1) / m, dy = (s[i].y2 - s[i].y1) / m;
        for (int k = 0; k <= m; k++)
            enter(x,
                  cell(x, (int)floor((s[i].x1 + k * dx) / CELL),
                       (int)floor((s[i].y1 + k * dy) / CELL)),
                  i);
    }
    x->turn = 0;
}

static uint32_t collect(segment_index *x, uint32_t head, uint32_t n) {
    for (; head > 0; head = x->place[head - 1].next) {
        uint32_t i = x->place[head - 1].segment;
        if (x->seen[i] == x->turn)
            continue;
        x->seen[i] = x->turn;
        x->found[n++] = i;
    }
    return n;
}

const uint32_t *index_near(segment_index *x, const arris_segment *where, double reach,
                           uint32_t *n) {
    x->turn++;
    *n = collect(x, x->crowd, 0);
    if (!usable(where))
        return x->found;
    /* points are entered every half cell and looked for every cell: the nearest two of them are
     * within 3/4 of a cell of the nearest two places */
    int m = steps(where, CELL), r = (int)ceil(fmin((reach + 0.75 * CELL) / CELL, FARTHEST));
    double dx = (where->x2 - where->x1) / m, dy = (where->y2 - where->y1) / m;
    for (int k = 0; k <= m; k++) {
        int column = (int)floor((where->x1 + k * dx) / CELL);
        int row = (int)floor((where->y1 + k * dy) / CELL);
        for (int i = -r; i <= r; i++)
            for (int j = -r; j <= r; j++)
                *n = collect(x, *cell(x, column + j, row + i), *n);
    }
    return x->found;
}
