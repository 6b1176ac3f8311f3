/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * reconstruct.c: the stage `reconstruct`: running 3D lines, each the intersection of the planes
 * through the camera centres and the segments of a track (thesis, section 2.6). The kernels are
 * view.h (a plane), line.h (the estimate of a line) and scan.h (all lines).
 */
#include <math.h>

#include "arris_plugin.h"

#include "scan.h"

struct reconstruct {
    scan_params p;
    scan *scan;
    const arris_camera *camera; /* the stream's */
    double picture[4];          /* x0, y0, x1, y1 in ideal pixels: surely seen */
    bool warned;
};

enum { AHEAD = 3 };             /* tracks that are expected */
static const double MARGIN = 4; /* px at the border of the picture where nothing is detected */

static const arris_prop props[] = {
    ARRIS_P_DOUBLE_OR(struct reconstruct, p.limit, "limit", "auto", "auto", 0, 1e6, "mm",
                      "sigma across a line that counts as measured; auto: 0.3 % of its distance"),
    ARRIS_P_DOUBLE(struct reconstruct, p.pose_sigma, "pose-sigma", "0", 0, 1e3, "mm",
                   "noise of the reported positions; 0: unknown, estimated"),
    ARRIS_P_DOUBLE(struct reconstruct, p.rot_sigma, "rot-sigma", "0", 0, 1, "rad",
                   "noise of the reported rotations; 0: unknown"),
    ARRIS_P_INT(struct reconstruct, p.max_lines, "max-lines", "2000", 1, 100000, "lines",
                "at a time"),
    ARRIS_P_INT(struct reconstruct, p.min_views, "min-views", "4", 2, 1000, "frames",
                "a line is told of when so many agree on it"),
};

/* The rectangle of ideal pixels within the undistorted border of the picture. */
static void find_picture(const arris_camera *c, double picture[4]) {
    double w = c->width - 1, h = c->height - 1, x, y;
    picture[0] = picture[1] = -(double)INFINITY;
    picture[2] = picture[3] = (double)INFINITY;
    for (int i = 0; i <= 4; i++) {
        arris_undistort(c, MARGIN, h * i / 4, &x, &y);
        picture[0] = fmax(picture[0], x);
        arris_undistort(c, w - MARGIN, h * i / 4, &x, &y);
        picture[2] = fmin(picture[2], x);
        arris_undistort(c, w * i / 4, MARGIN, &x, &y);
        picture[1] = fmax(picture[1], y);
        arris_undistort(c, w * i / 4, h - MARGIN, &x, &y);
        picture[3] = fmin(picture[3], y);
    }
}

static int setup(arris_stage *s, void *self, arris_caps *caps) {
    struct reconstruct *r = self;
    if (!caps->camera)
        return arris_fail(s, ARRIS_E_INPUT, "give the source a camera.json",
                          "lines need the camera model, and the stream has none");
    r->camera = caps->camera;
    find_picture(r->camera, r->picture);
    r->scan = scan_new(&r->p);
    if (!r->scan)
        return arris_fail(s, ARRIS_E_MEMORY, "a smaller max-lines takes less",
                          "no memory for %d lines", r->p.max_lines);
    return arris_reserve(s, ARRIS_LINES, (size_t)r->p.max_lines, 0);
}

static void add_track(arris_stage *s, struct reconstruct *r, const arris_track *t,
                      const arris_segments *segments, const arris_pose *pose) {
    const arris_camera *camera = segments->camera ? segments->camera : r->camera;
    bool seen = t->segment >= 0 && (uint32_t)t->segment < segments->n;
    view v;
    if (seen && view_make(&v, &segments->item[t->segment], camera, pose, r->picture)) {
        arris_count(s, "bad segments", 1);
        seen = false;
    }
    scan_add(r->scan, t->id, seen ? &v : NULL);
}

static void expect(const struct reconstruct *r, const arris_tracks *tracks, uint32_t i, bool next) {
    if (i < tracks->n && tracks->item[i].segment >= 0)
        scan_expect(r->scan, tracks->item[i].id, next);
}

static void skip_frame(arris_stage *s, struct reconstruct *r) {
    arris_count(s, "without pose", 1);
    if (!r->warned)
        arris_warn(s, "a frame has no valid pose and is skipped");
    r->warned = true;
}

static int process(arris_stage *s, void *self, arris_frame *f) {
    struct reconstruct *r = self;
    const arris_segments *segments = arris_layer_get(f, ARRIS_SEGMENTS);
    const arris_tracks *tracks = arris_layer_get(f, ARRIS_TRACKS);
    const arris_pose *pose = arris_layer_get(f, ARRIS_POSE);
    if (!pose->valid)
        skip_frame(s, r);
    for (uint32_t i = 0; i < tracks->n; i++) {
        expect(r, tracks, i + AHEAD, false);
        expect(r, tracks, i + 1, true);
        if (pose->valid)
            add_track(s, r, &tracks->item[i], segments, pose);
        else
            scan_add(r->scan, tracks->item[i].id, NULL);
    }
    scan_end_frame(r->scan, pose->valid);
    arris_lines *out = arris_layer_give(s, f, ARRIS_LINES);
    scan_write(r->scan, out);
    if (out->lost)
        arris_count(s, "lines lost", out->lost);
    return 0;
}

static int finish(arris_stage *s, void *self, arris_frame *f) {
    struct reconstruct *r = self;
    scan_finish(r->scan);
    scan_write(r->scan, arris_layer_give(s, f, ARRIS_LINES));
    return 0;
}

static void close_reconstruct(arris_stage *s, void *self) {
    (void)s;
    scan_free(((struct reconstruct *)self)->scan);
}

static const arris_stage_desc stage_reconstruct = {
    .size = sizeof(arris_stage_desc),
    .name = "reconstruct",
    .summary = "running 3D lines with covariance, from tracks and poses",
    .example = "imagesrc location=frames.csv ! edges ! undistort ! segments ! track ! reconstruct "
               "! filesink location=lines.json",
    .layers = {.needs = ARRIS_BIT(ARRIS_SEGMENTS) | ARRIS_BIT(ARRIS_TRACKS) | ARRIS_BIT(ARRIS_POSE),
               .gives = ARRIS_BIT(ARRIS_LINES)},
    .self_size = sizeof(struct reconstruct),
    .props = props,
    .n_props = sizeof props / sizeof *props,
    .setup = setup,
    .process = process,
    .finish = finish,
    .close = close_reconstruct,
};

ARRIS_PLUGIN("reconstruct", "LGPL-2.1-or-later", &stage_reconstruct);
