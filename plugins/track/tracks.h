/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * tracks.h: what tracker.c, motion.c and depth.c share.
 */
#ifndef TRACKS_H
#define TRACKS_H

#include "index.h"
#include "sweep.h"
#include "tracker.h"

typedef struct track {
    int32_t id, line, segment;
    int32_t gap, sightings; /* gap: frames since it was seen; beyond max_gap it is asleep */
    arris_segment seen;     /* last, in the track's own direction */
    bool turned;            /* then it was of the other polarity than in the beginning */
    bool moving;            /* `across` is known */
    double time;            /* of the last sighting */
    double across;          /* px per step, to the right of the line */
    sweep s;
    forecast next; /* of this frame */
} track;

/* A line whose depth is known. */
typedef struct known {
    int32_t id;
    double depth; /* mm */
    bool visible; /* it is in the picture; else f means nothing */
    forecast f;
} known;

typedef struct pair {
    double cost;
    int32_t track, segment; /* by number */
} pair;

struct tracker {
    tracker_params p;
    track *track; /* by ascending id */
    int32_t n, total;
    known *known;
    int32_t n_known;
    double time, common[2];  /* px per step: the motion that suits all lines */
    depths scene;            /* of new lines */
    int32_t scene_age;       /* frames since it was last confirmed; negative: unknown */
    const arris_segment *in; /* of this frame */
    int32_t n_in;
    segment_index *index;
    pair *pair;
    size_t n_pairs;
    int32_t *taken; /* by segment: it continues a track */
};

/* Whether the track has ended, but is remembered. */
bool asleep(const tracker *t, const track *k);

/* How well the segments explain a forecast: 1 when one is where it was foreseen, 0 when none is
 * near. */
double explained(tracker *t, const forecast *f);

enum { SAMPLE = 32 }; /* tracks that tell how the camera moved */

/* ---- motion.c: from the picture alone -------------------------------------------------------- */

/* Finds by how many steps the camera went on; returns how well that explains the segments, over a
 * sample of the tracks. */
double motion_find(tracker *t, double *steps);

/* Forecasts every track so many steps on. */
void motion_forecast(tracker *t, double steps);
void motion_forecast_one(const tracker *t, track *k);

/* The track goes on with that segment; its motion across is that of the two sightings. */
void motion_sight(const tracker *t, track *k, const arris_segment *s);

/* The motion that suits best all lines that were seen in this frame. */
void motion_end_frame(tracker *t);

/* ---- depth.c: from the poses ----------------------------------------------------------------- */

/* Forecasts every track: by its 3D line, else by its sweep, else by its motion. */
void depth_forecast(tracker *t, const viewpoint *v);

/* How well that explains the segments, over a sample of the tracks. */
double depth_explains(tracker *t);

/* Whether the 3D line of the track is known. */
bool depth_knows(const tracker *t, const track *k);

/* Learns from the tracks seen in this frame how far away new lines are. */
void depth_end_frame(tracker *t, const viewpoint *v);

#endif
