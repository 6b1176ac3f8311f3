/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * record.h: what was seen in a scan, until it is adjusted as a whole; and the way from lines to the
 * problem and back. No dependency on the runtime.
 */
#ifndef ADJUST_RECORD_H
#define ADJUST_RECORD_H

#include "adjust.h"
#include "beside.h"

typedef struct sighting {
    double x1, y1, x2, y2; /* ideal px */
    float cov[3], chi2;    /* as of arris_segment */
    float blur, beside[2]; /* likewise */
    uint32_t frame;        /* of the record */
    int32_t track;
    int32_t line; /* index of the lines, set by record_associate; -1: none */
} sighting;

typedef struct recorded_frame {
    int64_t index, utime;
    arris_pose pose, at;   /* as reported; as it is thought to be */
    uint32_t seen, strays; /* sightings of tracks that are a line's; those off that line */
    bool outlier;          /* the reported pose is wrong, or the picture */
} recorded_frame;

typedef struct record {
    arris_camera camera;                         /* ideal */
    uint32_t n_frames, max_frames, n, max, lost; /* lost: sightings that found no room */
    recorded_frame *frame;
    sighting *item;
} record;

/* 0 or ARRIS_E_MEMORY. For record_free in any case. Nothing is allocated afterwards but in
 * record_adjust. */
int record_init(record *r, const arris_camera *c, uint32_t frames, uint32_t sightings);
void record_free(record *r);

/* Begins a frame. False when there is no room: then nothing is added to it either. */
bool record_frame(record *r, int64_t index, int64_t utime, const arris_pose *pose);
/* A segment of the frame that was begun last, in pixels of the camera `c`, whose lens is taken out
 * of it. */
void record_add(record *r, int32_t track, const arris_segment *s, const arris_camera *c);

typedef struct adjust_params {
    double pose_sigma, rot_sigma; /* mm, rad; 0: unknown, estimated */
    double robust;                /* sigmas */
    unsigned common;              /* states; the lens is one of them where that is evident, too */
    const adj_backend *backend;
} adjust_params;

/* What came of it. */
typedef struct adjusted {
    adj_quality q;
    uint32_t lines, views; /* that took part */
    unsigned common;
    int n_states;             /* in all */
    double state[ADJ_COMMON]; /* of `common`, as of adj_problem */
    char undetermined[400];   /* what the scan does not tell, in words; empty: nothing */
    adj_pose *pose; /* of every frame, for record_adjusted_free; NULL: nothing was adjusted */
} adjusted;

/* Adjusts the lines in place: ends, covariance, rms, views; those that were seen too little stay as
 * they are; so do all when the scan tells too little, and out->undetermined says why. Frames that
 * are outliers are marked. 0, ARRIS_E_MEMORY, or ARRIS_E_INPUT: it cannot be solved; then nothing
 * has changed. */
int record_adjust(record *r, arris_lines *lines, const adjust_params *params, adjusted *out);
void record_adjusted_free(adjusted *a);

/* Which line each sighting is of, by where lines and cameras are as they stand; none when another
 * one is less than `apart` px farther off. 0 or ARRIS_E_MEMORY. */
int record_associate(record *r, const arris_lines *lines, double apart);

/* By how much what is beside its line's edge moves each sighting (beside.h); those of no line not
 * at all. `move` has r->n. 0 or ARRIS_E_MEMORY. */
int record_clear(const record *r, const arris_lines *lines, beside_move *move);

#endif
