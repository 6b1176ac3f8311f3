/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * stage.c: the stage `adjust`: lines and poses together. While frames flow, those of a window
 * (window.h); what was seen is kept, and adjusted as a whole at the end of the stream (record.h).
 */
#include <errno.h>
#include <string.h>

#include "arris_plugin.h"

#include "files/output.h"
#include "summary.h"
#include "window.h"

struct adjust {
    adjust_params p;
    int32_t max_frames, max_views, solver, frames;
    const char *poses;
    record record;
    window *window;             /* NULL: none */
    const arris_camera *camera; /* the stream's */
    bool full;
};

static const arris_prop props[] = {
    ARRIS_P_DOUBLE(struct adjust, p.pose_sigma, "pose-sigma", "0", 0, 1e3, "mm",
                   "noise of the reported positions, per axis; 0: unknown, estimated"),
    ARRIS_P_DOUBLE(struct adjust, p.rot_sigma, "rot-sigma", "0", 0, 1, "rad",
                   "noise of the reported rotations, per axis; 0: unknown, estimated"),
    ARRIS_P_DOUBLE(struct adjust, p.robust, "robust", "4", 0, 100, "sigma",
                   "from which a segment counts less (Cauchy's loss); 0: never"),
    ARRIS_P_INT(struct adjust, frames, "window", "16", 0, 64, "frames",
                "fixed lag: the last poses that are adjusted, with the lines in sight; 0: none"),
    ARRIS_P_ENUM(struct adjust, solver, "solver", "cholmod", "cholmod|eigen", "of the equations"),
    ARRIS_P_STRING(struct adjust, poses, "poses", NULL,
                   "a frames.csv to write with the adjusted poses"),
    ARRIS_P_INT(struct adjust, max_frames, "max-frames", "4000", 2, 100000, "frames", "of a scan"),
    ARRIS_P_INT(struct adjust, max_views, "max-views", "400000", 2, 10000000, "segments",
                "of a scan"),
};

static int setup(arris_stage *s, void *self, arris_caps *caps) {
    struct adjust *a = self;
    if (!caps->camera)
        return arris_fail(s, ARRIS_E_INPUT, "give the source a camera.json",
                          "lines need the camera model, and the stream has none");
    a->camera = caps->camera;
    a->p.backend = a->solver ? &adj_eigen : &adj_cholmod;
    if (record_init(&a->record, caps->camera, (uint32_t)a->max_frames, (uint32_t)a->max_views))
        return arris_fail(s, ARRIS_E_MEMORY, "smaller max-frames and max-views take less",
                          "no memory for %d segments", a->max_views);
    size_t lines = arris_capacity(s, ARRIS_LINES, NULL);
    window_params w = {(uint32_t)a->frames, a->p.pose_sigma, a->p.rot_sigma, a->p.robust};
    if (a->frames > 0 && !(a->window = window_new(&w, caps->camera, (uint32_t)lines)))
        return arris_fail(s, ARRIS_E_MEMORY, "a smaller window takes less",
                          "no memory for a window of %d frames", a->frames);
    return arris_reserve(s, ARRIS_LINES, lines, 0);
}

static void say_full(arris_stage *s, struct adjust *a) {
    if (!a->full)
        arris_warn(s, "the scan is longer than max-frames or max-views: what follows is not "
                      "adjusted");
    a->full = true;
}

static void copy_lines(const arris_lines *in, arris_lines *out) {
    arris_lines copy = *in;
    copy.item = out->item, copy.max = out->max;
    *out = copy;
    memcpy(out->item, in->item, in->n * sizeof *in->item);
}

/* The fixed lag: the frame's lines become those that the window adjusted. */
static void adjust_window(arris_stage *s, struct adjust *a, arris_frame *f) {
    const arris_segments *segments = arris_layer_get(f, ARRIS_SEGMENTS);
    const arris_tracks *tracks = arris_layer_get(f, ARRIS_TRACKS);
    const arris_pose *pose = arris_layer_get(f, ARRIS_POSE);
    const arris_lines *in = arris_layer_get(f, ARRIS_LINES);
    const arris_camera *camera = segments->camera ? segments->camera : a->camera;
    arris_lines *out = arris_layer_give(s, f, ARRIS_LINES);
    copy_lines(in, out);
    if (pose->valid) {
        window_frame(a->window, pose);
        for (uint32_t i = 0; i < tracks->n; i++) {
            int32_t k = tracks->item[i].segment;
            if (k >= 0 && (uint32_t)k < segments->n)
                window_add(a->window, tracks->item[i].id, &segments->item[k], camera);
        }
    }
    window_adjust(a->window, out);
}

static int process(arris_stage *s, void *self, arris_frame *f) {
    struct adjust *a = self;
    if (a->window)
        adjust_window(s, a, f);
    const arris_segments *segments = arris_layer_get(f, ARRIS_SEGMENTS);
    const arris_tracks *tracks = arris_layer_get(f, ARRIS_TRACKS);
    const arris_pose *pose = arris_layer_get(f, ARRIS_POSE);
    const arris_camera *camera = segments->camera ? segments->camera : a->camera;
    if (!pose->valid)
        return 0;
    if (!record_frame(&a->record, arris_frame_index(f), arris_frame_utime(f), pose)) {
        arris_count(s, "frames left out", 1);
        say_full(s, a);
        return 0;
    }
    uint32_t lost = a->record.lost;
    for (uint32_t i = 0; i < tracks->n; i++) {
        int32_t k = tracks->item[i].segment;
        if (k >= 0 && (uint32_t)k < segments->n)
            record_add(&a->record, tracks->item[i].id, &segments->item[k], camera);
    }
    if (a->record.lost > lost) {
        arris_count(s, "segments left out", a->record.lost - lost);
        say_full(s, a);
    }
    return 0;
}

/* ---- the end --------------------------------------------------------------------------------- */

/* Pictures are named as filesink names those of a recording. */
static int write_poses(arris_stage *s, const struct adjust *a, const adjusted *result) {
    output o;
    errno = 0;
    int error = output_open(&o, a->poses);
    if (!error) {
        fprintf(o.file, "index,file,utime,x,y,z,omega,theta,kappa\n");
        for (uint32_t i = 0; i < a->record.n_frames; i++) {
            const recorded_frame *f = &a->record.frame[i];
            const adj_pose *p = &result->pose[i];
            double angle[3];
            arris_angles(p->R, &angle[0], &angle[1], &angle[2]);
            fprintf(o.file, "%lld,frames/%04lld.png,%lld,%.5f,%.5f,%.5f,%.9f,%.9f,%.9f\n",
                    (long long)f->index, (long long)f->index, (long long)f->utime, p->C[0], p->C[1],
                    p->C[2], angle[0], angle[1], angle[2]);
        }
        error = output_commit(&o);
    }
    return error ? arris_fail(s, ARRIS_E_IO, NULL, "cannot write %s: %s", a->poses, strerror(error))
                 : 0;
}

static int tell(arris_stage *s, const struct adjust *a, const adjusted *result) {
    char outliers[200];
    summary_outliers(&a->record, outliers, sizeof outliers);
    if (strcmp(outliers, "none") != 0)
        arris_warn(s, "frames whose poses or pictures are outliers: %s", outliers);
    if (*result->undetermined)
        arris_warn(s, "not determined: %s", result->undetermined);
    return a->poses && result->pose ? write_poses(s, a, result) : 0;
}

static int finish(arris_stage *s, void *self, arris_frame *f) {
    struct adjust *a = self;
    const arris_lines *in = arris_layer_get(f, ARRIS_LINES);
    arris_lines *out = arris_layer_give(s, f, ARRIS_LINES);
    adjusted result;
    copy_lines(in, out);
    int rc = record_adjust(&a->record, out, &a->p, &result);
    if (rc == ARRIS_E_MEMORY)
        return arris_fail(s, rc, NULL, "no memory to adjust %u segments", a->record.n);
    rc = tell(s, a, &result);
    record_adjusted_free(&result);
    return rc;
}

static void close_adjust(arris_stage *s, void *self) {
    (void)s;
    window_free(((struct adjust *)self)->window);
    record_free(&((struct adjust *)self)->record);
}

const arris_stage_desc stage_adjust = {
    .size = sizeof(arris_stage_desc),
    .name = "adjust",
    .summary = "structure and motion: lines and poses together, in a window and at the end",
    .example = "imagesrc location=frames.csv ! edges ! undistort ! segments ! track ! reconstruct "
               "! adjust ! filesink location=lines.json",
    .layers = {.needs = ARRIS_BIT(ARRIS_SEGMENTS) | ARRIS_BIT(ARRIS_TRACKS) |
                        ARRIS_BIT(ARRIS_POSE) | ARRIS_BIT(ARRIS_LINES),
               .gives = ARRIS_BIT(ARRIS_LINES)},
    .self_size = sizeof(struct adjust),
    .props = props,
    .n_props = sizeof props / sizeof *props,
    .setup = setup,
    .process = process,
    .finish = finish,
    .close = close_adjust,
};
