/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * corners.c: the stage `corners`: Harris's or Shi and Tomasi's corners, the first of the two rivals
 * of edges that the thesis weighs (section 2.3). The kernel is detect.h.
 */
#include "arris_plugin.h"

#include "detect.h"

struct corners {
    detect_params p;
    int32_t max;
};

static const arris_prop props[] = {
    ARRIS_P_ENUM(struct corners, p.method, "method", "shi-tomasi", "harris|shi-tomasi",
                 "what a corner's strength is"),
    ARRIS_P_INT(struct corners, max, "max", "500", 1, 1000000, "corners",
                "only the strongest are kept"),
    ARRIS_P_DOUBLE(struct corners, p.quality, "quality", "0.01", 1e-6, 1, NULL,
                   "weaker ones than this share of the strongest are none"),
    ARRIS_P_DOUBLE(struct corners, p.min_distance, "min-distance", "5", 0, 1000, "px",
                   "of two that are nearer, the weaker is dropped"),
};

static int setup(arris_stage *s, void *self, arris_caps *caps) {
    (void)caps;
    if (detect_setup())
        return arris_fail(s, ARRIS_E_INTERNAL, NULL, "OpenCV cannot be set up");
    return arris_reserve(s, ARRIS_CORNERS, (size_t)((struct corners *)self)->max, 0);
}

static int process(arris_stage *s, void *self, arris_frame *f) {
    const struct corners *c = self;
    arris_corners *out = arris_layer_give(s, f, ARRIS_CORNERS);
    if (detect_corners(&c->p, arris_layer_get(f, ARRIS_IMAGE), out))
        return arris_fail(s, ARRIS_E_INTERNAL, NULL, "OpenCV cannot find the picture's corners");
    if (out->lost)
        arris_count(s, "weaker corners dropped", out->lost);
    return 0;
}

static const arris_stage_desc stage_corners = {
    .size = sizeof(arris_stage_desc),
    .name = "corners",
    .summary = "corner points by Harris or by Shi and Tomasi, to sub-pixel",
    .example = "imagesrc location=frames.csv ! corners method=harris ! fakesink",
    .layers = {.needs = ARRIS_BIT(ARRIS_IMAGE), .gives = ARRIS_BIT(ARRIS_CORNERS)},
    .self_size = sizeof(struct corners),
    .props = props,
    .n_props = sizeof props / sizeof *props,
    .setup = setup,
    .process = process,
};

ARRIS_PLUGIN("corners", "LGPL-2.1-or-later", &stage_corners);
