/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * flow.c: the stage `flow`: how far every pixel has moved since the frame before, and that as two
 * grey pictures; the second of the two rivals of edges that the thesis weighs (section 2.3). The
 * kernels are dense.h and grey.h.
 */
#include "arris_plugin.h"

#include "dense.h"
#include "grey.h"

struct flow {
    double range;
    dense *dense;
};

static const arris_prop props[] = {
    ARRIS_P_DOUBLE(struct flow, range, "range", "10", 0.01, 1000, "px",
                   "in the grey pictures -range is black and +range is white"),
};

static int setup(arris_stage *s, void *self, arris_caps *caps) {
    (void)caps;
    struct flow *w = self;
    w->dense = dense_new();
    if (!w->dense)
        return arris_fail(s, ARRIS_E_MEMORY, NULL, "no memory for the optical flow");
    return arris_reserve(s, ARRIS_FLOW, 0, 0);
}

static int process(arris_stage *s, void *self, arris_frame *f) {
    const struct flow *w = self;
    arris_flow *out = arris_layer_give(s, f, ARRIS_FLOW);
    if (dense_run(w->dense, arris_layer_get(f, ARRIS_IMAGE), out))
        return arris_fail(s, ARRIS_E_INTERNAL, NULL, "OpenCV cannot find the picture's flow");
    size_t n = (size_t)out->width * (size_t)out->height;
    grey_of(out->u, n, w->range, out->grey_u);
    grey_of(out->v, n, w->range, out->grey_v);
    return 0;
}

static void close_flow(arris_stage *s, void *self) {
    (void)s;
    dense_free(((struct flow *)self)->dense);
}

static const arris_stage_desc stage_flow = {
    .size = sizeof(arris_stage_desc),
    .name = "flow",
    .summary = "dense optical flow since the frame before, and its two grey pictures",
    .example = "imagesrc location=frames.csv ! flow range=5 ! fakesink",
    .layers = {.needs = ARRIS_BIT(ARRIS_IMAGE), .gives = ARRIS_BIT(ARRIS_FLOW)},
    .self_size = sizeof(struct flow),
    .props = props,
    .n_props = sizeof props / sizeof *props,
    .setup = setup,
    .process = process,
    .close = close_flow,
};

ARRIS_PLUGIN("flow", "LGPL-2.1-or-later", &stage_flow);
