/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * edges.c: the stage `edges`: Canny's detector with sub-pixel points in linked chains (thesis,
 * section 2.3). The kernel is canny.h. Where lines that are known already should be, by `lines` of
 * the frame before and the pose of this one, it need not search: guide.h decides.
 */
#include "search.h"

struct edges {
    canny_params p;
    const char *roi;
    search search;
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
    ARRIS_P_BOOL(struct edges, search.guided, "guide", "true",
                 "once lines are known, spares every third frame the search; not with roi"),
};

static int settle(arris_stage *s, void *self, arris_layers *l) {
    struct edges *e = self;
    (void)s;
    search_settle(&e->search, e->roi, l);
    return 0;
}

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
    return search_setup(s, &e->search, p, caps);
}

static int process(arris_stage *s, void *self, arris_frame *f) {
    return search_run(s, &((struct edges *)self)->search, f);
}

static void close_edges(arris_stage *s, void *self) {
    (void)s;
    search_free(&((struct edges *)self)->search);
}

const arris_stage_desc stage_edges = {
    .size = sizeof(arris_stage_desc),
    .name = "edges",
    .summary = "Canny's edges as linked sub-pixel chains",
    .example = "imagesrc location=frames.csv ! edges ! fakesink",
    .layers = {.needs = ARRIS_BIT(ARRIS_IMAGE),
               .wants = ARRIS_BIT(ARRIS_POSE),
               .gives = ARRIS_BIT(ARRIS_EDGES) | ARRIS_BIT(ARRIS_GUIDE),
               .asks = ARRIS_BIT(ARRIS_LINES)},
    .self_size = sizeof(struct edges),
    .props = props,
    .n_props = sizeof props / sizeof *props,
    .settle = settle,
    .setup = setup,
    .process = process,
    .close = close_edges,
};
