/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_flow.c: the flow of a textured picture that moves by a known amount, and its grey coding.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "flow/dense.h"
#include "flow/grey.h"
#include "strip.h"

enum { MOST = 320 * 240 };

/* A smooth texture of 24 waves in all directions, 8 to 40 px long, from 0 to 1. */
static double texture(double x, double y) {
    double sum = 0;
    for (int k = 0; k < 24; k++) {
        double length = 8 + 32 * fmod(k * 0.618, 1), angle = 2.4 * k;
        sum += sin(2 * M_PI * (x * cos(angle) + y * sin(angle)) / length + k);
    }
    return fmin(fmax(0.5 + sum / 24, 0), 1);
}

static void set(const arris_image *im, int x, int y, double share) {
    uint8_t *at = im->data + y * im->stride + x * (int)im->format;
    if (im->format == ARRIS_GREY8)
        *at = (uint8_t)lround(255 * share);
    else
        *(uint16_t *)(void *)at = (uint16_t)lround(4095 * share); /* 12 bits, as cameras give */
}

static void draw(const arris_image *im, double dx, double dy) {
    for (int y = 0; y < im->height; y++)
        for (int x = 0; x < im->width; x++)
            set(im, x, y, texture(x - dx, y - dy));
}

typedef struct planes {
    float u[MOST], v[MOST];
} planes;

static arris_flow flow_of(planes *p, int width, int height) {
    return (arris_flow){.width = width, .height = height, .u = p->u, .v = p->v};
}

static int by_size(const void *a, const void *b) {
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static double median(float *v, size_t n) {
    qsort(v, n, sizeof *v, by_size);
    return (double)v[n / 2];
}

static void check_motion(enum arris_format format, double dx, double dy) {
    arris_image im = picture_new(320, 240, format);
    planes *p = malloc(sizeof *p);
    arris_flow out = flow_of(p, 320, 240);
    dense *d = dense_new();
    assert_true(d && p);
    draw(&im, 0, 0);
    assert_int_equal(dense_run(d, &im, &out), 0);
    assert_false(out.valid);
    assert_true(p->u[0] == 0 && p->v[MOST - 1] == 0);
    draw(&im, dx, dy);
    assert_int_equal(dense_run(d, &im, &out), 0);
    assert_true(out.valid);
    assert_true(fabs(median(p->u, MOST) - dx) < 0.1);
    assert_true(fabs(median(p->v, MOST) - dy) < 0.1);
    assert_int_equal(dense_run(d, &im, &out), 0); /* it stands still */
    assert_true(fabs(median(p->u, MOST)) < 0.01 && fabs(median(p->v, MOST)) < 0.01);
    dense_free(d);
    free(p);
    free(im.data);
}

static void a_known_motion_is_found(void **state) {
    (void)state;
    const double motion[][2] = {{0.5, 0}, {-0.25, 0.4}, {2.3, -1.7}, {-6.5, 3.25}, {0, -11.4}};
    for (size_t k = 0; k < sizeof motion / sizeof *motion; k++) {
        check_motion(ARRIS_GREY8, motion[k][0], motion[k][1]);
        check_motion(ARRIS_GREY16, motion[k][0], motion[k][1]);
    }
}

static void every_size_and_noise_are_safe(void **state) {
    (void)state;
    const int sides[] = {1, 2, 3, 7, 12, 31, 32, 65};
    uint32_t random = 1;
    planes *p = malloc(sizeof *p);
    assert_non_null(p);
    for (int i = 0; i < 128; i++) {
        arris_image im =
            picture_new(sides[i % 8], sides[i / 8 % 8], i < 64 ? ARRIS_GREY8 : ARRIS_GREY16);
        arris_flow out = flow_of(p, im.width, im.height);
        dense *d = dense_new();
        for (int k = 0; k < 3; k++) {
            for (int j = 0; j < im.width * im.height; j++)
                set(&im, j % im.width, j / im.width,
                    (random = random * 1664525U + 1013904223U) / 4294967296.);
            assert_int_equal(dense_run(d, &im, &out), 0);
            for (int j = 0; j < im.width * im.height; j++)
                assert_true(isfinite(p->u[j]) && isfinite(p->v[j]));
        }
        dense_free(d);
        free(im.data);
    }
    free(p);
}

static void grey_levels_are_as_said(void **state) {
    (void)state;
    const float px[] = {0, -4, 4, -2, 2, -9, 9, 0.016F, -0.016F, NAN, INFINITY, -INFINITY};
    const uint8_t expected[] = {128, 0, 255, 64, 192, 0, 255, 129, 127, 128, 255, 0};
    uint8_t grey[12];
    grey_of(px, 12, 4, grey);
    for (int i = 0; i < 12; i++)
        assert_int_equal(grey[i], expected[i]);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_known_motion_is_found),
        cmocka_unit_test(every_size_and_noise_are_safe),
        cmocka_unit_test(grey_levels_are_as_said),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
