/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * record.c: what was seen in a scan (record.h).
 */
#include "record.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

int record_init(record *r, const arris_camera *c, uint32_t frames, uint32_t sightings) {
    memset(r, 0, sizeof *r);
    r->camera = arris_camera_ideal(c);
    r->frame = malloc((frames + (size_t)1) * sizeof *r->frame);
    r->item = malloc((sightings + (size_t)1) * sizeof *r->item);
    r->max_frames = frames, r->max = sightings;
    return r->frame && r->item ? 0 : ARRIS_E_MEMORY;
}

void record_free(record *r) {
    free(r->frame);
    free(r->item);
    memset(r, 0, sizeof *r);
}

bool record_frame(record *r, int64_t index, int64_t utime, const arris_pose *pose) {
    if (r->n_frames == r->max_frames)
        return false;
    r->frame[r->n_frames++] = (recorded_frame){index, utime, *pose, *pose, 0, 0, false};
    return true;
}

void record_add(record *r, int32_t track, const arris_segment *s, const arris_camera *c) {
    sighting o = {.x1 = s->x1,
                  .y1 = s->y1,
                  .x2 = s->x2,
                  .y2 = s->y2,
                  .chi2 = s->chi2,
                  .blur = s->blur,
                  .beside = {s->beside[0], s->beside[1]},
                  .frame = r->n_frames - 1,
                  .track = track,
                  .line = -1};
    if (r->n == r->max) {
        r->lost++;
        return;
    }
    if (arris_camera_distorts(c) && (arris_undistort(c, s->x1, s->y1, &o.x1, &o.y1) ||
                                     arris_undistort(c, s->x2, s->y2, &o.x2, &o.y2)))
        return;
    for (int i = 0; i < 3; i++)
        o.cov[i] = (float)s->cov[i];
    r->item[r->n++] = o;
}
