/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * features.c: the stage `features` of the experiment that reproduces section 2.3 of the thesis:
 * edges, corners and optical flow of two frames side by side, judged by the true edges.
 *
 * The truth is a row of points on the object's edges. A method describes a point when it has a
 * feature there: an edge along it, a corner at it, a step of the flow across it. The true poses and
 * the point's depth say where that feature is in the second frame, and it is found again when the
 * method puts it there, within a pixel. An edge and the flow are measured across the edge only,
 * which is all that either can know of it; and the flow is taken at the true point, which is kind,
 * since its own step lies elsewhere.
 */
#include "arris_plugin.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../figure.h"
#include "../truth.h"

static const double near = 1.5;       /* px, from a feature to the point that it describes */
static const double again = 1;        /* px, from a feature to where it should be */
static const double along = 0.75;     /* px, that an edge point may be off along the edge */
static const double aligned = 0.94;   /* the cosine of 20° */
static const double least_step = 0.1; /* px, a change of the flow that is more than its noise */

/* What a frame holds. */
typedef struct shot {
    arris_image image;
    arris_edges edges;
    arris_corners corners;
    truth_pixel *pixel;
} shot;

typedef struct features {
    const char *truth_path, *figure, *label;
    truth truth;
    shot first, second;
    const arris_flow *flow;
    double *error;
} features;

static const arris_prop props[] = {
    ARRIS_P_INFILE(features, truth_path, "truth", NULL, "the object's visible edges, as CSV"),
    ARRIS_P_STRING(features, figure, "figure", NULL, "the SVG that is written"),
    ARRIS_P_STRING(features, label, "label", "scene", "what the table calls this scene"),
};

/* ---- the methods: how far the feature that describes a point is from where it should be ------ */

typedef struct finding {
    bool described;
    double error; /* px, NAN when it wasn't found again */
} finding;

/* The edge point beside `at` that is the nearest to `about` px across the edge: how far it is from
 * there; NAN when there is none within `reach`. */
static double nearest_edge(const arris_edges *e, const truth_pixel *at, double about,
                           double reach) {
    double best = NAN;
    for (uint32_t i = 0; i < e->n; i++) {
        const arris_edge_point *p = &e->point[i];
        double dx = (double)p->x - at->x, dy = (double)p->y - at->y;
        double gx = (double)p->gx, gy = (double)p->gy;
        double off = dx * at->nx + dy * at->ny - about;
        if (fabs(dx * at->ny - dy * at->nx) <= along && fabs(off) <= reach &&
            fabs(gx * at->nx + gy * at->ny) >= aligned * hypot(gx, gy) && !(fabs(off) > fabs(best)))
            best = off;
    }
    return best;
}

static finding find_edge(const features *f, uint32_t i) {
    double off = nearest_edge(&f->first.edges, &f->first.pixel[i], 0, near);
    return (finding){!isnan(off), nearest_edge(&f->second.edges, &f->second.pixel[i], off, again)};
}

/* The corner nearest to (x, y), NULL when there is none within `reach`. */
static const arris_corner *nearest_corner(const arris_corners *c, double x, double y,
                                          double reach) {
    const arris_corner *best = NULL;
    for (uint32_t i = 0; i < c->n; i++) {
        double r = hypot((double)c->item[i].x - x, (double)c->item[i].y - y);
        if (r <= reach) {
            reach = r;
            best = &c->item[i];
        }
    }
    return best;
}

static finding find_corner(const features *f, uint32_t i) {
    const truth_pixel *a = &f->first.pixel[i], *b = &f->second.pixel[i];
    const arris_corner *c = nearest_corner(&f->first.corners, a->x, a->y, near);
    if (!c)
        return (finding){false, NAN};
    double x = b->x + (double)c->x - a->x, y = b->y + (double)c->y - a->y;
    const arris_corner *d = nearest_corner(&f->second.corners, x, y, again);
    return (finding){true, d ? hypot((double)d->x - x, (double)d->y - y) : NAN};
}

/* The flow at the pixel that is `k` px from the point across its edge. */
static const float *flow_at(const float *plane, const arris_flow *flow, const truth_pixel *at,
                            int k) {
    long x = lround(fmin(fmax(at->x + k * at->nx, 0), flow->width - 1));
    long y = lround(fmin(fmax(at->y + k * at->ny, 0), flow->height - 1));
    return &plane[y * flow->width + x];
}

/* How far from the point, across its edge, the flow changes most; NAN when it doesn't change. */
static double nearest_step(const arris_flow *flow, const truth_pixel *at) {
    double most = least_step, where = NAN;
    for (int k = -6; k <= 6; k++) {
        double du =
            (double)(*flow_at(flow->u, flow, at, k + 2) - *flow_at(flow->u, flow, at, k - 2));
        double dv =
            (double)(*flow_at(flow->v, flow, at, k + 2) - *flow_at(flow->v, flow, at, k - 2));
        if (hypot(du, dv) > most) {
            most = hypot(du, dv);
            where = k;
        }
    }
    return where;
}

static finding find_flow(const features *f, uint32_t i) {
    const truth_pixel *a = &f->first.pixel[i], *b = &f->second.pixel[i];
    double u = (double)*flow_at(f->flow->u, f->flow, a, 0) - (b->x - a->x);
    double v = (double)*flow_at(f->flow->v, f->flow, a, 0) - (b->y - a->y);
    double off = u * b->nx + v * b->ny;
    return (finding){fabs(nearest_step(f->flow, a)) <= near, fabs(off) <= again ? off : NAN};
}

/* ---- the table ------------------------------------------------------------------------------ */

static void print_row(features *f, const char *method, uint32_t count,
                      finding (*find)(const features *, uint32_t)) {
    uint32_t points = 0, described = 0, found = 0;
    for (uint32_t i = 0; i < f->truth.n; i++) {
        if (!f->first.pixel[i].seen || !f->second.pixel[i].seen)
            continue;
        finding r = find(f, i);
        points++;
        described += r.described;
        if (r.described && !isnan(r.error))
            f->error[found++] = fabs(r.error);
    }
    printf("%-24s %-8s %8u   %9.1f   %11.1f   %6.1f   %12.3f\n", f->label, method, count,
           100. * described / points, 100. * found / fmax(described, 1), 100. * found / points,
           median(f->error, found));
}

static void print_table(features *f) {
    print_row(f, "edges", f->second.edges.n_chains, find_edge);
    print_row(f, "corners", f->second.corners.n, find_corner);
    print_row(f, "flow", (uint32_t)(f->flow->width * f->flow->height), find_flow);
}

/* ---- the figure ----------------------------------------------------------------------------- */

static const char *const colours[] = {"#ff9830", "#40d0ff"}; /* the first frame and the second */

static void draw_edges(FILE *f, const arris_edges *e, const char *colour) {
    for (uint32_t i = 0; i < e->n_chains; i++)
        figure_chain(f, colour, &e->point[e->chain[i].first], e->chain[i].n);
}

static void draw_corners(FILE *f, const arris_corners *c, const char *colour,
                         void (*mark)(FILE *, const char *, double, double)) {
    for (uint32_t i = 0; i < c->n; i++)
        mark(f, colour, (double)c->item[i].x, (double)c->item[i].y);
}

static void draw_flow(FILE *f, int column, const char *title, const arris_flow *flow,
                      uint8_t *grey) {
    arris_image im = {ARRIS_GREY8, flow->width, flow->height, flow->width, NULL, grey};
    figure_panel(f, column, 1, title, &im, 1);
    figure_panel_end(f);
}

static int draw(const features *w) {
    const arris_image *im = &w->second.image;
    FILE *f = figure_open(w->figure, 2, 2, im->width, im->height);
    if (!f)
        return ARRIS_E_IO;
    figure_panel(f, 0, 0, "edges: first frame orange, second blue", im, 0.6);
    draw_edges(f, &w->first.edges, colours[0]);
    draw_edges(f, &w->second.edges, colours[1]);
    figure_panel_end(f);
    figure_panel(f, 1, 0, "corners: first frame circles, second crosses", im, 0.6);
    draw_corners(f, &w->first.corners, colours[0], figure_circle);
    draw_corners(f, &w->second.corners, colours[1], figure_cross);
    figure_panel_end(f);
    draw_flow(f, 0, "flow in x: grey none, dark to the left, light to the right", w->flow,
              w->flow->grey_u);
    draw_flow(f, 1, "flow in y: grey none, dark up, light down", w->flow, w->flow->grey_v);
    return figure_close(f);
}

/* ---- the stage ------------------------------------------------------------------------------ */

/* The first frame's features are copied, since its layers are gone when the second comes. */
static bool reserve(arris_stage *s, features *w) {
    size_t chains = 0, points = arris_capacity(s, ARRIS_EDGES, &chains);
    shot *a = &w->first;
    a->edges.point = calloc(points, sizeof *a->edges.point);
    a->edges.chain = calloc(chains, sizeof *a->edges.chain);
    a->corners.item = calloc(arris_capacity(s, ARRIS_CORNERS, NULL), sizeof *a->corners.item);
    a->pixel = calloc(w->truth.n + 1, sizeof *a->pixel);
    w->second.pixel = calloc(w->truth.n + 1, sizeof *a->pixel);
    w->error = calloc(w->truth.n + 1, sizeof *w->error);
    return a->edges.point && a->edges.chain && a->corners.item && a->pixel && w->second.pixel &&
           w->error;
}

static int setup(arris_stage *s, void *self, arris_caps *caps) {
    features *w = self;
    if (!w->truth_path || !w->figure)
        return arris_fail(s, ARRIS_E_USAGE, "truth=EDGES.csv figure=FILE.svg",
                          "it has to know the true edges and where the figure goes");
    if (caps->format != ARRIS_GREY8 || !caps->camera)
        return arris_fail(s, ARRIS_E_INPUT, NULL, "it takes pictures of 8 bits with a camera.json");
    int e = truth_read(s, w->truth_path, &w->truth);
    if (e == 0 && !reserve(s, w))
        e = arris_fail(s, ARRIS_E_MEMORY, NULL, "no memory for the frames' features");
    return e;
}

static void copy_first(shot *a, const arris_edges *e, const arris_corners *c) {
    a->edges.n = e->n;
    a->edges.n_chains = e->n_chains;
    a->corners.n = c->n;
    memcpy(a->edges.point, e->point, e->n * sizeof *e->point);
    memcpy(a->edges.chain, e->chain, e->n_chains * sizeof *e->chain);
    memcpy(a->corners.item, c->item, c->n * sizeof *c->item);
}

static int process(arris_stage *s, void *self, arris_frame *f) {
    features *w = self;
    uint64_t seq = arris_frame_seq(f);
    const arris_image *image = arris_layer_get(f, ARRIS_IMAGE);
    const arris_edges *edges = arris_layer_get(f, ARRIS_EDGES);
    const arris_corners *corners = arris_layer_get(f, ARRIS_CORNERS);
    truth_project(&w->truth, image->camera, arris_layer_get(f, ARRIS_POSE),
                  seq ? w->second.pixel : w->first.pixel);
    if (seq == 0)
        copy_first(&w->first, edges, corners);
    if (seq != 1)
        return 0;
    w->second.image = *image;
    w->second.edges = *edges;
    w->second.corners = *corners;
    w->flow = arris_layer_get(f, ARRIS_FLOW);
    print_table(w);
    if (draw(w))
        return arris_fail(s, ARRIS_E_IO, NULL, "cannot write the figure %s", w->figure);
    return 0;
}

static int finish(arris_stage *s, void *self, arris_frame *f) {
    (void)self;
    return arris_frame_seq(f) == 2 ? 0 : arris_fail(s, ARRIS_E_INPUT, NULL, "it takes two frames");
}

static void close_features(arris_stage *s, void *self) {
    features *w = self;
    (void)s;
    truth_free(&w->truth);
    free(w->first.edges.point);
    free(w->first.edges.chain);
    free(w->first.corners.item);
    free(w->first.pixel);
    free(w->second.pixel);
    free(w->error);
}

const arris_stage_desc stage_features = {
    .size = sizeof(arris_stage_desc),
    .name = "features",
    .summary = "edges, corners and flow of two frames beside the true edges",
    .flags = ARRIS_SINK,
    .layers = {.needs = ARRIS_BIT(ARRIS_IMAGE) | ARRIS_BIT(ARRIS_POSE) | ARRIS_BIT(ARRIS_EDGES) |
                        ARRIS_BIT(ARRIS_CORNERS) | ARRIS_BIT(ARRIS_FLOW)},
    .self_size = sizeof(features),
    .props = props,
    .n_props = sizeof props / sizeof *props,
    .setup = setup,
    .process = process,
    .finish = finish,
    .close = close_features,
};
