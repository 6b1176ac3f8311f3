/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * tracker.h: which segment continues which track, from the picture alone (the thesis's box) and
 * from what is foreseen of the tracks. No dependency on the runtime.
 */
#ifndef TRACKER_H
#define TRACKER_H

#include "arris_types.h"

typedef struct tracker tracker;

typedef struct tracker_params {
    double box;         /* px: half the side of the box around a predicted end point */
    int32_t max_gap;    /* frames that a track lives on without a segment */
    int32_t max_tracks; /* alive at a time; also the segments of a frame that are looked at */
} tracker_params;

/* NULL when memory is short. For tracker_free. */
tracker *tracker_new(const tracker_params *p);
void tracker_free(tracker *t); /* NULL is allowed */

/* The line of the track is at `where` in the next frame (its ends in order, the rest means
 * nothing), to within `box` px across. No such track: nothing happens. */
void tracker_foresee(tracker *t, int32_t id, const arris_segment *where, double box);

/* Continues the tracks with the segments of the next frame, starts tracks for those that are left,
 * and writes all that are alive to `out`, by ascending id. Time is O(tracks x segments), memory is
 * not allocated. What found no room is counted in out->lost. */
void tracker_run(tracker *t, const arris_segments *in, arris_tracks *out);

#endif
