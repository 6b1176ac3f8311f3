/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * edges.c: the stage `edges`: Canny's detector with sub-pixel points in linked chains (thesis,
 * section 2.3). The kernel is canny.h.
 */
#include "arris_plugin.h"

#include "canny.h"

struct edges {
    canny_params p;
    const char *roi;
    canny *canny;
};

static const arris_prop props[] = {
    ARRIS_P_DOUBLE(struct edges, p.sigma, "sigma", "1", 0, 5, "px", "Gaussian before the gradient"),
    ARRIS_P_DOUBLE_OR(struct edges, p.low, "low", "auto", "auto", 0, 65535, "levels/px",
                      "a chain goes on down to this gradient"),
    ARRIS_P_DOUBLE_OR(struct edges, p.high, "high", "auto", "auto", 0, 65535, "levels/px",
                      "a chain has at least one gradient like this"),
    ARRIS_P_INT(struct edges, p.min_length, "min-length", "10", 1, 8192, "points",
                "shorter chains are dropped"),
    ARRIS_P_STRING(struct edges, roi, "roi", NULL, "x,y,width,height in px: only look in there"),
};

static int setup(arris_stage *s, void *self, arris_caps *caps) {
    struct edges *e = self;
    canny_params *p = &e->p;
    if (e->roi && !canny_set_roi(p, e->roi, caps->width, caps->height))
        return arris_fail(s, ARRIS_E_USAGE, "write it as roi=X,Y,WIDTH,HEIGHT, in px",
                          "roi=%s is no region of a picture of %dx%d", e->roi, caps->width,
                          caps->height);
    if (p->low >= 0 && p->high >= 0 && p->low > p->high)
        return arris_fail(s, ARRIS_E_USAGE, "give a low that is at most high, or leave one out",
                          "low=%g is above high=%g", p->low, p->high);
    e->canny = canny_new(caps->width, caps->height, p);
    if (!e->canny)
        return arris_fail(s, ARRIS_E_MEMORY, NULL, "no memory for the edges of a picture");
    return arris_reserve(s, ARRIS_EDGES, canny_max_points(caps->width, caps->height),
                         canny_max_chains(caps->width, caps->height));
}

static int process(arris_stage *s, void *self, arris_frame *f) {
    struct edges *e = self;
    arris_edges *out = arris_layer_give(s, f, ARRIS_EDGES);
    canny_run(e->canny, arris_layer_get(f, ARRIS_IMAGE), out);
    if (out->lost)
        arris_count(s, "points lost", out->lost);
    return 0;
}

static void close_edges(arris_stage *s, void *self) {
    (void)s;
    canny_free(((struct edges *)self)->canny);
}

const arris_stage_desc stage_edges = {
    .size = sizeof(arris_stage_desc),
    .name = "edges",
    .summary = "Canny's edges as linked sub-pixel chains",
    .example = "imagesrc location=frames.csv ! edges ! fakesink",
    .layers = {.needs = ARRIS_BIT(ARRIS_IMAGE), .gives = ARRIS_BIT(ARRIS_EDGES)},
    .self_size = sizeof(struct edges),
    .props = props,
    .n_props = sizeof props / sizeof *props,
    .setup = setup,
    .process = process,
    .close = close_edges,
};
