/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * timeline.h: poses by time in a ring, and the pose between two of them. No locks: by one thread at
 * a time. Nothing is allocated after timeline_new.
 */
#ifndef TIMELINE_H
#define TIMELINE_H

#include "arris_types.h"

typedef struct timed_pose {
    int64_t utime;               /* µs */
    double pos[3];               /* mm */
    double quat[4];              /* w, x, y, z, of unit length */
    double pos_sigma, rot_sigma; /* mm, rad; 0: unknown */
} timed_pose;

typedef struct timeline {
    uint32_t max, n, head; /* head: the next to write */
    timed_pose *item;
} timeline;

/* Room for the newest `max`. False when memory is short. */
bool timeline_new(timeline *t, uint32_t max);
void timeline_free(timeline *t);
void timeline_clear(timeline *t);

/* Adds a pose, which is later than the newest; the oldest makes room. */
void timeline_add(timeline *t, const timed_pose *p);

/* The newest; NULL when there is none. */
const timed_pose *timeline_newest(const timeline *t);

/* The pose at `utime`: position linearly, rotation along the great circle between the one before
 * and the one after, which may not be more than `max_gap` µs apart. The error of that is a dt²/8
 * under an acceleration a. Never beyond the ends. */
enum timeline_answer {
    TIMELINE_FOUND,
    TIMELINE_TOO_NEW, /* after the newest: wait for the next */
    TIMELINE_TOO_OLD, /* before the oldest */
    TIMELINE_GAP
};
enum timeline_answer timeline_at(const timeline *t, int64_t utime, int64_t max_gap,
                                 timed_pose *out);

/* As a layer has it: C the position, R world to body, the covariance from the sigmas. */
void timed_pose_write(const timed_pose *p, arris_pose *out);

#endif
