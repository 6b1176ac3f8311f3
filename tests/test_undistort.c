/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_undistort.c: the lens taken out of points and of pictures. A straight edge is rendered as
 * each lens bends it, and both ways must find it straight again where it is.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "arris_geometry.h"
#include "process.h"
#include "scratch.h"
#include "undistort/inverse.h"
#include "undistort/remap.h"

static const arris_camera box = {320,       240,      380.60892, 378.42038, 0.05367, 153.27998,
                                 119.84683, -0.25888, 0.36657,   0.0011,    5e-05,   0};
/* bends the corners by 120 px */
static const arris_camera heavy = {640,   480,  450, 440,  6,       326.2,
                                   235.1, -0.4, 0.2, 2e-3, -1.5e-3, -0.02};
/* its pixels are wider than high by 30 % */
static const arris_camera oblong = {320,   240,  330, 429,    2,     153.3,
                                    119.8, -0.3, 0.2, 1.1e-3, -5e-4, 0};
/* folds back before its corners are reached */
static const arris_camera folding = {320, 240, 170, 170, 0, 160, 120, -0.4, 0.06, 0, 0, 0};

/* ---- points -----------------------------------------------------------------------------------
 */

static void check_table(const arris_camera *c) {
    inverse *inv = inverse_new(c);
    assert_non_null(inv);
    for (double v = 0; v <= c->height - 1; v += 0.83)
        for (double u = 0; u <= c->width - 1; u += 0.89) {
            double x, y;
            float px = (float)u, py = (float)v;
            bool there = arris_undistort(c, (double)px, (double)py, &x, &y) == 0;
            assert_int_equal(inverse_point(inv, &px, &py), there);
            if (there) {
                assert_true(fabs((double)px - x) < 3e-4);
                assert_true(fabs((double)py - y) < 3e-4);
            }
        }
    inverse_free(inv);
}

static void table_is_the_inverse(void **state) {
    (void)state;
    check_table(&box);
    check_table(&heavy);
    check_table(&oblong);
    check_table(&folding);
}

static void strange_points_are_safe(void **state) {
    (void)state;
    const float bad[] = {NAN, INFINITY, -INFINITY, 1e30F, -1e30F};
    inverse *inv = inverse_new(&box);
    for (int i = 0; i < 5; i++) {
        float x = bad[i], y = 10;
        assert_false(inverse_point(inv, &x, &y));
        x = 10, y = bad[i];
        assert_false(inverse_point(inv, &x, &y));
    }
    float x = -3, y = 245; /* just outside of the picture is no error */
    assert_true(inverse_point(inv, &x, &y));
    inverse_free(inv);
}

/* ---- chains -----------------------------------------------------------------------------------
 */

/* A row of points at every 10 px along y = 120: the first and last few have no inverse. */
static arris_edges row_of_points(arris_edge_point *point, arris_chain *chain, bool closed) {
    for (int i = 0; i < 32; i++)
        point[i] = (arris_edge_point){(float)(10 * i), 120, (float)i, (float)-i};
    chain[0] = (arris_chain){0, 20, closed};
    chain[1] = (arris_chain){20, 12, false};
    return (arris_edges){.n = 32,
                         .max = 32,
                         .n_chains = 2,
                         .max_chains = 2,
                         .lost = 7,
                         .noise = 2,
                         .camera = &folding,
                         .point = point,
                         .chain = chain};
}

static void chains_are_copied_and_split(void **state) {
    (void)state;
    arris_edge_point in_point[32], out_point[32];
    arris_chain in_chain[2], out_chain[8];
    arris_edges in = row_of_points(in_point, in_chain, true);
    arris_edges out = {.max = 32, .max_chains = 8, .point = out_point, .chain = out_chain};
    in_point[5].x = NAN;
    const arris_camera ideal = arris_camera_ideal(&folding);
    inverse *inv = inverse_new(&folding);
    uint32_t dropped = inverse_edges(inv, &in, &ideal, &out);

    uint32_t k = 0, chains = 0, expected_dropped = 0;
    bool open = false;
    for (uint32_t i = 0; i < 32; i++) {
        double x, y;
        open &= i != 20;
        if (i == 5 || arris_undistort(&folding, (double)in_point[i].x, 120, &x, &y)) {
            expected_dropped++;
            open = false;
            continue;
        }
        if (!open)
            assert_int_equal(out_chain[chains++].first, k);
        open = true;
        assert_true(fabs((double)out_point[k].x - x) < 3e-4);
        assert_true(out_point[k].gx == in_point[i].gx && out_point[k].gy == in_point[i].gy);
        k++;
    }
    assert_true(expected_dropped > 3);
    assert_int_equal(dropped, expected_dropped);
    assert_int_equal(out.n, k);
    assert_int_equal(out.n_chains, chains);
    assert_int_equal(out_chain[0].first + out_chain[0].n, out_chain[1].first);
    assert_false(out_chain[0].closed); /* it has lost points */
    assert_true(out.camera == &ideal && out.noise == 2 && out.lost == 7);
    inverse_free(inv);
}

static void closed_chain_stays_closed(void **state) {
    (void)state;
    arris_edge_point in_point[32], out_point[32];
    arris_chain in_chain[2], out_chain[2];
    arris_edges in = row_of_points(in_point, in_chain, true);
    arris_edges out = {.max = 32, .max_chains = 2, .point = out_point, .chain = out_chain};
    inverse *inv = inverse_new(&box);
    assert_int_equal(inverse_edges(inv, &in, &box, &out), 0);
    assert_int_equal(out.n_chains, 2);
    assert_true(out_chain[0].closed && out_chain[0].n == 20);
    assert_false(out_chain[1].closed);
    inverse_free(inv);
}

static void full_layer_truncates_and_counts(void **state) {
    (void)state;
    arris_edge_point in_point[32], out_point[32];
    arris_chain in_chain[2], out_chain[2];
    arris_edges in = row_of_points(in_point, in_chain, true);
    inverse *inv = inverse_new(&box);
    arris_edges out = {.max = 15, .max_chains = 2, .point = out_point, .chain = out_chain};
    assert_int_equal(inverse_edges(inv, &in, &box, &out), 0);
    assert_true(out.n == 15 && out.n_chains == 1 && out.lost == 7 + 17);
    assert_false(out_chain[0].closed);
    out = (arris_edges){.max = 32, .max_chains = 1, .point = out_point, .chain = out_chain};
    assert_int_equal(inverse_edges(inv, &in, &box, &out), 0);
    assert_true(out.n == 20 && out.n_chains == 1 && out.lost == 7 + 12 && out.lost_chains == 1);
    inverse_free(inv);
}

/* ---- both ways on a straight edge -------------------------------------------------------------
 */

enum { DARK = 8000, BRIGHT = 52000 };

typedef struct edge {
    double nx, ny, d; /* nx x + ny y = d in ideal pixels; bright where it is greater */
} edge;

static arris_image new_image(const arris_camera *c) {
    arris_image im = {ARRIS_GREY16, c->width, c->height, 2 * c->width, c, NULL};
    im.data = calloc((size_t)c->height * c->width + 32, 2);
    return im;
}

static uint16_t *pixel(const arris_image *im, int u, int v) {
    return (uint16_t *)(void *)(im->data + v * im->stride) + u;
}

/* Where an ideal camera sees every pixel and those one further out: (x, y) pairs for free(). */
static double *ideal_places(const arris_camera *c) {
    size_t n = (size_t)(c->width + 2) * (size_t)(c->height + 2);
    double *place = malloc(2 * n * sizeof *place), *at = place;
    assert_non_null(place);
    for (int v = -1; v <= c->height; v++)
        for (int u = -1; u <= c->width; u++, at += 2)
            assert_int_equal(arris_undistort(c, u, v, &at[0], &at[1]), 0);
    return place;
}

/* The edge as the lens bends it, blurred by 1.2 px of its picture. */
static void render(const arris_camera *c, const double *place, const edge *e, arris_image *im) {
    const int row = 2 * (c->width + 2);
    for (int v = 0; v < c->height; v++)
        for (int u = 0; u < c->width; u++) {
            const double *at = place + (v + 1) * row + 2 * (u + 1);
            double gu = e->nx * (at[2] - at[-2]) + e->ny * (at[3] - at[-1]);
            double gv = e->nx * (at[row] - at[-row]) + e->ny * (at[row + 1] - at[1 - row]);
            double t = (e->nx * at[0] + e->ny * at[1] - e->d) / (hypot(gu, gv) / 2) / 1.2;
            *pixel(im, u, v) = (uint16_t)(DARK + (BRIGHT - DARK) * 0.5 * erfc(-t / M_SQRT2) + 0.5);
        }
}

/* Where the grey level passes the middle between pixel (u, v) and its neighbour, or -1. */
static double crossing(const arris_image *im, int u, int v, int du, int dv) {
    const double middle = (DARK + BRIGHT) / 2.;
    double a = *pixel(im, u, v) - middle, b = *pixel(im, u + du, v + dv) - middle;
    return (a < 0) != (b < 0) ? a / (a - b) : -1;
}

/* Whether the lens saw the ideal point, with a margin for the kernel of the resampling. */
static bool was_seen(const arris_camera *c, double x, double y) {
    double u, v;
    arris_distort(c, x, y, &u, &v);
    return u > 5 && v > 5 && u < c->width - 6 && v < c->height - 6;
}

/* The greatest distance from the edge of all its points in a picture, after `inv` when there is
 * one. Counts the points. */
static double worst(const arris_image *im, const arris_camera *c, const edge *e, const inverse *inv,
                    int *n) {
    double most = 0;
    int du = fabs(e->nx) > fabs(e->ny), dv = !du;
    for (int v = 6; v < im->height - 6; v++)
        for (int u = 6; u < im->width - 6; u++) {
            double t = crossing(im, u, v, du, dv);
            float x = (float)(u + t * du), y = (float)(v + t * dv);
            if (t < 0 || (!inv && !was_seen(c, (double)x, (double)y)))
                continue;
            assert_true(!inv || inverse_point(inv, &x, &y));
            most = fmax(most, fabs(e->nx * (double)x + e->ny * (double)y - e->d));
            (*n)++;
        }
    return most;
}

/* Edges of twelve directions, each through the middle and on both sides of it. */
static void both_ways(const arris_camera *c) {
    arris_image bent = new_image(c), straight = new_image(c);
    inverse *inv = inverse_new(c);
    remap *map = remap_new(c);
    double *place = ideal_places(c);
    assert_true(inv && map && bent.data && straight.data);
    int n = 0, m = 0;
    for (int k = 0; k < 36; k++) {
        double a = M_PI * 2 * (k % 12 + 0.3) / 12, out = (k / 12 - 1) * 0.35 * c->height;
        edge e = {cos(a), sin(a), cos(a) * c->width / 2. + sin(a) * c->height / 2. + out};
        render(c, place, &e, &bent);
        assert_int_equal(remap_image(map, &bent, &straight), 0);
        assert_true(worst(&bent, c, &e, inv, &n) < 0.02);
        assert_true(worst(&straight, c, &e, NULL, &m) < 0.05);
    }
    assert_true(n > 36 * c->height / 2 && m > 36 * c->height / 2);
    inverse_free(inv);
    remap_free(map);
    free(place);
    free(bent.data);
    free(straight.data);
}

static void both_ways_agree_on_the_boxs_lens(void **state) {
    (void)state;
    both_ways(&box);
}

static void both_ways_agree_on_a_heavy_lens(void **state) {
    (void)state;
    both_ways(&heavy);
}

static void both_ways_agree_on_oblong_pixels(void **state) {
    (void)state;
    both_ways(&oblong);
}

static void grey8_is_resampled_too(void **state) {
    (void)state;
    uint8_t in[240 * 320], out[240 * 320];
    memset(in, 77, sizeof in);
    arris_image a = {ARRIS_GREY8, 320, 240, 320, &box, in},
                b = {ARRIS_GREY8, 320, 240, 320, &box, out};
    remap *map = remap_new(&box);
    assert_int_equal(remap_image(map, &a, &b), 0);
    for (size_t i = 0; i < sizeof out; i++)
        assert_int_equal(out[i], 77);
    remap_free(map);
}

/* ---- the stage, in the program ----------------------------------------------------------------
 */

/* A folder with a picture of 320x240 that is dark on the left and, when `k1` is given, a camera. */
static void make_scan(const char *k1) {
    char pixels[240 * 320];
    for (int i = 0; i < 240 * 320; i++)
        pixels[i] = i % 320 < 100 ? 20 : 100;
    scratch_mkdir("scan");
    FILE *f = fopen(scratch("scan/0.pgm"), "w");
    assert_non_null(f);
    fprintf(f, "P5\n320 240\n255\n");
    assert_int_equal(fwrite(pixels, sizeof pixels, 1, f), 1);
    assert_int_equal(fclose(f), 0);
    if (k1)
        scratch_write("scan/camera.json",
                      "{\"width\": 320, \"height\": 240, \"fx\": 380, \"fy\": 380, \"skew\": 0, "
                      "\"cx\": 160, \"cy\": 120, \"k1\": %s, \"k2\": 0, \"p1\": 0, \"p2\": 0, "
                      "\"k3\": 0}",
                      k1);
}

/* Runs `imagesrc ! STAGES ! fakesink`, expects the exit code and a word in what is said. */
static void expect(const char *options, const char *stages, int code, const char *word) {
    char line[1024];
    snprintf(line, sizeof line, "launch %s imagesrc location=%s ! %s ! fakesink", options,
             scratch("scan"), stages);
    process p = arris_run(line);
    if (p.code != code || (!strstr(p.out, word) && !strstr(p.err, word)))
        fail_msg("%s: exit %d, said: %s%s", line, p.code, p.out, p.err);
    process_free(&p);
}

static void stage_takes_what_reaches_it(void **state) {
    (void)state;
    make_scan("-0.25");
    expect("--check", "undistort", 0, "image -> image");
    expect("--check", "edges ! undistort", 0, "edges -> edges");
    expect("--check", "edges ! undistort what=image", 0, "image -> image");
    expect("", "edges ! undistort", 0, "");
    expect("", "undistort ! edges", 0, "");
    expect("", "undistort ! edges ! undistort", 0, ""); /* the second has nothing to do */
    expect("", "undistort what=points", 2, "'edges'");
    expect("", "edges ! undistort ! undistort", 0, "");
    expect("", "edges ! undistort what=image ! undistort", 4, "the lens is not the one");
}

static void stage_without_a_lens(void **state) {
    (void)state;
    make_scan("0");
    expect("", "undistort", 0, "");
    expect("", "edges ! undistort", 0, "");
    make_scan(NULL);
    expect("--check", "undistort", 4, "camera.json");
    expect("", "edges ! undistort", 4, "camera.json");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(table_is_the_inverse),
        cmocka_unit_test(strange_points_are_safe),
        cmocka_unit_test(chains_are_copied_and_split),
        cmocka_unit_test(closed_chain_stays_closed),
        cmocka_unit_test(full_layer_truncates_and_counts),
        cmocka_unit_test(both_ways_agree_on_the_boxs_lens),
        cmocka_unit_test(both_ways_agree_on_a_heavy_lens),
        cmocka_unit_test(both_ways_agree_on_oblong_pixels),
        cmocka_unit_test(grey8_is_resampled_too),
        cmocka_unit_test(stage_takes_what_reaches_it),
        cmocka_unit_test(stage_without_a_lens),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
