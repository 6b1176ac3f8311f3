/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * tuning.c: the stage `tuning` of the experiment that reproduces section 3.4 of the thesis: what a
 * set of the parameters of `segments` makes of the true edges, in the pictures and in 3D. It prints
 * one row of the table and draws one frame.
 */
#include "arris_plugin.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "../figure.h"
#include "../truth.h"

static const double near = 1.5;     /* px, from a segment to the true edge that it lies on */
static const double aligned = 0.98; /* the cosine of 11° */
static const double beside = 4;     /* mm, from a line to the edge that it is, seen from above */

typedef struct tuning {
    const char *truth_path, *figure, *label;
    int32_t frame;
    truth truth;
    truth_pixel *pixel;
    double *error; /* mm, of the edges that were measured */
    uint64_t frames, segments, on_edges, seen, covered;
    double length, squares; /* px, px² */
} tuning;

static const arris_prop props[] = {
    ARRIS_P_INFILE(tuning, truth_path, "truth", NULL, "the object's visible edges, as CSV"),
    ARRIS_P_STRING(tuning, figure, "figure", NULL, "the SVG that is written"),
    ARRIS_P_INT(tuning, frame, "frame", "67", 0, 1e9, NULL, "the frame that is drawn"),
    ARRIS_P_STRING(tuning, label, "label", "set", "what the table calls these parameters"),
};

/* ---- in the picture ------------------------------------------------------------------------- */

/* How far the segment lies from a point of an edge, across it; NAN when it does not lie there. */
static double offset(const arris_segment *s, const truth_pixel *p) {
    double dx = s->x2 - s->x1, dy = s->y2 - s->y1, n = hypot(dx, dy);
    double x = p->x - s->x1, y = p->y - s->y1;
    double at = (x * dx + y * dy) / n, off = (x * dy - y * dx) / n;
    bool lies = at >= -1 && at <= n + 1 && fabs(off) <= near &&
                fabs(dy * p->nx - dx * p->ny) >= aligned * n;
    return lies ? off : NAN;
}

static bool lies_on_an_edge(const tuning *t, const arris_segment *s) {
    for (uint32_t i = 0; i < t->truth.n; i++)
        if (t->pixel[i].seen && !isnan(offset(s, &t->pixel[i])))
            return true;
    return false;
}

/* Adds a point of the truth: covered when a segment lies on it, by the nearest. */
static void add_point(tuning *t, const arris_segments *s, const truth_pixel *p) {
    double best = INFINITY;
    for (uint32_t i = 0; i < s->n; i++) {
        double off = offset(&s->item[i], p);
        if (fabs(off) < best)
            best = fabs(off);
    }
    t->seen++;
    t->covered += best <= near;
    t->squares += best <= near ? best * best : 0;
}

static void add_frame(tuning *t, const arris_segments *s) {
    t->frames++;
    t->segments += s->n;
    for (uint32_t i = 0; i < s->n; i++) {
        t->length += hypot(s->item[i].x2 - s->item[i].x1, s->item[i].y2 - s->item[i].y1);
        t->on_edges += lies_on_an_edge(t, &s->item[i]);
    }
    for (uint32_t i = 0; i < t->truth.n; i++)
        if (t->pixel[i].seen)
            add_point(t, s, &t->pixel[i]);
}

/* Draws the segments where the lens's picture has them, each in another colour than the next. */
static int draw(const tuning *t, const arris_image *im, const arris_segments *s) {
    static const char *const colours[] = {"#ff9830", "#40d0ff", "#60e060", "#ff60c0", "#f0f040"};
    FILE *f = figure_open(t->figure, 1, 1, im->width, im->height);
    if (!f)
        return ARRIS_E_IO;
    figure_panel(f, 0, 0, t->label, im, 0.6);
    for (uint32_t i = 0; i < s->n; i++) {
        double x1, y1, x2, y2;
        arris_distort(im->camera, s->item[i].x1, s->item[i].y1, &x1, &y1);
        arris_distort(im->camera, s->item[i].x2, s->item[i].y2, &x2, &y2);
        figure_line(f, colours[i % 5], x1, y1, x2, y2);
        figure_circle(f, colours[i % 5], x1, y1);
        figure_circle(f, colours[i % 5], x2, y2);
    }
    figure_panel_end(f);
    return figure_close(f);
}

/* ---- in 3D ---------------------------------------------------------------------------------- */

/* The depth error of a line that is the edge as seen from above, whatever its depth within 5 %; NAN
 * when it is another's. */
static double depth_error(const truth_edge *e, const arris_line *l) {
    double dx = e->q[0] - e->p[0], dy = e->q[1] - e->p[1], n = hypot(dx, dy);
    double lx = l->q[0] - l->p[0], ly = l->q[1] - l->p[1], m = hypot(lx, ly);
    double x = (l->p[0] + l->q[0]) / 2 - e->p[0], y = (l->p[1] + l->q[1]) / 2 - e->p[1];
    double at = (x * dx + y * dy) / n, z = e->p[2] + at / n * (e->q[2] - e->p[2]);
    double off = (l->p[2] + l->q[2]) / 2 - z;
    bool is = l->state == ARRIS_MEASURED && fabs(lx * dx + ly * dy) >= aligned * n * m && at > 0 &&
              at < n && fabs(x * dy - y * dx) / n < beside && fabs(off) < 0.05 * z;
    return is ? off : NAN;
}

/* Collects the depth error of every edge that was measured, by the nearest of its lines' middles;
 * returns how many edges those are. `lines` counts the lines. */
static uint32_t measure(tuning *t, const arris_lines *l, uint32_t *lines) {
    uint32_t edges = 0;
    for (uint32_t k = 0; k < t->truth.n_edges; k++) {
        uint32_t of_edge = 0;
        for (uint32_t i = 0; i < l->n; i++) {
            double off = depth_error(&t->truth.edge[k], &l->item[i]);
            if (!isnan(off))
                t->error[*lines + of_edge++] = fabs(off);
        }
        *lines += of_edge;
        edges += of_edge > 0;
    }
    return edges;
}

static void print_row(tuning *t, const arris_lines *l) {
    double frames = (double)t->frames;
    uint32_t lines = 0, edges = measure(t, l, &lines);
    printf("%-30s %8.1f %8.1f %8.1f %8.1f %8.3f   %5u %4u/%u %8.2f\n", t->label,
           (double)t->segments / frames, t->length / (double)t->segments,
           (double)t->on_edges / frames, 100. * (double)t->covered / (double)t->seen,
           sqrt(t->squares / (double)t->covered), lines, edges, t->truth.n_edges,
           median(t->error, lines));
}

/* ---- the stage ------------------------------------------------------------------------------ */

static int setup(arris_stage *s, void *self, arris_caps *caps) {
    tuning *t = self;
    if (!t->truth_path || !t->figure)
        return arris_fail(s, ARRIS_E_USAGE, "truth=EDGES.csv figure=FILE.svg",
                          "it has to know the true edges and where the figure goes");
    if (caps->format != ARRIS_GREY8 || !caps->camera)
        return arris_fail(s, ARRIS_E_INPUT, NULL, "it takes pictures of 8 bits with a camera.json");
    int e = truth_read(s, t->truth_path, &t->truth);
    if (e)
        return e;
    t->pixel = calloc(t->truth.n + 1, sizeof *t->pixel);
    t->error = calloc((arris_capacity(s, ARRIS_LINES, NULL) + 1) * (t->truth.n_edges + 1),
                      sizeof *t->error);
    return t->pixel && t->error ? 0
                                : arris_fail(s, ARRIS_E_MEMORY, NULL, "no memory for the truth");
}

static int process(arris_stage *s, void *self, arris_frame *f) {
    tuning *t = self;
    const arris_segments *segments = arris_layer_get(f, ARRIS_SEGMENTS);
    truth_project(&t->truth, segments->camera, arris_layer_get(f, ARRIS_POSE), t->pixel);
    add_frame(t, segments);
    if (arris_frame_seq(f) == (uint64_t)t->frame &&
        draw(t, arris_layer_get(f, ARRIS_IMAGE), segments))
        return arris_fail(s, ARRIS_E_IO, NULL, "cannot write the figure %s", t->figure);
    return 0;
}

static int finish(arris_stage *s, void *self, arris_frame *f) {
    const arris_lines *lines = arris_layer_get(f, ARRIS_LINES);
    if (!lines)
        return arris_fail(s, ARRIS_E_INPUT, NULL, "there are no lines at the end");
    print_row(self, lines);
    return 0;
}

static void close_tuning(arris_stage *s, void *self) {
    tuning *t = self;
    (void)s;
    truth_free(&t->truth);
    free(t->pixel);
    free(t->error);
}

const arris_stage_desc stage_tuning = {
    .size = sizeof(arris_stage_desc),
    .name = "tuning",
    .summary = "what a set of parameters makes of the true edges",
    .flags = ARRIS_SINK,
    .layers = {.needs = ARRIS_BIT(ARRIS_IMAGE) | ARRIS_BIT(ARRIS_POSE) | ARRIS_BIT(ARRIS_SEGMENTS) |
                        ARRIS_BIT(ARRIS_LINES)},
    .self_size = sizeof(tuning),
    .props = props,
    .n_props = sizeof props / sizeof *props,
    .setup = setup,
    .process = process,
    .finish = finish,
    .close = close_tuning,
};
