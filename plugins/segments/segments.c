/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * segments.c: the stage `segments`: chains to straight segments with covariance (thesis, section
 * 2.4). The kernel is segmenter.h.
 */
#include "arris_plugin.h"

#include "segmenter.h"

struct segments {
    segmenter_params p;
    segmenter *segmenter;
};

static const arris_prop props[] = {
    ARRIS_P_DOUBLE(struct segments, p.tol, "tol", "2", 0.1, 100, "px",
                   "a chain may deviate this far from a segment's chord"),
    ARRIS_P_DOUBLE(struct segments, p.angtol, "angtol", "0.05", 0, 1.5, "rad",
                   "segments are joined when they differ in direction by less than this, and"),
    ARRIS_P_DOUBLE(struct segments, p.linkrad, "linkrad", "2", 0, 100, "px",
                   "are no further apart than this"),
    ARRIS_P_DOUBLE(struct segments, p.min_length, "min-length", "15", 2, 8192, "px",
                   "shorter segments are dropped"),
    ARRIS_P_ENUM(struct segments, p.mode, "mode", "refit", "refit|thesis",
                 "lines fitted to the grey levels, or the chains' raw end points"),
};

/* Chains alone give the thesis's segments: nobody is to look for lines without them. */
static int settle(arris_stage *s, void *self, arris_layers *l) {
    (void)s;
    if (((struct segments *)self)->p.mode == SEGMENTER_THESIS)
        l->wants = 0;
    return 0;
}

static int setup(arris_stage *s, void *self, arris_caps *caps) {
    struct segments *g = self;
    g->segmenter = segmenter_new(caps->width, caps->height, &g->p);
    if (!g->segmenter)
        return arris_fail(s, ARRIS_E_MEMORY, NULL, "no memory for the segments of a picture");
    return arris_reserve(s, ARRIS_SEGMENTS, segmenter_max(caps->width, caps->height), 0);
}

static int process(arris_stage *s, void *self, arris_frame *f) {
    struct segments *g = self;
    const arris_image *image =
        g->p.mode == SEGMENTER_REFIT ? arris_layer_get(f, ARRIS_IMAGE) : NULL;
    arris_segments *out = arris_layer_give(s, f, ARRIS_SEGMENTS);
    segmenter_guide(g->segmenter, arris_layer_get(f, ARRIS_GUIDE), arris_frame_seq(f));
    segmenter_run(g->segmenter, arris_layer_get(f, ARRIS_EDGES), image, out);
    if (out->lost)
        arris_count(s, "segments lost", out->lost);
    return 0;
}

static void close_segments(arris_stage *s, void *self) {
    (void)s;
    segmenter_free(((struct segments *)self)->segmenter);
}

const arris_stage_desc stage_segments = {
    .size = sizeof(arris_stage_desc),
    .name = "segments",
    .summary = "straight segments of edge chains, each with the covariance of its line",
    .example = "imagesrc location=frames.csv ! edges ! undistort ! segments "
               "! filesink location=segments.csv",
    .layers = {.needs = ARRIS_BIT(ARRIS_EDGES),
               .wants = ARRIS_BIT(ARRIS_IMAGE) | ARRIS_BIT(ARRIS_GUIDE),
               .gives = ARRIS_BIT(ARRIS_SEGMENTS)},
    .self_size = sizeof(struct segments),
    .props = props,
    .n_props = sizeof props / sizeof *props,
    .settle = settle,
    .setup = setup,
    .process = process,
    .close = close_segments,
};
