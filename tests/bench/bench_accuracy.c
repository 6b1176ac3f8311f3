/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * bench_accuracy.c: how near `edges ! segments` comes to the Cramér-Rao bound.
 *
 *     bench_accuracy [POSES]
 *
 * For isolated edges in POSES (300) random poses, for each noise, contrast and length: the share
 * that is found; the errors (RMS) of offset and angle, the mean signed offset and the mean slip in
 * x and y, in multiples of the bound for the length that is fitted (TRIM px less at either end) and
 * 8 px to either side; the mean normalised squared error by the stated covariance; chi2. Then how
 * many segments are found in pictures of nothing but noise. A figure that misses its goal is
 * marked.
 */
#include <stdio.h>

#include "../strip.h"
#include "edges/canny.h"
#include "segments/segmenter.h"

enum { SIZE = 192, NOISE_FRAMES = 100, NOISE_WIDTH = 320, NOISE_HEIGHT = 240 };
#define TRIM 2.5
#define HALF 8.0

/* The two kernels and their layers. */
typedef struct chain {
    canny *canny;
    segmenter *segmenter;
    arris_image image;
    arris_edges edges;
    arris_segments segments;
} chain;

static chain chain_new(int width, int height) {
    canny_params cp = CANNY_DEFAULTS;
    segmenter_params sp = SEGMENTER_DEFAULTS;
    chain c = {canny_new(width, height, &cp),
               segmenter_new(width, height, &sp),
               picture_new(width, height, ARRIS_GREY8),
               {0},
               {0}};
    c.segments = segments_new(segmenter_max(width, height));
    c.edges.max = (uint32_t)canny_max_points(width, height);
    c.edges.max_chains = (uint32_t)canny_max_chains(width, height);
    c.edges.point = malloc(c.edges.max * sizeof *c.edges.point);
    c.edges.chain = malloc(c.edges.max_chains * sizeof *c.edges.chain);
    if (!c.canny || !c.segmenter || !c.edges.point || !c.edges.chain)
        abort();
    return c;
}

static void chain_free(chain *c) {
    canny_free(c->canny);
    segmenter_free(c->segmenter);
    free(c->image.data);
    free(c->edges.point);
    free(c->edges.chain);
    free(c->segments.item);
}

static void chain_run(chain *c, scene_level *level, const void *scene, double noise,
                      uint64_t *seed) {
    picture_draw(&c->image, level, scene, noise, seed);
    canny_run(c->canny, &c->image, &c->edges);
    segmenter_run(c->segmenter, &c->edges, &c->image, &c->segments);
}

/* A figure, marked when it is outside of its goal. */
static void print(const char *format, double value, double low, double high) {
    printf(format, value);
    putchar(value >= low && value <= high ? ' ' : '!');
}

static void row(chain *c, double noise, double contrast, double length, int poses, uint64_t *seed) {
    double offset = 0, angle = 0, mean = 0, x = 0, y = 0, nees = 0, chi2 = 0;
    int found = 0;
    for (int i = 0; i < poses; i++) {
        strip s = strip_anywhere(SIZE, SIZE, length, contrast, seed);
        chain_run(c, strip_level, &s, noise, seed);
        const arris_segment *g = strip_find(&s, &c->segments);
        if (!g)
            continue;
        double fitted = hypot(g->x2 - g->x1, g->y2 - g->y1) - 2 * TRIM;
        double bound = strip_bound(&s, noise, fitted, HALF);
        strip_error e = strip_compare(&s, g);
        double a = e.offset / bound, b = e.angle * fitted / (sqrt(12) * bound);
        offset += a * a, angle += b * b, mean += a, nees += e.nees, chi2 += (double)g->chi2;
        x -= 2 * a * sin(s.angle), y += 2 * a * cos(s.angle);
        found++;
    }
    printf("%5.0f %8.0f %6.0f  ", noise, contrast, length);
    print("%7.3f", (double)found / poses, length < 40 ? 0 : 0.99, 1);
    print("%8.3f", sqrt(offset / found), 0, 1.3);
    print("%8.3f", sqrt(angle / found), 0, 1.5);
    print("%8.3f", mean / found, -0.1, 0.1);
    printf("%8.3f%8.3f ", x / found, y / found);
    print("%8.3f", nees / found, 0.8, 1.25);
    printf("%8.3f\n", chi2 / found);
}

static double flat(const void *scene, double x, double y) {
    (void)scene, (void)x, (void)y;
    return 120;
}

static void false_segments(double noise) {
    chain c = chain_new(NOISE_WIDTH, NOISE_HEIGHT);
    uint64_t seed = 0xD1B54A32D192ED03;
    uint32_t found = 0;
    for (int i = 0; i < NOISE_FRAMES; i++) {
        chain_run(&c, flat, NULL, noise, &seed);
        found += c.segments.n;
    }
    printf("%5.0f  ", noise);
    print("%7.3f", (double)found / NOISE_FRAMES, 0, 0.1);
    putchar('\n');
    chain_free(&c);
}

int main(int argc, char **argv) {
    static const double noise[] = {2, 5}, contrast[] = {40, 150}, length[] = {30, 40, 100};
    int poses = argc > 1 ? atoi(argv[1]) : 300;
    uint64_t seed = 0x9E3779B97F4A7C15;
    chain c = chain_new(SIZE, SIZE);
    printf("isolated edges, %d poses each; errors in multiples of the bound (! misses the goal)\n"
           "noise contrast length    found   offset    angle     mean       x       y      nees    "
           "chi2\n",
           poses);
    for (int a = 0; a < 2; a++)
        for (int b = 0; b < 2; b++)
            for (int l = 0; l < 3; l++)
                row(&c, noise[a], contrast[b], length[l], poses, &seed);
    chain_free(&c);
    printf("nothing but noise, %d pictures of %dx%d\nnoise  segments a picture\n", NOISE_FRAMES,
           NOISE_WIDTH, NOISE_HEIGHT);
    false_segments(2);
    false_segments(5);
    return 0;
}
