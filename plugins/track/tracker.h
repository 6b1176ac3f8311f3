/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * tracker.h: which segment continues which track: from the poses and what is known of the lines, or
 * from the picture alone. No dependency on the runtime.
 */
#ifndef TRACKER_H
#define TRACKER_H

#include "foresight.h"

typedef struct tracker tracker;

typedef struct tracker_params {
    double box;         /* px: half the side of the box around an end point as the motion has it */
    double near, far;   /* mm: the depths that are looked at before a line has one */
    int32_t max_gap;    /* frames that a track lives on without a segment */
    int32_t max_tracks; /* alive at a time; also the segments of a frame that are looked at */
} tracker_params;

/* NULL when memory is short. For tracker_free. */
tracker *tracker_new(const tracker_params *p);
void tracker_free(tracker *t); /* NULL is allowed */

/* The running 3D line of that id, the id of its first track, is known: in the next frame it is as
 * the forecast says at that depth, mm; NULL: not in the picture. Its tracks are looked for there,
 * also those that have ended. */
void tracker_foresee(tracker *t, int32_t line, const forecast *f, double depth);

/* From now on the tracks of one line are those of another. */
void tracker_merge(tracker *t, int32_t line, int32_t into);

/* Continues the tracks with the segments of the next frame, starts tracks for those that are left,
 * and writes all that are alive to `out`, by ascending id. `from` is where the frame was taken;
 * NULL: unknown. Time is of the order of the segments and lines, memory is not allocated. What
 * found no room is counted in out->lost. */
void tracker_run(tracker *t, const arris_segments *in, const viewpoint *from, arris_tracks *out);

#endif
