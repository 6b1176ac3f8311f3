/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_guide.c: guided search: what is foreseen and which pictures are searched, how a foreseen
 * line is found in the picture and when it is not, and that a scan gives the same lines with it and
 * without.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>
#include <jansson.h>

#include "../plugins/edges/guide.h"
#include "../plugins/segments/segmenter.h"
#include "process.h"
#include "scratch.h"
#include "strip.h"

#define COUNT(a) (sizeof(a) / sizeof *(a))

/* ---- what is foreseen ----------------------------------------------------------------------- */

static const arris_camera thesis = {320,       240,      380.60892, 378.42038, 0.05367, 153.27998,
                                    119.84683, -0.25888, 0.36657,   0.0011,    0.00005, 0};

/* A line upright in the picture at x mm, 800 mm away, known to `sigma` mm, as of so many frames. */
static arris_line known_line(int id, double x, double sigma, uint32_t frames) {
    arris_line l = {.id = id,
                    .state = ARRIS_MEASURED,
                    .into = -1,
                    .p = {x, -100, 800},
                    .q = {x, 100, 800},
                    .views = frames,
                    .seen = frames};
    static const int diagonal[6] = {0, 6, 11, 15, 18, 20};
    for (int i = 0; i < 6; i++)
        l.cov[diagonal[i]] = sigma * sigma;
    return l;
}

static arris_pose at_x(double x) {
    return (arris_pose){.valid = true, .C = {x, 0, 0}, .R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
}

typedef struct scan {
    guide *g;
    arris_line line[2];
    arris_lines lines;
    arris_foreseen item[8];
    arris_guide out;
} scan;

/* Two lines, at x = 0 and 100 mm, seen from there in pictures that were searched. */
static void begin(scan *s) {
    s->g = guide_new(&thesis);
    assert_non_null(s->g);
    s->line[0] = known_line(3, 0, 0.1, 50);
    s->line[1] = known_line(8, 100, 0.1, 50);
    s->lines = (arris_lines){.n = 2, .max = 2, .frames = 50, .item = s->line};
    s->out = (arris_guide){.max = COUNT(s->item), .item = s->item};
    arris_pose at = at_x(0);
    for (int i = 1; i < GUIDE_PERIOD; i++)
        assert_false(guide_decide(s->g, NULL, &at, &s->out)); /* nothing is known yet */
}

/* True: the picture from x mm is not searched. */
static bool decide(scan *s, double x) {
    arris_pose at = at_x(x);
    return guide_decide(s->g, &s->lines, &at, &s->out);
}

static void lines_that_are_sure_are_foreseen(void **state) {
    (void)state;
    scan s;
    begin(&s);
    assert_true(decide(&s, 4));
    assert_int_equal(s.out.n, 2);
    arris_pose at = at_x(4);
    for (int i = 0; i < 2; i++) {
        double x, y;
        arris_project(&thesis, &at, s.line[i].p, &x, &y);
        assert_int_equal(s.item[i].line, s.line[i].id);
        assert_true(fabs(s.item[i].x1 - x) < 1e-9 && fabs(s.item[i].y1 - y) < 1e-9);
        assert_true(fabs(s.item[i].sigma - 0.1 * thesis.fx / 800) < 1e-3);
        assert_true(fabs(s.item[i].dx + 4 * thesis.fx / 800) < 0.3 && fabs(s.item[i].dy) < 0.05);
    }
    assert_true(!arris_camera_distorts(s.out.camera));
    guide_free(s.g);
}

static void others_wait_for_a_search(void **state) {
    (void)state;
    enum { UNSEEN, UNKNOWN, MERGED, STEEP, ELSEWHERE, CASES };
    for (int k = 0; k < CASES; k++) {
        scan s;
        begin(&s);
        arris_line *l = &s.line[1];
        l->seen -= k == UNSEEN;
        l->state = k == UNKNOWN ? ARRIS_UNOBSERVABLE : l->state;
        l->change = k == MERGED ? ARRIS_MERGED : l->change;
        l->q[2] = k == STEEP ? 1000 : l->q[2];
        l->p[0] = l->q[0] = k == ELSEWHERE ? 1000 : 100;
        assert_true(decide(&s, 4));
        assert_int_equal(s.out.n, 1);
        assert_int_equal(s.item[0].line, 3);
        guide_free(s.g);
    }
}

/* Lines 4 px apart are taken for each other, unless their polarity tells them apart. */
static void neighbours_wait_for_a_search(void **state) {
    (void)state;
    for (int k = 0; k < 2; k++) {
        scan s;
        begin(&s);
        s.line[1].p[0] = s.line[1].q[0] = 8;
        s.line[1].p[1] = k ? 100 : -100, s.line[1].q[1] = -s.line[1].p[1];
        assert_int_equal(decide(&s, 4), k);
        assert_int_equal(s.out.n, k ? 2 : 0);
        guide_free(s.g);
    }
}

static void pictures_are_searched_when_they_must_be(void **state) {
    (void)state;
    scan s;
    begin(&s);
    for (int i = 0; i < 20; i++) { /* all but one in GUIDE_PERIOD */
        bool spared = i % GUIDE_PERIOD == 0;
        assert_int_equal(decide(&s, 4 + 4 * i), spared);
        assert_int_equal(s.out.n, spared ? 2 : 0);
    }
    guide_free(s.g);
    begin(&s);
    assert_false(decide(&s, 200)); /* the picture moved by 95 px */
    guide_free(s.g);
    begin(&s);
    arris_pose none = {.valid = false};
    assert_false(guide_decide(s.g, &s.lines, &none, &s.out));
    assert_false(decide(&s, 4)); /* nor is it known how far it moved */
    guide_free(s.g);
    begin(&s);
    assert_false(guide_decide(s.g, &s.lines, NULL, &s.out));
    assert_false(guide_decide(s.g, NULL, &none, &s.out));
    guide_free(s.g);
    begin(&s);
    s.line[0].p[1] = (double)NAN, s.line[1].q[2] = -5; /* not a line; behind the camera */
    assert_false(decide(&s, 4));
    guide_free(s.g);
}

/* ---- looking there -------------------------------------------------------------------------- */

enum { W = 200, H = 180 };

typedef struct bench {
    arris_image image;
    arris_foreseen foreseen;
    arris_guide guide;
    segmenter *segmenter;
    arris_segments segments;
    uint64_t seed;
} bench;

static bench bench_new(void) {
    segmenter_params p = SEGMENTER_DEFAULTS;
    bench b = {.image = picture_new(W, H, ARRIS_GREY8),
               .segmenter = segmenter_new(W, H, &p),
               .segments = segments_new(segmenter_max(W, H)),
               .seed = 0x9E3779B97F4A7C15};
    assert_non_null(b.segmenter);
    return b;
}

static void bench_free(bench *b) {
    free(b->image.data);
    free(b->segments.item);
    segmenter_free(b->segmenter);
}

/* A frame that was searched: these are its edges. */
static void search(bench *b, const arris_edges *edges) {
    segmenter_guide(b->segmenter, NULL, 0);
    segmenter_run(b->segmenter, edges, &b->image, &b->segments);
}

/* The frame after it: looks for an edge from `from` to `to` px from the strip's middle, `off` px to
 * its right at both ends and `turn` px more at the second. */
static const arris_segment *look_again(bench *b, const strip *s, double from, double to, double off,
                                       double turn) {
    double c = cos(s->angle), d = sin(s->angle);
    arris_edges none = {.noise = 2};
    b->foreseen.x1 = s->x + from * c - off * d;
    b->foreseen.y1 = s->y + from * d + off * c;
    b->foreseen.x2 = s->x + to * c - (off + turn) * d;
    b->foreseen.y2 = s->y + to * d + (off + turn) * c;
    b->guide = (arris_guide){.n = 1, .max = 1, .step = 12, .item = &b->foreseen};
    segmenter_guide(b->segmenter, &b->guide, 1);
    segmenter_run(b->segmenter, &none, &b->image, &b->segments);
    return b->segments.n ? b->segments.item : NULL;
}

/* The same when there were no edges. */
static const arris_segment *look(bench *b, const strip *s, double from, double to, double off,
                                 double turn) {
    arris_edges none = {.noise = 2};
    search(b, &none);
    return look_again(b, s, from, to, off, turn);
}

/* Where along the strip a point of the picture is, px from its middle. */
static double along(const strip *s, double x, double y) {
    return (x - s->x) * cos(s->angle) + (y - s->y) * sin(s->angle);
}

static void assert_ends(const strip *s, const arris_segment *g, double from, double to) {
    assert_true(fabs(along(s, g->x1, g->y1) - from) < 4);
    assert_true(fabs(along(s, g->x2, g->y2) - to) < 4);
}

static void a_foreseen_line_is_measured_at_the_bound(void **state) {
    (void)state;
    bench b = bench_new();
    double squares = 0, nees = 0, longer = 0;
    enum { N = 200 };
    for (int i = 0; i < N; i++) {
        strip s = strip_anywhere(W, H, 100, i % 2 ? 40 : 150, &b.seed);
        picture_draw(&b.image, strip_level, &s, 2, &b.seed);
        double off = 0.8 * (2 * rng_uniform(&b.seed) - 1);
        const arris_segment *g = look(&b, &s, -48, 51, off, -off / 2);
        assert_non_null(g);
        assert_int_equal(b.segments.n, 1);
        strip_error e = strip_compare(&s, g);
        double bound = strip_bound(&s, 2, 95, 8);
        squares += e.offset * e.offset / (bound * bound) / N;
        nees += e.nees / N;
        assert_ends(&s, g, -50, 50);
        assert_ends(&s, g, -50, 50);
        longer += (hypot(g->x2 - g->x1, g->y2 - g->y1) - 100) / N;
        assert_int_equal(g->chain, UINT32_MAX);
    }
    print_message("error over the bound %.3f, nees %.3f, %+.2f px longer\n", sqrt(squares), nees,
                  longer);
    assert_true(fabs(longer) < 1);
    assert_true(sqrt(squares) < 1.3);
    assert_true(nees > 0.75 && nees < 1.3);
    bench_free(&b);
}

/* A line that has come farther into the picture, and one that is hidden in part. */
static void ends_are_where_they_are_seen(void **state) {
    (void)state;
    bench b = bench_new();
    for (int i = 0; i < 60; i++) {
        strip s = strip_anywhere(W, H, 100, 80, &b.seed);
        picture_draw(&b.image, strip_level, &s, 2, &b.seed);
        const arris_segment *g = look(&b, &s, -10, 20, 0.3, 0);
        assert_non_null(g);
        assert_ends(&s, g, -50, 50);
        strip part = s; /* the last 40 px are hidden */
        part.length = 60, part.x -= 20 * cos(s.angle), part.y -= 20 * sin(s.angle);
        picture_draw(&b.image, strip_level, &part, 2, &b.seed);
        g = look(&b, &s, -50, 50, 0.3, 0);
        assert_non_null(g);
        assert_ends(&s, g, -50, 10);
    }
    bench_free(&b);
}

/* A gap of some px, where something thin lies before it, does not end a line. */
static void a_short_gap_is_bridged(void **state) {
    (void)state;
    bench b = bench_new();
    strip s = {
        .x = 100, .y = 90, .angle = 1.3, .length = 120, .dark = 50, .bright = 150, .psf = .8};
    picture_draw(&b.image, strip_level, &s, 2, &b.seed);
    for (int y = 100; y < 104; y++)
        memset(b.image.data + y * b.image.stride, 90, W);
    const arris_segment *g = look(&b, &s, -60, 60, 0.2, 0);
    assert_non_null(g);
    assert_true(along(&s, g->x2, g->y2) - along(&s, g->x1, g->y1) > 115);
    assert_true(fabs(strip_compare(&s, g).offset) < 0.02);
    bench_free(&b);
}

static void what_is_not_there_is_not_found(void **state) {
    (void)state;
    bench b = bench_new();
    for (int i = 0; i < 60; i++) {
        strip s = strip_anywhere(W, H, 100, 80, &b.seed), blank = s;
        picture_draw(&b.image, strip_level, &s, 2, &b.seed);
        assert_null(look(&b, &s, -50, 50, 4, 0));    /* 4 px beside it */
        assert_null(look(&b, &s, 50, -50, 0, 0));    /* dark and bright swapped */
        assert_null(look(&b, &s, 70, 90, 0, 0));     /* beyond its end */
        assert_null(look(&b, &s, 0, 0, 0, 0));       /* a point */
        assert_null(look(&b, &s, -50, 50, -30, 60)); /* another direction: what crosses is short */
        assert_null(look(&b, &s, 1e6, 2e6, 0, 0));   /* outside of the picture */
        blank.bright = blank.dark;
        picture_draw(&b.image, strip_level, &blank, 2, &b.seed);
        assert_null(look(&b, &s, -50, 50, 0, 0)); /* it is gone */
        blank.bright = blank.dark + 8;
        picture_draw(&b.image, strip_level, &blank, 2, &b.seed);
        assert_null(look(&b, &s, -50, 50, 0, 0)); /* fainter than what `edges` would find */
        s.length = 12;
        s.bright = s.dark + 80;
        picture_draw(&b.image, strip_level, &s, 2, &b.seed);
        assert_null(look(&b, &s, -50, 50, 0, 0)); /* shorter than min-length */
    }
    bench_free(&b);
}

/* The strip's bright side, with square corners. */
static double plate_level(const void *scene, double x, double y) {
    const strip *s = scene;
    double c = cos(s->angle), d = sin(s->angle), b = strip_blur(s);
    double t = (x - s->x) * c + (y - s->y) * d, u = (y - s->y) * c - (x - s->x) * d;
    return s->dark + (s->bright - s->dark) * normal_below(u / b) *
                         normal_below((s->length / 2 - t) / b) *
                         normal_below((s->length / 2 + t) / b);
}

/* The corners of a blurred line, which rows of pixels cut aslant, do not turn it. */
static void corners_do_not_turn_a_line(void **state) {
    (void)state;
    bench b = bench_new();
    enum { ANGLES = 12, N = 50 };
    double squares = 0;
    for (int k = 0; k < ANGLES; k++) {
        double turn = 0;
        for (int i = 0; i < N; i++) {
            strip s = strip_anywhere(W, H, 60, 120, &b.seed);
            s.psf = 1.4, s.angle = 0.2 + 2 * M_PI * k / ANGLES;
            picture_draw(&b.image, plate_level, &s, 1, &b.seed);
            const arris_segment *g = look(&b, &s, -30, 30, 0, 0);
            assert_non_null(g);
            turn += strip_compare(&s, g).angle * s.length / 2 / N;
        }
        squares += turn * turn / ANGLES;
    }
    print_message("the ends turn by %.4f px\n", sqrt(squares));
    assert_true(sqrt(squares) < 0.004);
    bench_free(&b);
}

typedef struct pair {
    strip a, b;
} pair;

static double pair_level(const void *scene, double x, double y) {
    const pair *p = scene;
    return strip_level(&p->a, x, y) + strip_level(&p->b, x, y);
}

/* Of two parallel lines each stays itself, and is never taken for the other. */
static void neighbours_do_not_swap(void **state) {
    (void)state;
    bench b = bench_new();
    for (double apart = 4; apart < 10; apart++) {
        pair p;
        p.a = strip_anywhere(W, H, 100, 60, &b.seed);
        p.a.dark = 40, p.a.bright = 100;
        p.b = p.a;
        p.b.x -= apart * sin(p.a.angle), p.b.y += apart * cos(p.a.angle);
        picture_draw(&b.image, pair_level, &p, 2, &b.seed);
        for (int k = 0; k < 2; k++) {
            const strip *s = k ? &p.b : &p.a;
            const arris_segment *g = look(&b, s, -45, 45, k ? 0.5 : -0.5, 0);
            assert_true(apart < 6 || g); /* nearer, it leaves them to a search */
            assert_true(!g || fabs(strip_compare(s, g).offset) < 0.5);
        }
    }
    bench_free(&b);
}

/* What the frame before says that there is beside a line is kept off, where it is now. */
static void a_neighbour_does_not_move_it(void **state) {
    (void)state;
    bench b = bench_new();
    double worst = 0, unknown = 0;
    for (int i = 0; i < 40; i++) {
        pair p;
        p.a = strip_anywhere(W, H, 100, 60, &b.seed);
        p.a.dark = 40, p.a.bright = 100;
        p.b = p.a;
        p.b.x -= 9 * sin(p.a.angle), p.b.y += 9 * cos(p.a.angle);
        picture_draw(&b.image, pair_level, &p, 0, &b.seed);
        const arris_segment *g = look(&b, &p.a, -45, 45, 0.3, 0);
        assert_non_null(g);
        unknown = fmax(unknown, fabs(strip_compare(&p.a, g).offset));
        b.foreseen.dx = 20 * rng_uniform(&b.seed), b.foreseen.dy = 20 * rng_uniform(&b.seed);
        arris_edge_point point[200];
        for (int k = 0; k < 200; k++) {
            const strip *s = k < 100 ? &p.a : &p.b;
            point[k].x = (float)(s->x + (k % 100 - 49.5) * cos(s->angle) - b.foreseen.dx);
            point[k].y = (float)(s->y + (k % 100 - 49.5) * sin(s->angle) - b.foreseen.dy);
            point[k].gx = point[k].gy = 20;
        }
        arris_edges before = {.n = 200, .noise = 2, .point = point};
        search(&b, &before);
        g = look_again(&b, &p.a, -45, 45, 0.3, 0);
        assert_non_null(g);
        worst = fmax(worst, fabs(strip_compare(&p.a, g).offset));
        b.foreseen.dx = b.foreseen.dy = 0;
    }
    print_message("moved by %.4f px at most, and %.4f when it is not known\n", worst, unknown);
    assert_true(worst < 0.02 && unknown > 0.03);
    bench_free(&b);
}

/* Where it is not known what is beside the lines, they are left to the next search. */
static void a_lost_search_is_noticed(void **state) {
    (void)state;
    bench b = bench_new();
    strip s = strip_anywhere(W, H, 100, 80, &b.seed);
    picture_draw(&b.image, strip_level, &s, 2, &b.seed);
    assert_non_null(look(&b, &s, -50, 50, 0.3, 0));
    b.guide.searched = 1;
    arris_edges none = {.noise = 2};
    segmenter_guide(b.segmenter, &b.guide, 2);
    segmenter_run(b.segmenter, &none, &b.image, &b.segments);
    assert_int_equal(b.segments.n, 0);
    bench_free(&b);
}

/* ---- a scan --------------------------------------------------------------------------------- */

enum { LINES = 500 };

typedef struct found {
    int n;
    bool measured[LINES]; /* not weak */
    double p[LINES][3], q[LINES][3], sigma[LINES];
} found;

static void measure(const char *name, const char *edges, found *f) {
    char box[4096], line[8192];
    json_error_t e;
    if (!realpath("samples/box/frames.csv", box))
        fail_msg("samples/box is not there: run from the root of the checkout");
    snprintf(line, sizeof line,
             "imagesrc location='%s' ! edges %s ! undistort ! segments ! track ! reconstruct ! "
             "filesink location=lines.json",
             box, edges);
    process p = arris_launch(scratch_mkdir(name), line);
    if (p.code)
        fail_msg("%s", p.err);
    process_free(&p);
    char path[64];
    snprintf(path, sizeof path, "%s/lines.json", name);
    json_t *root = json_load_file(scratch(path), 0, &e), *o;
    size_t i;
    f->n = 0;
    json_array_foreach(json_object_get(root, "lines"), i, o) {
        const char *state;
        json_t *cov;
        double *a = f->p[f->n], *b = f->q[f->n];
        assert_int_equal(json_unpack(o, "{s:[FFF!], s:[FFF!], s:s, s:o}", "p", a, a + 1, a + 2, "q",
                                     b, b + 1, b + 2, "state", &state, "cov", &cov),
                         0);
        f->sigma[f->n] = sqrt(json_number_value(json_array_get(cov, 0)) +
                              json_number_value(json_array_get(cov, 6)) +
                              json_number_value(json_array_get(cov, 11)));
        f->measured[f->n] = strcmp(state, "measured") == 0;
        if (strcmp(state, "unobservable") != 0 && f->n < LINES - 1)
            f->n++;
    }
    json_decref(root);
}

static double distance(const double X[3], const double p[3], const double q[3]) {
    double u[3], d[3], n[3];
    for (int i = 0; i < 3; i++)
        u[i] = q[i] - p[i], d[i] = X[i] - p[i];
    arris_unit(u);
    arris_cross(u, d, n);
    return sqrt(arris_dot(n, n));
}

/* Whether the middle of line i of `a` lies on a line of `b` that is parallel to it. */
static bool is_in(const found *a, int i, const found *b) {
    double X[3], u[3], v[3];
    for (int k = 0; k < 3; k++) {
        X[k] = (a->p[i][k] + a->q[i][k]) / 2;
        u[k] = a->q[i][k] - a->p[i][k];
    }
    arris_unit(u);
    for (int j = 0; j < b->n; j++) {
        for (int k = 0; k < 3; k++)
            v[k] = b->q[j][k] - b->p[j][k];
        arris_unit(v);
        if (fabs(arris_dot(u, v)) > 0.99 &&
            distance(X, b->p[j], b->q[j]) < 1 + 4 * hypot(a->sigma[i], b->sigma[j]))
            return true;
    }
    return false;
}

/* How many measured lines of `a` are not in `b`, not even as weak ones. */
static int missing(const found *a, const found *b) {
    int n = 0;
    for (int i = 0; i < a->n; i++)
        n += a->measured[i] && !is_in(a, i, b);
    return n;
}

static void a_scan_gives_the_same_lines(void **state) {
    (void)state;
    static found guided, whole;
    measure("guided", "", &guided);
    measure("whole", "guide=false", &whole);
    assert_true(guided.n >= 10 && whole.n >= 10);
    assert_int_equal(missing(&whole, &guided), 0);
    assert_int_equal(missing(&guided, &whole), 0);
}

/* It was guided, unless it was told not to, or there was nobody to look there. */
static void it_is_guided_where_it_can_be(void **state) {
    (void)state;
    static const struct {
        const char *line;
        bool guided;
    } cases[] = {
        {"edges ! undistort ! segments ! track ! reconstruct ! fakesink", true},
        {"undistort ! edges ! segments ! track ! reconstruct ! fakesink", true},
        {"edges ! segments ! track ! reconstruct ! fakesink", true},
        {"edges ! queue ! undistort ! segments ! queue ! track ! reconstruct ! fakesink", true},
        {"edges guide=false ! undistort ! segments ! track ! reconstruct ! fakesink", false},
        {"edges roi=0,0,300,200 ! undistort ! segments ! track ! reconstruct ! fakesink", false},
        {"edges ! undistort ! segments mode=thesis ! track ! reconstruct ! fakesink", false},
        {"edges ! undistort ! segments ! track ! fakesink", false},
        {"edges ! fakesink", false},
    };
    for (size_t i = 0; i < COUNT(cases); i++) {
        char line[1024];
        snprintf(line, sizeof line, "launch --stats imagesrc location=samples/box/frames.csv ! %s",
                 cases[i].line);
        process p = arris_run(line);
        if (p.code || !!strstr(p.out, "lines foreseen") != cases[i].guided)
            fail_msg("%s\n%s%s", line, p.out, p.err);
        process_free(&p);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lines_that_are_sure_are_foreseen),
        cmocka_unit_test(others_wait_for_a_search),
        cmocka_unit_test(neighbours_wait_for_a_search),
        cmocka_unit_test(pictures_are_searched_when_they_must_be),
        cmocka_unit_test(a_foreseen_line_is_measured_at_the_bound),
        cmocka_unit_test(ends_are_where_they_are_seen),
        cmocka_unit_test(a_short_gap_is_bridged),
        cmocka_unit_test(what_is_not_there_is_not_found),
        cmocka_unit_test(corners_do_not_turn_a_line),
        cmocka_unit_test(neighbours_do_not_swap),
        cmocka_unit_test(a_neighbour_does_not_move_it),
        cmocka_unit_test(a_lost_search_is_noticed),
        cmocka_unit_test(a_scan_gives_the_same_lines),
        cmocka_unit_test(it_is_guided_where_it_can_be),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
