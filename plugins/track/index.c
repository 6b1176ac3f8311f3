/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * index.c: the picture in bands, upright and level (index.h). Each has a set of the segments that
 * reach into it, a bit a segment: what is near a place is in one of its upright bands and in one of
 * its level ones. The bands repeat themselves, so that there is no border: what is far away may be
 * taken for near, which costs a look.
 */
#include "index.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define BAND 16.0 /* px */
#define FAR 1e6   /* px: no coordinate is beyond */

enum { BANDS = 128, WORD = 64 };

struct segment_index {
    size_t max, words; /* words: of a set */
    uint64_t *set[2];  /* by band: upright, level */
    uint32_t *found;
};

segment_index *index_new(size_t max) {
    segment_index *x = calloc(1, sizeof *x);
    if (!x)
        return NULL;
    size_t words = max / WORD + 1;
    x->max = max;
    x->set[0] = calloc(BANDS * words, sizeof *x->set[0]);
    x->set[1] = calloc(BANDS * words, sizeof *x->set[1]);
    x->found = calloc(max, sizeof *x->found);
    if (x->set[0] && x->set[1] && x->found)
        return x;
    index_free(x);
    return NULL;
}

void index_free(segment_index *x) {
    if (!x)
        return;
    free(x->set[0]);
    free(x->set[1]);
    free(x->found);
    free(x);
}

static bool usable(const arris_segment *s) {
    return fabs(s->x1) < FAR && fabs(s->y1) < FAR && fabs(s->x2) < FAR && fabs(s->y2) < FAR &&
           (s->x1 != s->x2 || s->y1 != s->y2);
}

/* The bands from a to b, `margin` px around them included; *n is how many. */
static int bands(double a, double b, double margin, int *n) {
    double least = a < b ? a : b, most = a < b ? b : a;
    int first = (int)floor((least - margin) / BAND), last = (int)floor((most + margin) / BAND);
    *n = last - first < BANDS ? last - first + 1 : BANDS;
    return first;
}

static uint64_t *set_of(const segment_index *x, int direction, int band) {
    return x->set[direction] + (size_t)(band & (BANDS - 1)) * x->words;
}

static void enter(segment_index *x, int direction, double a, double b, uint32_t segment) {
    int n, first = bands(a, b, 0, &n);
    for (int k = first; k < first + n; k++)
        set_of(x, direction, k)[segment / WORD] |= UINT64_C(1) << segment % WORD;
}

void index_fill(segment_index *x, const arris_segment *s, uint32_t n) {
    n = n < x->max ? n : (uint32_t)x->max;
    x->words = n / WORD + 1;
    memset(x->set[0], 0, BANDS * x->words * sizeof *x->set[0]);
    memset(x->set[1], 0, BANDS * x->words * sizeof *x->set[1]);
    for (uint32_t i = 0; i < n; i++)
        if (usable(&s[i])) {
            enter(x, 0, s[i].x1, s[i].x2, i);
            enter(x, 1, s[i].y1, s[i].y2, i);
        }
}

const uint32_t *index_near(segment_index *x, const arris_segment *where, double reach,
                           uint32_t *n) {
    *n = 0;
    if (!usable(where))
        return x->found;
    reach = reach < FAR ? reach : FAR;
    int columns, rows, left = bands(where->x1, where->x2, reach, &columns),
                       top = bands(where->y1, where->y2, reach, &rows);
    for (size_t w = 0; w < x->words; w++) {
        uint64_t upright = 0, level = 0;
        for (int k = left; k < left + columns; k++)
            upright |= set_of(x, 0, k)[w];
        for (int k = top; upright && k < top + rows; k++)
            level |= set_of(x, 1, k)[w];
        for (uint64_t both = upright & level; both; both &= both - 1)
            x->found[(*n)++] = (uint32_t)(w * WORD) + (uint32_t)__builtin_ctzll(both);
    }
    return x->found;
}
