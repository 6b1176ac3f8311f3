/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * timeline.c: poses by time in a ring, and the pose between two of them.
 */
#include "timeline.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "rigid.h"

bool timeline_new(timeline *t, uint32_t max) {
    *t = (timeline){.max = max, .item = calloc(max, sizeof *t->item)};
    return t->item != NULL;
}

void timeline_free(timeline *t) {
    free(t->item);
    *t = (timeline){0};
}

void timeline_clear(timeline *t) {
    t->n = t->head = 0;
}

void timeline_add(timeline *t, const timed_pose *p) {
    t->item[t->head] = *p;
    t->head = (t->head + 1) % t->max;
    t->n += t->n < t->max;
}

/* The i-th, from the oldest. */
static const timed_pose *at(const timeline *t, uint32_t i) {
    return &t->item[(t->head + t->max - t->n + i) % t->max];
}

const timed_pose *timeline_newest(const timeline *t) {
    return t->n ? at(t, t->n - 1) : NULL;
}

static void between(const timed_pose *a, const timed_pose *b, int64_t utime, timed_pose *out) {
    double f = (double)(utime - a->utime) / (double)(b->utime - a->utime);
    out->utime = utime;
    for (int i = 0; i < 3; i++)
        out->pos[i] = a->pos[i] + f * (b->pos[i] - a->pos[i]);
    rigid_slerp(a->quat, b->quat, f, out->quat);
    out->pos_sigma = fmax(a->pos_sigma, b->pos_sigma);
    out->rot_sigma = fmax(a->rot_sigma, b->rot_sigma);
}

enum timeline_answer timeline_at(const timeline *t, int64_t utime, int64_t max_gap,
                                 timed_pose *out) {
    uint32_t first = 0, n = t->n; /* the first that is not before utime, by halving */
    while (n > 0) {
        uint32_t half = n / 2;
        bool before = at(t, first + half)->utime < utime;
        first = before ? first + half + 1 : first;
        n = before ? n - half - 1 : half;
    }
    if (first == t->n)
        return TIMELINE_TOO_NEW;
    const timed_pose *b = at(t, first), *a = first ? at(t, first - 1) : NULL;
    if (b->utime == utime)
        *out = *b;
    else if (!a)
        return TIMELINE_TOO_OLD;
    else if (b->utime - a->utime > max_gap)
        return TIMELINE_GAP;
    else
        between(a, b, utime, out);
    return TIMELINE_FOUND;
}

void timed_pose_write(const timed_pose *p, arris_pose *out) {
    static const int diagonal[6] = {0, 6, 11, 15, 18, 20};
    double inverse[4] = {p->quat[0], -p->quat[1], -p->quat[2], -p->quat[3]};
    *out = (arris_pose){.valid = true};
    memcpy(out->C, p->pos, sizeof out->C);
    rigid_matrix(inverse, out->R);
    for (int i = 0; i < 6; i++) {
        double sigma = i < 3 ? p->pos_sigma : p->rot_sigma;
        out->cov[diagonal[i]] = sigma * sigma;
    }
}
