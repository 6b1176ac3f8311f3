/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * track.c: the stage `track`: which segment continues which track. The kernel is tracker.h; what is
 * known of the lines comes back from `reconstruct`, one frame old (foresight.h).
 */
#include <math.h>

#include "arris_plugin.h"

#include "tracker.h"

struct track_stage {
    tracker_params p;
    int32_t mode;
    tracker *tracker;
    const arris_camera *camera; /* the stream's; NULL: none */
};

enum { POSE, THESIS };               /* mode */
static const double POSITION = 0.3;  /* mm: sigma of a robot's position, until it shows */
static const double ROTATION = 2e-4; /* rad: likewise */

static const arris_prop props[] = {
    ARRIS_P_ENUM(struct track_stage, mode, "mode", "pose", "pose|thesis",
                 "pose: looks where the poses and the running 3D lines let expect a line; thesis: "
                 "in the box around where each line's own motion puts it"),
    ARRIS_P_DOUBLE(struct track_stage, p.box, "box", "5", 0.1, 1000, "px",
                   "a line may be this far from where its motion would put it"),
    ARRIS_P_DOUBLE(struct track_stage, p.near, "near", "100", 0.001, 1e9, "mm",
                   "no line is nearer"),
    ARRIS_P_DOUBLE(struct track_stage, p.far, "far", "10000", 0.001, 1e9, "mm", "nor farther"),
    ARRIS_P_INT(struct track_stage, p.max_gap, "max-gap", "5", 0, 10000, "frames",
                "a track lives on this long without a segment"),
    ARRIS_P_INT(struct track_stage, p.max_tracks, "max-tracks", "4096", 1, 1000000, "tracks",
                "alive at a time; also the segments of a frame that are looked at"),
};

static int setup(arris_stage *s, void *self, arris_caps *caps) {
    struct track_stage *t = self;
    t->camera = caps->camera;
    if (!(t->p.near < t->p.far))
        return arris_fail(s, ARRIS_E_USAGE, "lines are looked for from near= to far=",
                          "near is %g mm and far is %g mm", t->p.near, t->p.far);
    t->tracker = tracker_new(&t->p);
    if (!t->tracker)
        return arris_fail(s, ARRIS_E_MEMORY, "a smaller max-tracks takes less",
                          "no memory for %d tracks", t->p.max_tracks);
    return arris_reserve(s, ARRIS_TRACKS, (size_t)t->p.max_tracks, 0);
}

/* Hands over what `reconstruct` knew after the frame before. */
static void foresee_lines(struct track_stage *t, const arris_lines *lines, const viewpoint *v) {
    for (uint32_t i = 0; i < lines->n; i++) {
        const arris_line *l = &lines->item[i];
        forecast f;
        double depth = 0;
        bool visible = v && foresee(l, v, &f, &depth);
        if (l->change == ARRIS_MERGED)
            tracker_merge(t->tracker, l->id, l->into);
        else if (l->change != ARRIS_RETIRED && l->state != ARRIS_UNOBSERVABLE)
            tracker_foresee(t->tracker, l->id, visible ? &f : NULL, depth);
    }
}

static bool usable(const arris_pose *pose) {
    double sum = 0;
    for (int i = 0; pose && i < 9; i++)
        sum += pose->R[i] + pose->C[i / 3];
    return pose && pose->valid && isfinite(sum);
}

static int process(arris_stage *s, void *self, arris_frame *f) {
    struct track_stage *t = self;
    const arris_segments *segments = arris_layer_get(f, ARRIS_SEGMENTS);
    const arris_lines *lines = arris_feedback(s, ARRIS_LINES);
    const arris_pose *pose = arris_layer_get(f, ARRIS_POSE);
    viewpoint v = {segments->camera ? segments->camera : t->camera, pose,
                   fmax(POSITION, lines ? lines->pose_sigma : 0), ROTATION};
    bool posed = t->mode == POSE && v.camera && usable(pose);
    if (t->mode == POSE && lines)
        foresee_lines(t, lines, posed ? &v : NULL);
    arris_tracks *out = arris_layer_give(s, f, ARRIS_TRACKS);
    tracker_run(t->tracker, segments, posed ? &v : NULL, out);
    if (out->lost)
        arris_count(s, "segments lost", out->lost);
    return 0;
}

static void close_track(arris_stage *s, void *self) {
    (void)s;
    tracker_free(((struct track_stage *)self)->tracker);
}

static const arris_stage_desc stage_track = {
    .size = sizeof(arris_stage_desc),
    .name = "track",
    .summary = "follows segments from frame to frame",
    .example = "imagesrc location=frames.csv ! edges ! undistort ! segments ! track ! filesink "
               "location=tracks.csv",
    .layers = {.needs = ARRIS_BIT(ARRIS_SEGMENTS),
               .wants = ARRIS_BIT(ARRIS_POSE),
               .gives = ARRIS_BIT(ARRIS_TRACKS),
               .asks = ARRIS_BIT(ARRIS_LINES)},
    .self_size = sizeof(struct track_stage),
    .props = props,
    .n_props = sizeof props / sizeof *props,
    .setup = setup,
    .process = process,
    .close = close_track,
};

ARRIS_PLUGIN("track", "LGPL-2.1-or-later", &stage_track);
