/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_segments.c: chains to segments, and their lines against edges that are known exactly: the
 * Cramér-Rao bound, the stated covariance, and what must not break it.
 *
 * Chains are made up along the true edges, with the scatter that edge points have. The last part
 * runs the program on pictures, with the chains that `edges` finds.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "arris_geometry.h"
#include "process.h"
#include "scratch.h"
#include "segments/huber.h"
#include "segments/merge.h"
#include "segments/segmenter.h"
#include "segments/split.h"
#include "segments/step.h"
#include "strip.h"

#define COUNT(a) (sizeof(a) / sizeof *(a))

/* ---- chains --------------------------------------------------------------------------------- */

enum { MAX_POINTS = 200000, MAX_CHAINS = 20000 };

static arris_edges edges_new(void) {
    arris_edges e = {.max = MAX_POINTS, .max_chains = MAX_CHAINS};
    e.point = calloc(MAX_POINTS, sizeof *e.point);
    e.chain = calloc(MAX_CHAINS, sizeof *e.chain);
    assert_non_null(e.point);
    assert_non_null(e.chain);
    return e;
}

static void edges_clear(arris_edges *e) {
    e->n = e->n_chains = 0;
}

static void edges_free(arris_edges *e) {
    free(e->point);
    free(e->chain);
}

/* Appends a point to the last chain. */
static void point(arris_edges *e, double x, double y, double gx, double gy) {
    assert_true(e->n < e->max);
    e->point[e->n++] = (arris_edge_point){(float)x, (float)y, (float)gx, (float)gy};
    e->chain[e->n_chains - 1].n++;
}

static void chain_begin(arris_edges *e) {
    assert_true(e->n_chains < e->max_chains);
    e->chain[e->n_chains++] = (arris_chain){.first = e->n};
}

/* Goes on with the chain from p to q, a point a pixel, each off by `scatter` (sigma). */
static void walk(arris_edges *e, double px, double py, double qx, double qy, double gradient,
                 double scatter, uint64_t *seed) {
    double dx = qx - px, dy = qy - py, length = hypot(dx, dy);
    int steps = (int)fmax(fabs(dx), fabs(dy));
    for (int i = 0; i <= steps; i++) {
        double t = (double)i / (steps ? steps : 1),
               d = scatter > 0 ? scatter * rng_normal(seed) : 0;
        point(e, px + t * dx - d * dy / length, py + t * dy + d * dx / length,
              -gradient * dy / length, gradient * dx / length);
    }
}

/* A chain along a strip's edge, from `from` to `to` px from its middle. */
static void chain_along(arris_edges *e, const strip *s, double from, double to, double scatter,
                        uint64_t *seed) {
    double c = cos(s->angle), d = sin(s->angle);
    double blur = sqrt(s->psf * s->psf + 1. / 12 + 4. / 3);
    chain_begin(e);
    walk(e, s->x + from * c, s->y + from * d, s->x + to * c, s->y + to * d,
         (s->bright - s->dark) / (sqrt(2 * M_PI) * blur), scatter, seed);
}

/* ---- a bench of picture, chains and segments ------------------------------------------------ */

typedef struct bench {
    arris_image image;
    arris_edges edges;
    segmenter *segmenter;
    arris_segments segments;
    uint64_t seed;
} bench;

static bench bench_new(int width, int height, enum arris_format format,
                       const segmenter_params *params) {
    segmenter_params p = SEGMENTER_DEFAULTS;
    bench b = {.image = picture_new(width, height, format),
               .edges = edges_new(),
               .segmenter = segmenter_new(width, height, params ? params : &p),
               .segments = segments_new(segmenter_max(width, height)),
               .seed = 0x9E3779B97F4A7C15};
    assert_non_null(b.segmenter);
    return b;
}

static void bench_free(bench *b) {
    free(b->image.data);
    edges_free(&b->edges);
    segmenter_free(b->segmenter);
    free(b->segments.item);
}

static void bench_run(bench *b) {
    segmenter_run(b->segmenter, &b->edges, &b->image, &b->segments);
    for (uint32_t i = 0; i < b->segments.n; i++) {
        const arris_segment *g = &b->segments.item[i];
        const double v[] = {g->x1,         g->y1,           g->x2,          g->y2,
                            g->cov[0],     g->cov[1],       g->cov[2],      (double)g->lo,
                            (double)g->hi, (double)g->blur, (double)g->chi2};
        for (size_t k = 0; k < COUNT(v); k++)
            assert_true(isfinite(v[k]));
        assert_true(g->cov[0] > 0 && g->cov[2] > 0);
        assert_true(g->cov[0] * g->cov[2] > g->cov[1] * g->cov[1]);
        assert_true(g->hi >= g->lo);
    }
}

/* Draws the strip and lays one chain along its edge. */
static void bench_strip(bench *b, const strip *s, double noise, double scatter) {
    picture_draw(&b->image, strip_level, s, noise, &b->seed);
    edges_clear(&b->edges);
    chain_along(&b->edges, s, -s->length / 2, s->length / 2, scatter, &b->seed);
    b->edges.noise = (float)sqrt(noise * noise + 1. / 12);
    bench_run(b);
}

/* Errors over many poses: RMS in multiples of the bound, mean, normalised squared error. */
typedef struct summary {
    int poses, found;
    double offset, angle, mean, nees, chi2, blur;
} summary;

static void summary_add(summary *m, const strip *s, const arris_segments *all, double noise) {
    const arris_segment *g = strip_find(s, all);
    m->poses++;
    if (!g)
        return;
    double fitted = hypot(g->x2 - g->x1, g->y2 - g->y1) - 5,
           bound = strip_bound(s, noise, fitted, 8);
    strip_error e = strip_compare(s, g);
    double a = e.offset / bound, b = e.angle * fitted / (sqrt(12) * bound);
    m->found++;
    m->offset += a * a, m->angle += b * b, m->mean += a, m->nees += e.nees;
    m->chi2 += (double)g->chi2, m->blur += (double)g->blur;
}

static summary summary_end(summary m) {
    double n = m.found;
    return (summary){m.poses,    m.found,    sqrt(m.offset / n), sqrt(m.angle / n),
                     m.mean / n, m.nees / n, m.chi2 / n,         m.blur / n};
}

/* Many poses of one kind of strip; `change` makes it special. */
static summary measure(double noise, double contrast, double length, int poses,
                       void (*change)(strip *, uint64_t *)) {
    int size = (int)length + 50;
    bench b = bench_new(size, size, ARRIS_GREY8, NULL);
    summary m = {0};
    for (int i = 0; i < poses; i++) {
        strip s = strip_anywhere(size, size, length, contrast, &b.seed);
        if (change)
            change(&s, &b.seed);
        bench_strip(&b, &s, noise, 0.2);
        summary_add(&m, &s, &b.segments, noise);
    }
    bench_free(&b);
    return summary_end(m);
}

static void assert_within(double value, double low, double high) {
    if (!(value >= low && value <= high))
        fail_msg("%g is not within %g and %g", value, low, high);
}

/* ---- splitting ------------------------------------------------------------------------------ */

static void corners_are(arris_edges *e, double tol, bool greedy, const uint32_t *expected,
                        uint32_t n) {
    uint32_t corner[1000];
    assert_true(e->n <= COUNT(corner));
    assert_int_equal(split_chain(e->point, e->n, tol, greedy, corner), n);
    assert_memory_equal(corner, expected, n * sizeof *corner);
}

static void a_corner_splits(void **state) {
    (void)state;
    arris_edges e = edges_new();
    chain_begin(&e);
    walk(&e, 10, 10, 40, 10, 1, 0, NULL);
    e.n--; /* the corner once */
    walk(&e, 40, 10, 40, 50, 1, 0, NULL);
    corners_are(&e, 2, false, (uint32_t[]){0, 30, 70}, 3);
    corners_are(&e, 2, true, (uint32_t[]){0, 30, 70}, 3);
    corners_are(&e, 100, false, (uint32_t[]){0, 70}, 2);
    edges_free(&e);
}

/* Around a square and back to the beginning: the chord has no length. */
static void a_closed_chain_splits(void **state) {
    (void)state;
    arris_edges e = edges_new();
    chain_begin(&e);
    const int corner[5][2] = {{10, 10}, {50, 10}, {50, 50}, {10, 50}, {10, 10}};
    for (int k = 0; k < 4; k++) {
        e.n -= k > 0;
        walk(&e, corner[k][0], corner[k][1], corner[k + 1][0], corner[k + 1][1], 1, 0, NULL);
    }
    corners_are(&e, 2, false, (uint32_t[]){0, 40, 80, 120, 160}, 5);
    edges_free(&e);
}

/* maxlinedev: the distance is from the infinite chord, so what juts out beyond an end along the
 * line is no deviation. */
static void the_chord_is_infinite(void **state) {
    (void)state;
    arris_edges e = edges_new();
    chain_begin(&e);
    walk(&e, 20, 10, 60, 10, 1, 0, NULL);
    walk(&e, 60, 11, 10, 10, 1, 0, NULL);
    corners_are(&e, 1.5, false, (uint32_t[]){0, e.n - 1}, 2);
    edges_free(&e);
}

/* Kovesi's lineseg starts again at the chain's end after every piece: on a bent chain it finds
 * other corners than one that keeps those it found. */
static void greedy_looks_again(void **state) {
    (void)state;
    arris_edges e = edges_new();
    uint32_t a[1000], b[1000];
    chain_begin(&e);
    for (int i = 0; i <= 120; i++)
        point(&e, i, i * i / 200., 0, 1);
    uint32_t n = split_chain(e.point, e.n, 2, true, a), m = split_chain(e.point, e.n, 2, false, b);
    assert_true(n > 2 && m > 2);
    for (uint32_t k = 0; k + 1 < n; k++) { /* a piece is the longest of the repeated halving */
        uint32_t sub[1000], from = a[k];
        split_chain(e.point + from, e.n - from, 2, false, sub);
        assert_int_equal(a[k + 1], from + sub[1]);
    }
    edges_free(&e);
}

/* ---- joining -------------------------------------------------------------------------------- */

static int compare_segments(const void *a, const void *b) {
    return memcmp(a, b, 4 * sizeof(double));
}

/* The segments in an order of their own, without the chains' numbers. */
static void sort_segments(arris_segments *s) {
    for (uint32_t i = 0; i < s->n; i++)
        s->item[i].chain = 0;
    qsort(s->item, s->n, sizeof *s->item, compare_segments);
}

/* Lines all over, each broken into chains by gaps that may or may not be bridged. */
static void broken_lines(arris_edges *e, uint64_t *seed) {
    edges_clear(e);
    for (int i = 0; i < 40; i++) {
        double x = 20 + 280 * rng_uniform(seed), y = 20 + 200 * rng_uniform(seed);
        double a = 2 * M_PI * rng_uniform(seed);
        for (int k = 0; k < 4; k++) {
            double l = 8 + 12 * rng_uniform(seed), gap = 3 * rng_uniform(seed);
            chain_begin(e);
            walk(e, x, y, x + l * cos(a), y + l * sin(a), 10, 0.2, seed);
            x += (l + gap) * cos(a), y += (l + gap) * sin(a);
            a += 0.06 * (rng_uniform(seed) - 0.5);
        }
    }
}

static void shuffle(arris_edges *e, uint64_t *seed) {
    for (uint32_t i = e->n_chains - 1; i > 0; i--) {
        uint32_t j = (uint32_t)(rng_uniform(seed) * (i + 1));
        arris_chain c = e->chain[i];
        e->chain[i] = e->chain[j], e->chain[j] = c;
    }
}

static void order_has_no_influence(void **state) {
    (void)state;
    for (int mode = SEGMENTER_REFIT; mode <= SEGMENTER_THESIS; mode++) {
        segmenter_params p = SEGMENTER_DEFAULTS;
        p.mode = mode;
        bench b = bench_new(320, 240, ARRIS_GREY8, &p);
        broken_lines(&b.edges, &b.seed);
        arris_segments first = segments_new(b.segments.max);
        segmenter_run(b.segmenter, &b.edges, NULL, &first);
        sort_segments(&first);
        assert_in_range(first.n, 40, b.edges.n_chains - 40); /* some are joined, not all */
        for (int k = 0; k < 20; k++) {
            shuffle(&b.edges, &b.seed);
            segmenter_run(b.segmenter, &b.edges, NULL, &b.segments);
            sort_segments(&b.segments);
            assert_int_equal(b.segments.n, first.n);
            assert_memory_equal(b.segments.item, first.item, first.n * sizeof *first.item);
        }
        free(first.item);
        bench_free(&b);
    }
}

/* Three pieces, each turned by 0.04 rad from the one before: the third is within angtol of the
 * second, not of what the first two became. */
static void direction_is_updated(void **state) {
    (void)state;
    arris_edges e = edges_new();
    piece p[3];
    int32_t heads[PIECE_HEADS];
    piece_node nodes[3];
    double x = 10, y = 10;
    for (int k = 0; k < 3; k++) {
        double a = 0.04 * k, l = k < 2 ? 30.3 : 30;
        chain_begin(&e);
        walk(&e, x, y, x + l * cos(a), y + l * sin(a), 1, 0, NULL);
        x += l * cos(a), y += l * sin(a);
        piece_make(&p[k], e.point + e.chain[k].first, e.chain[k].n, (uint32_t)k, false);
    }
    piece_rule rule = {sin(0.05), 2, INFINITY};
    piece_merge(p, 3, &rule, heads, nodes);
    assert_int_equal(p[0].gone + p[1].gone + p[2].gone, 1);
    assert_true(p[1].gone != p[2].gone);
    edges_free(&e);
}

/* A gap within linkrad is bridged, a wider one is not, nor one between opposite polarities. */
static void gaps(void **state) {
    (void)state;
    bench b = bench_new(200, 100, ARRIS_GREY8, NULL);
    const struct {
        double gap;
        bool flip;
        uint32_t n;
    } cases[] = {{1.5, false, 1}, {2.5, false, 2}, {1.5, true, 2}};
    for (size_t k = 0; k < COUNT(cases); k++) {
        double x = 60 + cases[k].gap;
        edges_clear(&b.edges);
        chain_begin(&b.edges);
        walk(&b.edges, 20, 50, 60, 50, 10, 0, NULL);
        chain_begin(&b.edges);
        if (cases[k].flip)
            walk(&b.edges, 120, 50, x, 50, 10, 0, NULL);
        else
            walk(&b.edges, x, 50, 120, 50, 10, 0, NULL);
        segmenter_run(b.segmenter, &b.edges, NULL, &b.segments);
        assert_int_equal(b.segments.n, cases[k].n);
    }
    bench_free(&b);
}

/* ---- the thesis's way ----------------------------------------------------------------------- */

static void thesis_ends_are_pixels(void **state) {
    (void)state;
    segmenter_params p = SEGMENTER_DEFAULTS;
    p.mode = SEGMENTER_THESIS;
    bench b = bench_new(160, 160, ARRIS_GREY8, &p);
    double nees = 0;
    const int poses = 300;
    for (int i = 0; i < poses; i++) {
        strip s = strip_anywhere(160, 160, 80, 100, &b.seed);
        edges_clear(&b.edges);
        chain_along(&b.edges, &s, -40, 40, 0.3, &b.seed);
        segmenter_run(b.segmenter, &b.edges, &b.image, &b.segments);
        assert_int_equal(b.segments.n, 1);
        const arris_segment *g = b.segments.item;
        assert_true(g->x1 == rint(g->x1) && g->y1 == rint(g->y1));
        assert_true(g->x2 == rint(g->x2) && g->y2 == rint(g->y2));
        nees += strip_compare(&s, g).nees;
    }
    assert_within(nees / poses, 0.8, 1.25);
    bench_free(&b);
}

/* ---- the filters ---------------------------------------------------------------------------- */

/* A row of pixels that shows a step at `at` px from its middle. */
static void profile(double *px, double at, double blur, double dark, double bright) {
    for (int j = 0; j < STEP_WIDTH; j++)
        px[j] = dark + (bright - dark) * normal_below((j - STEP_HALF - at) / blur);
}

static double answer(const step_filter *f, int filter, const double *px) {
    double sum = 0;
    for (int j = 0; j < STEP_WIDTH; j++)
        sum += f->w[j / 2][filter][j % 2] * px[j];
    return sum / STEP_UNIT;
}

static void filters_measure_steps(void **state) {
    (void)state;
    step_table *t = aligned_alloc(64, (sizeof *t + 63) / 64 * 64);
    assert_non_null(t);
    step_init(t);
    for (int k = 4; k < STEP_SCALES; k += 5)
        for (int half = 4; half <= STEP_HALF; half++)
            for (int p = 0; p < STEP_PHASES; p++) {
                const step_filter *f = &t->f[k][half - STEP_MIN][p];
                double blur = (double)step_blur(k), px[STEP_WIDTH], at = -(p + 0.5) / STEP_PHASES;
                double per_px = 100 * (double)f->response[STEP_OFFSET];
                profile(px, at, blur, -50, 50);
                assert_within(answer(f, STEP_OFFSET, px), -0.01, 0.01);
                assert_within(answer(f, STEP_CONTRAST, px) / (double)f->response[STEP_CONTRAST],
                              99.9, 100.1);
                profile(px, at + 0.05, blur, -50, 50); /* towards the bright side */
                assert_within(answer(f, STEP_OFFSET, px) / per_px, -0.0505, -0.0495);
                profile(px, at, blur * 1.05, -50, 50);
                assert_within(answer(f, STEP_BLUR, px) /
                                  (100 * log(1.05) * (double)f->response[STEP_BLUR]),
                              0.9, 1.1);
            }
    free(t);
}

static void scales_cover_blurs(void **state) {
    (void)state;
    for (float blur = 0.45f; blur < 5.5f; blur *= 1.01f)
        assert_within((double)(step_blur(step_scale(blur)) / blur), 0.93, 1.08);
    assert_int_equal(step_scale(0), 0);
    assert_int_equal(step_scale(1e30f), STEP_SCALES - 1);
    assert_in_range(step_scale(NAN), 0, STEP_SCALES - 1);
}

/* ---- the line through offsets --------------------------------------------------------------- */

static void huber_ignores_outliers(void **state) {
    (void)state;
    enum { N = 40 };
    eight t[N / LANES], offset[N / LANES], weight[N / LANES];
    uint64_t seed = 7;
    for (int i = 0; i < N; i++) {
        t[i / LANES][i % LANES] = (float)(i - N / 2);
        offset[i / LANES][i % LANES] = (float)(0.5 + 0.01 * (i - N / 2) + 0.01 * rng_normal(&seed));
        weight[i / LANES][i % LANES] = 100;
    }
    offset[1][5] = 40, offset[4][2] = -30, offset[2][4] = 9;
    huber_data d = {N, t, offset, weight, false};
    huber_line l;
    huber_fit(&d, &l);
    assert_within(l.offset, 0.495, 0.505);
    assert_within(l.slope, 0.0095, 0.0105);
}

/* Scatter beyond what is claimed is found, be it of single offsets or of neighbours together. */
static void huber_tells_scatter(void **state) {
    (void)state;
    enum { N = 200 };
    eight t[N / LANES], wild[N / LANES], wavy[N / LANES], weight[N / LANES];
    uint64_t seed = 9;
    huber_line l;
    for (int i = 0; i < N; i++) {
        t[i / LANES][i % LANES] = (float)(i - N / 2);
        wild[i / LANES][i % LANES] = (float)(0.3 * rng_normal(&seed));
        wavy[i / LANES][i % LANES] = (float)(0.01 * rng_normal(&seed) + 0.02 * sin(i / 15.));
        weight[i / LANES][i % LANES] = 100;
    }
    huber_fit(&(huber_data){N, t, wild, weight, false}, &l);
    assert_within(l.spread, 600, 1300); /* (0.3 / 0.01)² = 900 */
    huber_fit(&(huber_data){N, t, wavy, weight, false}, &l);
    assert_within(l.spread, 2, 5);
    assert_true(huber_waves(&(huber_data){N, t, wavy, weight, false}, &l) > 20);
}

/* ---- at the bound --------------------------------------------------------------------------- */

static void at_the_bound(void **state) {
    (void)state;
    const double cases[][3] = {{2, 40, 30}, {2, 150, 100}, {5, 40, 40}, {5, 150, 30}};
    for (size_t k = 0; k < COUNT(cases); k++) {
        summary m = measure(cases[k][0], cases[k][1], cases[k][2], 300, NULL);
        assert_in_range(m.found, 297, 300);
        assert_within(m.offset, 0.7, 1.3);
        assert_within(m.angle, 0.7, 1.5);
        assert_within(m.mean, -0.2, 0.2);
        assert_within(m.nees, 0.8, 1.25);
        assert_within(m.chi2, 0.95, 1.05);
        assert_within(m.blur, 0.80, 0.90);
    }
}

/* No slip in x or y, at any place between the pixels: edges along the axes, without noise, in
 * levels so fine that rounding them does not matter. */
static void no_slip(void **state) {
    (void)state;
    bench b = bench_new(160, 160, ARRIS_GREY16, NULL);
    for (int turn = 0; turn < 4; turn++)
        for (double shift = 0; shift < 1; shift += 0.1) {
            strip s = {80 + shift, 80 + shift, turn * M_PI / 2, 60, 7000, 45000, 0.8, {0, 0}};
            bench_strip(&b, &s, 0, 0.1);
            const arris_segment *g = strip_find(&s, &b.segments);
            assert_non_null(g);
            assert_within(strip_compare(&s, g).offset, -1e-3, 1e-3);
        }
    bench_free(&b);
}

/* The edge moves neither way when dark and bright are exchanged. */
static void polarity_makes_no_difference(void **state) {
    (void)state;
    bench b = bench_new(160, 160, ARRIS_GREY8, NULL);
    double sum = 0;
    for (int i = 0; i < 50; i++) {
        strip s = strip_anywhere(160, 160, 60, 100, &b.seed);
        for (int flip = 0; flip < 2; flip++) {
            strip f = s;
            picture_draw(&b.image, strip_level, &s, 0, NULL);
            if (flip) { /* the negative, and the edge walked the other way */
                for (int k = 0; k < b.image.height * b.image.stride; k++)
                    b.image.data[k] = (uint8_t)(255 - b.image.data[k]);
                f.angle += M_PI;
            }
            edges_clear(&b.edges);
            chain_along(&b.edges, &f, -30, 30, 0, NULL);
            b.edges.noise = 0.5f;
            bench_run(&b);
            const arris_segment *g = strip_find(&f, &b.segments);
            assert_non_null(g);
            sum += strip_compare(&f, g).offset;
            assert_true(fabs((double)(g->hi - g->lo) - 100) < 2);
        }
    }
    assert_within(sum / 100, -5e-4, 5e-4);
    bench_free(&b);
}

/* 16 bits with the same light give the same line, and so do levels that fill them. */
static void sixteen_bits(void **state) {
    (void)state;
    bench b = bench_new(160, 160, ARRIS_GREY16, NULL);
    for (int i = 0; i < 40; i++) {
        strip s = strip_anywhere(160, 160, 60, 100, &b.seed);
        double scale = i % 2 ? 257 : 16;
        s.dark *= scale, s.bright *= scale;
        bench_strip(&b, &s, 2 * scale, 0.2);
        const arris_segment *g = strip_find(&s, &b.segments);
        assert_non_null(g);
        strip_error e = strip_compare(&s, g);
        assert_true(fabs(e.offset) < 5 * sqrt(g->cov[0]));
        assert_within(sqrt(g->cov[0]), 0.004, 0.009);
        assert_within((double)g->chi2, 0.8, 1.2);
        assert_within((double)(g->hi - g->lo) / scale, 98, 102);
    }
    bench_free(&b);
}

static void vector_path_gives_the_same_bits(void **state) {
    (void)state;
    bench a = bench_new(160, 160, ARRIS_GREY8, NULL), b = bench_new(160, 160, ARRIS_GREY8, NULL);
    segmenter_portable(b.segmenter);
    for (int i = 0; i < 100; i++) {
        strip s = strip_anywhere(160, 160, 20 + i, 60, &a.seed);
        b.seed = a.seed;
        bench_strip(&a, &s, 3, 0.3);
        bench_strip(&b, &s, 3, 0.3);
        assert_int_equal(a.segments.n, b.segments.n);
        for (uint32_t k = 0; k < a.segments.n; k++)
            assert_memory_equal(&a.segments.item[k], &b.segments.item[k], sizeof(arris_segment));
    }
    bench_free(&a);
    bench_free(&b);
}

/* Without an estimate of the noise it is taken from what the fit leaves. */
static void unknown_noise(void **state) {
    (void)state;
    bench b = bench_new(160, 160, ARRIS_GREY8, NULL);
    double nees = 0;
    for (int i = 0; i < 200; i++) {
        strip s = strip_anywhere(160, 160, 60, 100, &b.seed);
        picture_draw(&b.image, strip_level, &s, 3, &b.seed);
        edges_clear(&b.edges);
        chain_along(&b.edges, &s, -30, 30, 0.2, &b.seed);
        b.edges.noise = 0;
        bench_run(&b);
        const arris_segment *g = strip_find(&s, &b.segments);
        assert_non_null(g);
        assert_true(g->chi2 == 0);
        nees += strip_compare(&s, g).nees / 200;
    }
    assert_within(nees, 0.75, 1.3);
    bench_free(&b);
}

/* Without the picture: the line through the points. */
static void without_a_picture(void **state) {
    (void)state;
    bench b = bench_new(160, 160, ARRIS_GREY8, NULL);
    for (int i = 0; i < 100; i++) {
        strip s = strip_anywhere(160, 160, 60, 100, &b.seed);
        edges_clear(&b.edges);
        chain_along(&b.edges, &s, -30, 30, 0.2, &b.seed);
        segmenter_run(b.segmenter, &b.edges, NULL, &b.segments);
        assert_int_equal(b.segments.n, 1);
        const arris_segment *g = b.segments.item;
        strip_error e = strip_compare(&s, g);
        assert_true(fabs(e.offset) < 4 * sqrt(g->cov[0]));
        assert_true(fabs(e.angle) < 4 * sqrt(g->cov[2]));
        assert_true(g->lo == 0 && g->hi == 0 && g->blur == 0 && g->chi2 == 0);
    }
    bench_free(&b);
}

/* ---- light and lens ------------------------------------------------------------------------- */

static void shade_one_side(strip *s, uint64_t *seed) {
    s->slope[rng_uniform(seed) < 0.5] = 1.5;
}

static void shade_both_sides(strip *s, uint64_t *seed) {
    double g = rng_uniform(seed) < 0.5 ? 1 : -1;
    s->slope[0] = g, s->slope[1] = g;
}

/* Slopes beside the edge cost precision, but neither bias nor honesty. */
static void shading_is_no_bias(void **state) {
    (void)state;
    summary one = measure(2, 100, 60, 300, shade_one_side);
    assert_int_equal(one.found, 300);
    assert_within(one.offset, 0.7, 2);
    assert_within(one.mean, -0.4, 0.4);
    assert_within(one.nees, 0.5, 1.4);
    summary both = measure(2, 100, 60, 300, shade_both_sides);
    assert_int_equal(both.found, 300);
    assert_within(both.offset, 0.7, 2);
    assert_within(both.nees, 0.5, 1.4);
}

/* Light that fades along the edge. */
typedef struct faded {
    strip s;
    double dark, bright; /* levels per px along the edge */
} faded;

static double faded_level(const void *scene, double x, double y) {
    const faded *f = scene;
    strip s = f->s;
    double t = (x - s.x) * cos(s.angle) + (y - s.y) * sin(s.angle);
    s.dark += f->dark * t, s.bright += f->bright * t;
    return strip_level(&s, x, y);
}

static void fading_along_is_no_bias(void **state) {
    (void)state;
    bench b = bench_new(160, 160, ARRIS_GREY8, NULL);
    summary m = {0};
    for (int i = 0; i < 300; i++) {
        faded f = {strip_anywhere(160, 160, 60, 100, &b.seed), 0.3, -1};
        picture_draw(&b.image, faded_level, &f, 2, &b.seed);
        edges_clear(&b.edges);
        chain_along(&b.edges, &f.s, -30, 30, 0.2, &b.seed);
        b.edges.noise = 2.02f;
        bench_run(&b);
        summary_add(&m, &f.s, &b.segments, 2);
    }
    m = summary_end(m);
    assert_int_equal(m.found, 300);
    assert_within(m.offset, 0.7, 1.3);
    assert_within(m.mean, -0.2, 0.2);
    assert_within(m.nees, 0.7, 1.25);
    bench_free(&b);
}

static void defocus(strip *s, uint64_t *seed) {
    s->psf = 0.4 + 2.6 * rng_uniform(seed);
}

static void defocus_is_measured(void **state) {
    (void)state;
    summary m = measure(2, 150, 80, 300, defocus);
    assert_in_range(m.found, 297, 300);
    assert_within(m.nees, 0.7, 1.3);
    assert_within(m.blur, 1.55, 1.85);
}

/* The same edge, `shift` px apart along x: the camera moved during the exposure. */
typedef struct blurred {
    strip s;
    double shift;
} blurred;

static double moved_level(const void *scene, double x, double y) {
    const blurred *m = scene;
    double sum = 0;
    for (int k = 0; k < 9; k++)
        sum += strip_level(&m->s, x + m->shift * (k - 4) / 8, y) / 9;
    return sum;
}

/* Draws a scene with noise of 2 levels. The segment of its strip, from a chain along it that
 * reaches `half` px from its middle. */
static const arris_segment *bench_see(bench *b, scene_level *level, const void *scene,
                                      const strip *s, double half) {
    picture_draw(&b->image, level, scene, 2, &b->seed);
    edges_clear(&b->edges);
    chain_along(&b->edges, s, -half, half, 0.2, &b->seed);
    b->edges.noise = 2.02f;
    bench_run(b);
    const arris_segment *g = strip_find(s, &b->segments);
    assert_non_null(g);
    return g;
}

static void motion_blur_is_no_bias(void **state) {
    (void)state;
    bench b = bench_new(160, 160, ARRIS_GREY8, NULL);
    double mean = 0, nees = 0;
    for (int i = 0; i < 100; i++) {
        blurred m = {strip_anywhere(160, 160, 80, 120, &b.seed), 4};
        const arris_segment *g = bench_see(&b, moved_level, &m, &m.s, 38);
        strip_error e = strip_compare(&m.s, g);
        mean += e.offset / 100, nees += e.nees / 100;
    }
    assert_within(mean, -0.003, 0.003);
    assert_within(nees, 0.6, 1.5);
    bench_free(&b);
}

/* Gamma and clipping move an edge by what nobody can see in the picture; the fit stays sane, and
 * where the bright side is clipped its covariance says so. */
static double gamma_level(const void *scene, double x, double y) {
    return 255 * pow(fmax(0, strip_level(scene, x, y)) / 255, 1 / 2.2);
}

/* The odd rows were taken later, when the edge had moved by this along x. */
typedef struct interlaced {
    strip s;
    double moved;
} interlaced;

static double interlaced_level(const void *scene, double x, double y) {
    const interlaced *c = scene;
    return strip_level(&c->s, x - ((int)y % 2 ? c->moved / 2 : -c->moved / 2), y);
}

/* The line is that in between, and owns up to the comb that it is. */
static void interlace_is_no_bias(void **state) {
    (void)state;
    bench b = bench_new(160, 160, ARRIS_GREY8, NULL);
    double mean = 0, nees = 0;
    for (int i = 0; i < 200; i++) {
        interlaced c = {strip_anywhere(160, 160, 80, 120, &b.seed), 0.8};
        picture_draw(&b.image, interlaced_level, &c, 2, &b.seed);
        edges_clear(&b.edges);
        chain_along(&b.edges, &c.s, -38, 38, 0.3, &b.seed);
        b.edges.noise = 2.02f;
        bench_run(&b);
        const arris_segment *g = strip_find(&c.s, &b.segments);
        assert_non_null(g);
        strip_error e = strip_compare(&c.s, g);
        mean += e.offset / 200, nees += e.nees / 200;
    }
    assert_within(mean, -0.004, 0.004);
    assert_true(nees < 1.5);
    bench_free(&b);
}

static void gamma_and_clipping(void **state) {
    (void)state;
    bench b = bench_new(160, 160, ARRIS_GREY8, NULL);
    for (int i = 0; i < 50; i++) {
        strip s = strip_anywhere(160, 160, 80, i % 2 ? 150 : 300, &b.seed);
        picture_draw(&b.image, i % 2 ? gamma_level : strip_level, &s, 2, &b.seed);
        edges_clear(&b.edges);
        chain_along(&b.edges, &s, -40, 40, 0.2, &b.seed);
        b.edges.noise = 2.02f;
        bench_run(&b);
        const arris_segment *g = strip_find(&s, &b.segments);
        assert_non_null(g);
        strip_error e = strip_compare(&s, g);
        assert_within(e.offset, -0.5, 0.5);
        assert_within(e.angle, -2e-3, 2e-3);
        if (i % 2 == 0)
            assert_true(fabs(e.offset) < 3 * sqrt(g->cov[0]));
    }
    bench_free(&b);
}

/* A strip in ideal coordinates that a lens bends. */
enum { LENS_WIDTH = 320, LENS_HEIGHT = 240 };
typedef struct bent {
    strip s;
    double (*ideal)[LENS_WIDTH + 1][2]; /* of the pixels */
} bent;

static double (*lens_map(const arris_camera *c))[LENS_WIDTH + 1][2] {
    double(*map)[LENS_WIDTH + 1][2] = calloc(LENS_HEIGHT + 1, sizeof *map);
    assert_non_null(map);
    for (int v = 0; v <= LENS_HEIGHT; v++)
        for (int u = 0; u <= LENS_WIDTH; u++)
            assert_int_equal(arris_undistort(c, u, v, &map[v][u][0], &map[v][u][1]), 0);
    return map;
}

/* How far an ideal point is across the strip's edge. */
static double strip_across(const strip *s, const double p[2]) {
    return (p[1] - s->y) * cos(s->angle) - (p[0] - s->x) * sin(s->angle);
}

/* The blurred step across the edge, its blur one of the picture. */
static double bent_level(const void *scene, double u, double v) {
    const bent *b = scene;
    const strip *s = &b->s;
    const double *p = b->ideal[(int)v][(int)u], across = strip_across(s, p);
    double along = (p[0] - s->x) * cos(s->angle) + (p[1] - s->y) * sin(s->angle);
    double du = strip_across(s, b->ideal[(int)v][(int)u + 1]) - across;
    double dv = strip_across(s, b->ideal[(int)v + 1][(int)u]) - across;
    double blur = strip_blur(s) * hypot(du, dv), h = s->length / 2;
    return s->dark + (s->bright - s->dark) * normal_below(across / blur) *
                         normal_below((along + h) / blur) * normal_below((h - along) / blur);
}

/* Edges anywhere, in the corners too, are measured along the bent line and come out straight. */
static void check_bent(const arris_camera *lens) {
    arris_camera ideal = arris_camera_ideal(lens);
    bench b = bench_new(LENS_WIDTH, LENS_HEIGHT, ARRIS_GREY8, NULL);
    b.image.camera = lens;
    b.edges.camera = &ideal;
    summary m = {0};
    bent e = {.ideal = lens_map(lens)};
    for (int i = 0; i < 120; i++) {
        e.s = strip_anywhere(LENS_WIDTH, LENS_HEIGHT, 100, 100, &b.seed);
        e.s.x += 260 * (rng_uniform(&b.seed) - 0.5);
        e.s.y += 180 * (rng_uniform(&b.seed) - 0.5);
        picture_draw(&b.image, bent_level, &e, 2, &b.seed);
        edges_clear(&b.edges);
        chain_along(&b.edges, &e.s, -50, 50, 0.2, &b.seed);
        /* what the lens does not show is not there */
        uint32_t kept = 0;
        for (uint32_t k = 0; k < b.edges.n; k++) {
            double u, v;
            arris_distort(lens, (double)b.edges.point[k].x, (double)b.edges.point[k].y, &u, &v);
            if (u > 5 && v > 5 && u < LENS_WIDTH - 6 && v < LENS_HEIGHT - 6)
                b.edges.point[kept++] = b.edges.point[k];
        }
        b.edges.n = b.edges.chain[0].n = kept;
        b.edges.noise = 2.02f;
        if (kept < 60)
            continue;
        bench_run(&b);
        assert_ptr_equal(b.segments.camera, &ideal);
        summary_add(&m, &e.s, &b.segments, 2);
    }
    assert_true(m.poses > 60);
    free(e.ideal);
    m = summary_end(m);
    assert_int_equal(m.found, m.poses);
    assert_within(m.offset, 0.6, 2); /* the lens shrinks the corners */
    assert_within(m.angle, 0.6, 2);
    assert_within(m.mean, -0.4, 0.4);
    assert_within(m.nees, 0.6, 1.4);
    bench_free(&b);
}

static void bent_lines(void **state) {
    (void)state;
    static const arris_camera heavy = {320,   240,  230, 226,  3,       163.2,
                                       117.1, -0.4, 0.2, 2e-3, -1.5e-3, -0.02};
    check_bent(&heavy);
}

/* Wider than high by 30 %. */
static void bent_lines_in_oblong_pixels(void **state) {
    (void)state;
    static const arris_camera oblong = {320,   240,  230, 299,  3,       163.2,
                                        117.1, -0.3, 0.1, 2e-3, -1.5e-3, 0};
    check_bent(&oblong);
}

/* Edges that follow a camera which the picture's cannot be led to: the points are all there is. */
static void foreign_camera(void **state) {
    (void)state;
    static const arris_camera here = {160, 160, 200, 200, 0, 80, 80, -0.2, 0, 0, 0, 0};
    static const arris_camera there = {160, 160, 300, 300, 0, 80, 80, 0.1, 0, 0, 0, 0};
    bench b = bench_new(160, 160, ARRIS_GREY8, NULL);
    b.image.camera = &here;
    b.edges.camera = &there;
    strip s = strip_anywhere(160, 160, 60, 100, &b.seed);
    bench_strip(&b, &s, 2, 0.2);
    assert_int_equal(b.segments.n, 1);
    assert_true(b.segments.item[0].blur == 0);
    bench_free(&b);
}

/* ---- neighbours ----------------------------------------------------------------------------- */

typedef struct pair {
    strip a, b; /* the second's contrast is on top of the first's */
} pair;

static double pair_level(const void *scene, double x, double y) {
    const pair *p = scene;
    return strip_level(&p->a, x, y) + strip_level(&p->b, x, y);
}

/* What is found of a strip of the picture, as edge points tell of both. */
static const arris_segment *measure_beside(bench *b, const strip *s, const strip *other) {
    edges_clear(&b->edges);
    chain_along(&b->edges, s, -50, 50, 0.2, &b->seed);
    chain_along(&b->edges, other, -50, 50, 0.2, &b->seed);
    b->edges.noise = 2.02f;
    bench_run(b);
    return strip_find(s, &b->segments);
}

/* A faint neighbour takes no room from a strong edge, nor does it matter to it; one that is as
 * strong does. */
static void faint_neighbours_take_no_room(void **state) {
    (void)state;
    bench b = bench_new(160, 160, ARRIS_GREY8, NULL);
    for (int faint = 0; faint < 2; faint++) {
        summary m = {0};
        int told = 0;
        for (int i = 0; i < 100; i++) {
            strip s = strip_anywhere(160, 160, 100, 150, &b.seed), t = s;
            t.x += 5 * sin(s.angle), t.y -= 5 * cos(s.angle);
            t.bright = t.dark + (faint ? 20 : 150);
            picture_draw(&b.image, strip_level, &s, 2, &b.seed);
            const arris_segment *g = measure_beside(&b, &s, &t);
            summary_add(&m, &s, &b.segments, 2);
            told += g && g->blur > 0;
        }
        m = summary_end(m);
        assert_int_equal(m.found, 100);
        assert_in_range(told, faint ? 100 : 0, faint ? 100 : 25);
        assert_true(faint ? m.offset < 1.3 : m.offset > 1.3);
    }
    bench_free(&b);
}

/* Light that falls off beside an edge, to an edge of its own where a soft shadow ends: the rows
 * between them are narrow, but not too narrow to tell. */
static void narrow_shading_is_no_bias(void **state) {
    (void)state;
    bench b = bench_new(160, 160, ARRIS_GREY8, NULL);
    double mean = 0, nees = 0;
    for (int i = 0; i < 200; i++) {
        strip s = strip_anywhere(160, 160, 100, 80, &b.seed), end;
        s.psf = 0.55, s.slope[1] = -5;
        end = s;
        end.x -= 5 * sin(s.angle), end.y += 5 * cos(s.angle);
        picture_draw(&b.image, strip_level, &s, 2, &b.seed);
        const arris_segment *g = measure_beside(&b, &s, &end);
        assert_non_null(g);
        strip_error e = strip_compare(&s, g);
        mean += e.offset / 200, nees += e.nees / 200;
    }
    bench_free(&b);
    assert_within(mean, -0.005, 0.005);
    assert_within(nees, 0.5, 1.5);
}

/* What lies beside an edge within its blur, on one side, moves and widens it by about the same. */
typedef struct banded {
    strip s;
    double width, level; /* px, to the right where positive; levels */
} banded;

static double banded_level(const void *scene, double x, double y) {
    const banded *b = scene;
    const strip *s = &b->s;
    double v = (y - s->y) * cos(s->angle) - (x - s->x) * sin(s->angle), blur = strip_blur(s);
    return strip_level(s, x, y) +
           b->level * fabs(normal_below((v - b->width) / blur) - normal_below(v / blur));
}

static void a_band_moves_and_widens(void **state) {
    (void)state;
    bench b = bench_new(160, 160, ARRIS_GREY8, NULL);
    static const double widths[] = {-1.5, -1, -0.75, 0.75, 1, 1.5};
    for (size_t k = 0; k < COUNT(widths); k++)
        for (double level = -12; level < 13; level += 24) {
            double offset = 0, wider = 0, own = 0, other = 0;
            for (int i = 0; i < 60; i++) {
                banded f = {strip_anywhere(160, 160, 100, 100, &b.seed), widths[k], level};
                f.s.psf = 0.55;
                const arris_segment *g = bench_see(&b, banded_level, &f, &f.s, 50);
                offset += strip_compare(&f.s, g).offset / 60;
                wider += ((double)g->blur - strip_blur(&f.s)) / 60;
                own += (double)g->beside[widths[k] > 0] / 60;
                other += (double)g->beside[widths[k] < 0] / 60;
            }
            double ratio = offset / wider;
            print_message("    %+.2f px %+.0f: %+.3f px, wider by %+.3f, beside %.1f %.1f\n",
                          widths[k], level, offset, wider, own, other);
            assert_within(widths[k] > 0 ? ratio : -ratio, 0.5, 2.2);
            assert_true(fabs(widths[k]) < 1.5 || fabs(own) > fabs(other));
        }
    bench_free(&b);
}

/* Parallel pairs: the two sides of a bar, and two steps up. Both are found, in their places, and
 * neither pulls the other by more than the covariance admits. */
static void parallel_pairs(void **state) {
    (void)state;
    bench b = bench_new(160, 160, ARRIS_GREY8, NULL);
    for (int up = 0; up < 2; up++)
        for (int d = up ? 4 : 3; d <= 8; d++) {
            double nees = 0;
            for (int i = 0; i < 30; i++) {
                pair p = {.a = strip_anywhere(160, 160, 70, 80, &b.seed)};
                p.b = p.a;
                p.b.x -= d * sin(p.a.angle), p.b.y += d * cos(p.a.angle);
                p.b.dark = 0, p.b.bright = up ? 60 : -80;
                picture_draw(&b.image, pair_level, &p, 2, &b.seed);
                if (!up) { /* its bright side is towards the first */
                    p.b.angle += M_PI;
                    p.b.bright = 80;
                }
                edges_clear(&b.edges);
                chain_along(&b.edges, &p.a, -35, 35, 0.2, &b.seed);
                chain_along(&b.edges, &p.b, -35, 35, 0.2, &b.seed);
                b.edges.noise = 2.02f;
                bench_run(&b);
                assert_int_equal(b.segments.n, 2);
                for (int k = 0; k < 2; k++) {
                    const strip *s = k ? &p.b : &p.a;
                    const arris_segment *g = strip_find(s, &b.segments);
                    assert_non_null(g);
                    strip_error e = strip_compare(s, g);
                    assert_within(e.offset, -0.3, 0.3);
                    nees += e.nees / 60;
                }
            }
            assert_within(nees, 0.2, 2);
        }
    bench_free(&b);
}

typedef struct junction {
    strip s;
    double step; /* of the bright side at the edge's middle */
} junction;

static double junction_level(const void *scene, double x, double y) {
    const junction *j = scene;
    strip s = j->s;
    double t = (x - s.x) * cos(s.angle) + (y - s.y) * sin(s.angle);
    s.bright += j->step * normal_below(t / strip_blur(&s));
    return strip_level(&s, x, y);
}

/* Another edge ends on this one: neither does it bend the line, nor does it break it. */
static void t_junction(void **state) {
    (void)state;
    bench b = bench_new(160, 160, ARRIS_GREY8, NULL);
    double nees = 0, mean = 0;
    for (int i = 0; i < 100; i++) {
        junction j = {strip_anywhere(160, 160, 80, 100, &b.seed), 60};
        double c = cos(j.s.angle), d = sin(j.s.angle);
        picture_draw(&b.image, junction_level, &j, 2, &b.seed);
        edges_clear(&b.edges);
        chain_along(&b.edges, &j.s, -40, 40, 0.2, &b.seed);
        chain_begin(&b.edges);
        walk(&b.edges, j.s.x - 3 * d, j.s.y + 3 * c, j.s.x - 30 * d, j.s.y + 30 * c, 15, 0.2,
             &b.seed);
        b.edges.noise = 2.02f;
        bench_run(&b);
        const arris_segment *g = strip_find(&j.s, &b.segments);
        assert_non_null(g);
        assert_true(hypot(g->x2 - g->x1, g->y2 - g->y1) > 75);
        strip_error e = strip_compare(&j.s, g);
        nees += e.nees / 100, mean += e.offset / 100;
    }
    assert_within(nees, 0.5, 1.5);
    assert_within(mean, -0.003, 0.003);
    bench_free(&b);
}

/* Edges under 15 px are measured too when they are asked for, at the bound of what is left of them.
 */
static void short_edges(void **state) {
    (void)state;
    segmenter_params p = SEGMENTER_DEFAULTS;
    p.min_length = 11;
    bench b = bench_new(64, 64, ARRIS_GREY8, &p);
    summary m = {0};
    for (int i = 0; i < 300; i++) {
        strip s = strip_anywhere(64, 64, 13, 100, &b.seed);
        bench_strip(&b, &s, 2, 0.2);
        summary_add(&m, &s, &b.segments, 2);
    }
    m = summary_end(m);
    assert_in_range(m.found, 285, 300);
    assert_within(m.offset, 0.7, 1.6);
    assert_within(m.nees, 0.6, 1.6);
    strip s = strip_anywhere(64, 64, 9, 100, &b.seed);
    bench_strip(&b, &s, 2, 0.2);
    assert_int_equal(b.segments.n, 0);
    bench_free(&b);
}

/* The limb of a cylinder: shading falls towards the edge like a root. */
static double limb_level(const void *scene, double x, double y) {
    const strip *s = scene;
    double v = (y - s->y) * cos(s->angle) - (x - s->x) * sin(s->angle), sum = 0, weight = 0;
    for (int k = -12; k <= 12; k++) {
        double d = v + k * 0.25 * strip_blur(s), w = exp(-k * k / 32.), u = 1 - d / 30;
        sum += w * (d <= 0 ? 0 : d > 30 ? 1 : sqrt(1 - u * u));
        weight += w;
    }
    return s->dark + (s->bright - s->dark) * sum / weight;
}

static void limb_of_a_cylinder(void **state) {
    (void)state;
    bench b = bench_new(160, 160, ARRIS_GREY8, NULL);
    for (int i = 0; i < 50; i++) {
        strip s = strip_anywhere(160, 160, 80, 150, &b.seed);
        picture_draw(&b.image, limb_level, &s, 2, &b.seed);
        edges_clear(&b.edges);
        chain_along(&b.edges, &s, -40, 40, 0.2, &b.seed);
        b.edges.noise = 2.02f;
        bench_run(&b); /* finite, whatever is found */
        if (b.segments.n)
            assert_true(fabs(strip_compare(&s, b.segments.item).offset) < 1.5);
    }
    bench_free(&b);
}

/* An arc is no line: what is cut from it states more than the bound of a line. */
static double disc_level(const void *scene, double x, double y) {
    const strip *s = scene;
    return s->dark + (s->bright - s->dark) *
                         normal_below((hypot(x - s->x, y - s->y) - s->length) / strip_blur(s));
}

static void arcs_are_no_lines(void **state) {
    (void)state;
    bench b = bench_new(400, 400, ARRIS_GREY8, NULL);
    strip s = {200, 200, 0, 150, 40, 140, 0.8, {0, 0}};
    picture_draw(&b.image, disc_level, &s, 2, &b.seed);
    chain_begin(&b.edges);
    for (double a = 2 * M_PI; a > 0; a -= 1 / s.length) /* the dark inside on the left */
        point(&b.edges, s.x + s.length * cos(a), s.y + s.length * sin(a), 30 * cos(a), 30 * sin(a));
    b.edges.chain[0].closed = true;
    b.edges.noise = 2.02f;
    bench_run(&b);
    assert_in_range(b.segments.n, 10, 40);
    for (uint32_t i = 0; i < b.segments.n; i++) {
        const arris_segment *g = &b.segments.item[i];
        double length = hypot(g->x2 - g->x1, g->y2 - g->y1);
        if (length > 25)
            assert_true(sqrt(g->cov[0]) > 2 * strip_bound(&s, 2, length - 5, 8));
    }
    bench_free(&b);
}

/* ---- where there is nothing ----------------------------------------------------------------- */

static void chains_on_nothing(void **state) {
    (void)state;
    bench b = bench_new(160, 160, ARRIS_GREY8, NULL);
    uint32_t found = 0;
    for (int i = 0; i < 200; i++) {
        strip s = strip_anywhere(160, 160, 12 + i % 60, 0, &b.seed);
        bench_strip(&b, &s, i < 100 ? 5 : 0, 0.5); /* noise, and blank */
        found += b.segments.n;
    }
    assert_true(found <= 1);
    edges_clear(&b.edges);
    bench_run(&b);
    assert_int_equal(b.segments.n, 0);
    bench_free(&b);
}

/* ---- sizes and rubbish ---------------------------------------------------------------------- */

/* Any picture, chains anywhere in it and outside. */
static void any_size(void **state) {
    (void)state;
    const int sizes[][2] = {{1, 1},  {1, 50}, {50, 1},    {2, 2},     {3, 3},
                            {5, 17}, {16, 3}, {8192, 20}, {20, 8192}, {131, 67}};
    for (size_t k = 0; k < 2 * COUNT(sizes); k++) {
        int w = sizes[k / 2][0], h = sizes[k / 2][1];
        bench b = bench_new(w, h, k % 2 ? ARRIS_GREY16 : ARRIS_GREY8, NULL);
        strip s = {w / 2., h / 2., 0.3, fmax(w, h), 20, 200, 0.8, {0, 0}};
        picture_draw(&b.image, strip_level, &s, 2, &b.seed);
        b.edges.noise = 2;
        for (int i = 0; i < 30; i++) {
            chain_begin(&b.edges);
            double x = w * (3 * rng_uniform(&b.seed) - 1), y = h * (3 * rng_uniform(&b.seed) - 1);
            double a = 2 * M_PI * rng_uniform(&b.seed), l = 300 * rng_uniform(&b.seed);
            walk(&b.edges, x, y, x + l * cos(a), y + l * sin(a), 20, 0.5, &b.seed);
        }
        bench_run(&b);
        bench_free(&b);
    }
}

/* Coordinates and gradients that are no numbers, or too big ones, give no segment and no harm. */
static void rubbish_is_dropped(void **state) {
    (void)state;
    const double rubbish[] = {NAN, INFINITY, -INFINITY, 1e30, -1e30, 3e9, 1e-40};
    for (int mode = SEGMENTER_REFIT; mode <= SEGMENTER_THESIS; mode++) {
        segmenter_params p = SEGMENTER_DEFAULTS;
        p.mode = mode;
        bench b = bench_new(160, 160, ARRIS_GREY8, &p);
        for (size_t k = 0; k < 4 * COUNT(rubbish); k++) {
            strip s = strip_anywhere(160, 160, 60, 100, &b.seed);
            picture_draw(&b.image, strip_level, &s, 2, &b.seed);
            edges_clear(&b.edges);
            chain_along(&b.edges, &s, -30, 30, 0.2, &b.seed);
            float value = (float)rubbish[k / 4];
            arris_edge_point *q = &b.edges.point[k % 3 * 17];
            *(k % 4 == 0 ? &q->x : k % 4 == 1 ? &q->y : k % 4 == 2 ? &q->gx : &q->gy) = value;
            b.edges.noise = k % 2 ? value : 2;
            bench_run(&b);
        }
        bench_free(&b);
    }
}

/* A grid of 10,000 edges: every one is found, and what does not fit is counted. */
static double grid_level(const void *scene, double x, double y) {
    (void)scene;
    double blur = hypot(0.8, sqrt(1. / 12)), u = fmod(x + 10, 20) - 10, level = 40;
    for (int k = -1; k <= 1; k++)
        level += 100 * (normal_below((u + 20 * k) / blur) - normal_below((u - 10 + 20 * k) / blur));
    return fmod(y, 24) < 20 ? level : 90;
}

static void ten_thousand_lines(void **state) {
    (void)state;
    enum { SIZE = 1600 };
    bench b = bench_new(SIZE, SIZE, ARRIS_GREY8, NULL);
    picture_draw(&b.image, grid_level, NULL, 2, &b.seed);
    for (int y = 0; y + 24 <= SIZE; y += 24)
        for (int x = 20; x + 20 <= SIZE; x += 10) {
            bool bright_on_the_left = x % 20;
            chain_begin(&b.edges);
            walk(&b.edges, x, bright_on_the_left ? y + 1 : y + 19, x,
                 bright_on_the_left ? y + 19 : y + 1, 30, 0.1, &b.seed);
        }
    b.edges.noise = 2.02f;
    bench_run(&b);
    assert_true(b.edges.n_chains > 10000);
    assert_int_equal(b.segments.n, b.edges.n_chains);
    assert_int_equal(b.segments.lost, 0);
    b.segments.max = 9000;
    bench_run(&b);
    assert_int_equal(b.segments.n, 9000);
    assert_int_equal(b.segments.lost, b.edges.n_chains - 9000);
    bench_free(&b);
}

/* ---- the stage, in the program, behind `edges` ---------------------------------------------- */

static void write_picture(const char *name, const arris_image *im) {
    FILE *f = fopen(scratch(name), "w");
    assert_non_null(f);
    fprintf(f, "P5\n%d %d\n255\n", im->width, im->height);
    for (int y = 0; y < im->height; y++)
        assert_int_equal(fwrite(im->data + y * im->stride, 1, (size_t)im->width, f), im->width);
    assert_int_equal(fclose(f), 0);
}

/* Runs `edges ! segments` on the folder and reads the segments of all frames. */
static arris_segments run_program(const char *folder, const char *options, int *frame) {
    char line[1024];
    snprintf(line, sizeof line,
             "launch imagesrc location=%s ! edges ! segments %s ! filesink location=%s",
             scratch(folder), options, scratch("segments.csv"));
    process p = arris_run(line);
    if (p.code)
        fail_msg("%s: exit %d, %s", line, p.code, p.err);
    process_free(&p);
    arris_segments all = segments_new(10000);
    FILE *f = fopen(scratch("segments.csv"), "r");
    assert_non_null(f);
    assert_non_null(fgets(line, sizeof line, f));
    while (fgets(line, sizeof line, f)) {
        arris_segment *g = &all.item[all.n];
        double sigma[2];
        assert_int_equal(sscanf(line, "%d,%*d,%*d,%lf,%lf,%lf,%lf,%lf,%lf", &frame[all.n], &g->x1,
                                &g->y1, &g->x2, &g->y2, &sigma[0], &sigma[1]),
                         7);
        g->cov[0] = sigma[0] * sigma[0], g->cov[2] = sigma[1] * sigma[1];
        all.n++;
    }
    fclose(f);
    return all;
}

static void program_finds_edges_and_no_others(void **state) {
    (void)state;
    enum { FRAMES = 60 };
    uint64_t seed = 0x2545F4914F6CDD1D;
    strip s[FRAMES];
    static int frame[10000];
    int found = 0;
    arris_image im = picture_new(160, 160, ARRIS_GREY8);
    scratch_mkdir("edges");
    scratch_mkdir("noise");
    for (int i = 0; i < FRAMES; i++) {
        char name[32];
        s[i] = strip_anywhere(160, 160, 40, 40, &seed);
        picture_draw(&im, strip_level, &s[i], 5, &seed);
        snprintf(name, sizeof name, "edges/%03d.pgm", i);
        write_picture(name, &im);
        strip none = {80, 80, 0, 0, 100, 100, 0.8, {0, 0}};
        picture_draw(&im, strip_level, &none, 5, &seed);
        snprintf(name, sizeof name, "noise/%03d.pgm", i);
        write_picture(name, &im);
    }
    arris_segments all = run_program("edges", "", frame);
    for (int i = 0; i < FRAMES; i++) {
        arris_segments one = {.item = all.item};
        while (one.item < all.item + all.n && frame[one.item - all.item] < i)
            one.item++;
        while (one.item + one.n < all.item + all.n && frame[one.item + one.n - all.item] == i)
            one.n++;
        found += strip_find(&s[i], &one) != NULL;
    }
    assert_true(found >= FRAMES - 1);
    free(all.item);
    all = run_program("noise", "", frame);
    assert_true(all.n <= FRAMES / 10);
    free(all.item);
    all = run_program("edges", "mode=thesis tol=6 angtol=0.2 linkrad=6 min-length=20", frame);
    assert_true(all.n > FRAMES);
    free(all.item);
    free(im.data);
}

/* An argument chooses tests by name, as "*size*". */
int main(int argc, char **argv) {
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_corner_splits),
        cmocka_unit_test(a_closed_chain_splits),
        cmocka_unit_test(the_chord_is_infinite),
        cmocka_unit_test(greedy_looks_again),
        cmocka_unit_test(order_has_no_influence),
        cmocka_unit_test(direction_is_updated),
        cmocka_unit_test(gaps),
        cmocka_unit_test(thesis_ends_are_pixels),
        cmocka_unit_test(filters_measure_steps),
        cmocka_unit_test(scales_cover_blurs),
        cmocka_unit_test(huber_ignores_outliers),
        cmocka_unit_test(huber_tells_scatter),
        cmocka_unit_test(at_the_bound),
        cmocka_unit_test(no_slip),
        cmocka_unit_test(polarity_makes_no_difference),
        cmocka_unit_test(sixteen_bits),
        cmocka_unit_test(vector_path_gives_the_same_bits),
        cmocka_unit_test(unknown_noise),
        cmocka_unit_test(without_a_picture),
        cmocka_unit_test(shading_is_no_bias),
        cmocka_unit_test(fading_along_is_no_bias),
        cmocka_unit_test(defocus_is_measured),
        cmocka_unit_test(motion_blur_is_no_bias),
        cmocka_unit_test(interlace_is_no_bias),
        cmocka_unit_test(gamma_and_clipping),
        cmocka_unit_test(bent_lines),
        cmocka_unit_test(bent_lines_in_oblong_pixels),
        cmocka_unit_test(foreign_camera),
        cmocka_unit_test(faint_neighbours_take_no_room),
        cmocka_unit_test(narrow_shading_is_no_bias),
        cmocka_unit_test(a_band_moves_and_widens),
        cmocka_unit_test(parallel_pairs),
        cmocka_unit_test(t_junction),
        cmocka_unit_test(short_edges),
        cmocka_unit_test(limb_of_a_cylinder),
        cmocka_unit_test(arcs_are_no_lines),
        cmocka_unit_test(chains_on_nothing),
        cmocka_unit_test(any_size),
        cmocka_unit_test(rubbish_is_dropped),
        cmocka_unit_test(ten_thousand_lines),
        cmocka_unit_test(program_finds_edges_and_no_others),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
