/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_corners.c: corners found where they were drawn, in pictures of every size and of both kinds.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "corners/detect.h"
#include "strip.h"

enum { SIDE = 120, MAX = 200 };

static const double blur = 0.7; /* px */

typedef struct place {
    double x, y, turn; /* px, rad */
} place;

/* The blurred step: 0 to 1 where t px passes 0. */
static double step(double t) {
    return erfc(-t / blur / M_SQRT2) / 2;
}

/* A share of white: four fields of a chessboard around the place; its corner is the place. */
static double fields(const place *c, double x, double y) {
    double a = (x - c->x) * cos(c->turn) + (y - c->y) * sin(c->turn);
    double b = (y - c->y) * cos(c->turn) - (x - c->x) * sin(c->turn);
    return 0.5 + 0.5 * (2 * step(a) - 1) * (2 * step(b) - 1);
}

/* A rectangle of 50x40 px, one of its corners being the place. */
static double rectangle(const place *c, double x, double y) {
    double a = (x - c->x) * cos(c->turn) + (y - c->y) * sin(c->turn);
    double b = (y - c->y) * cos(c->turn) - (x - c->x) * sin(c->turn);
    return step(a) * step(50 - a) * step(b) * step(40 - b);
}

static void set(const arris_image *im, int x, int y, double share) {
    uint8_t *at = im->data + y * im->stride + x * (int)im->format;
    if (im->format == ARRIS_GREY8)
        *at = (uint8_t)lround(40 + 160 * share);
    else
        *(uint16_t *)(void *)at = (uint16_t)lround(2000 + 50000 * share);
}

static arris_image draw(enum arris_format format, const place *c,
                        double (*what)(const place *, double, double)) {
    arris_image im = picture_new(SIDE, SIDE, format);
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++)
            set(&im, x, y, what(c, x, y));
    return im;
}

static double nearest(const arris_corners *found, double x, double y) {
    double best = INFINITY;
    for (uint32_t i = 0; i < found->n; i++)
        best = fmin(best, hypot((double)found->item[i].x - x, (double)found->item[i].y - y));
    return best;
}

/* The corners of a picture that it frees; `item` holds `max`. */
static arris_corners find(arris_image im, int32_t method, arris_corner *item, uint32_t max) {
    arris_corners found = {.max = max, .item = item};
    detect_params p = {method, 0.05, 5};
    assert_int_equal(detect_corners(&p, &im, &found), 0);
    assert_true(found.n <= max);
    free(im.data);
    return found;
}

static void check_place(int32_t method, enum arris_format format, const place *c) {
    arris_corner item[MAX];
    arris_corners found = find(draw(format, c, fields), method, item, MAX);
    assert_true(nearest(&found, c->x, c->y) < 0.02);
    found = find(draw(format, c, rectangle), method, item, MAX);
    assert_int_equal(found.n, 4);
    for (int k = 0; k < 4; k++) {
        double a = 50 * (k % 2), b = 40 * (k / 2);
        assert_true(nearest(&found, c->x + a * cos(c->turn) - b * sin(c->turn),
                            c->y + a * sin(c->turn) + b * cos(c->turn)) < 0.1);
    }
}

static void corners_are_where_they_were_drawn(void **state) {
    (void)state;
    for (int k = 0; k < 12; k++) {
        place c = {45 + 0.37 * k, 40 - 0.29 * k, 0.13 * (k % 5)};
        for (int32_t method = DETECT_HARRIS; method <= DETECT_SHI_TOMASI; method++) {
            check_place(method, ARRIS_GREY8, &c);
            check_place(method, ARRIS_GREY16, &c);
        }
    }
}

/* Grey levels without any order, always the same. */
static arris_image noise(enum arris_format format, int width, int height) {
    arris_image im = picture_new(width, height, format);
    uint32_t random = 1;
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++)
            set(&im, x, y, (random = random * 1664525U + 1013904223U) / 4294967296.);
    return im;
}

static void the_strongest_are_kept_and_the_rest_is_counted(void **state) {
    (void)state;
    arris_corner all[4000], few[10];
    arris_corners whole = find(noise(ARRIS_GREY8, 200, 150), DETECT_HARRIS, all, 4000);
    arris_corners cut = find(noise(ARRIS_GREY8, 200, 150), DETECT_HARRIS, few, 10);
    assert_true(whole.n > 100 && whole.lost == 0 && cut.n == 10);
    assert_int_equal(cut.lost, whole.n - 10);
    for (uint32_t i = 0; i < whole.n; i++)
        assert_true(i == 0 || all[i].strength <= all[i - 1].strength);
    for (uint32_t i = 0; i < 10; i++)
        assert_true(few[i].x == all[i].x && few[i].y == all[i].y);
}

static void every_size_is_safe(void **state) {
    (void)state;
    const int sides[] = {1, 2, 3, 5, 14, 15, 16, 33};
    arris_corner item[MAX];
    for (int i = 0; i < 64; i++)
        for (int32_t method = DETECT_HARRIS; method <= DETECT_SHI_TOMASI; method++)
            for (int format = ARRIS_GREY8; format <= ARRIS_GREY16; format++) {
                int width = sides[i % 8], height = sides[i / 8];
                arris_image im = noise((enum arris_format)format, width, height);
                arris_corners found = find(im, method, item, MAX);
                for (uint32_t k = 0; k < found.n; k++)
                    assert_true(isfinite(item[k].x) && isfinite(item[k].y));
            }
}

static void a_blank_picture_has_none(void **state) {
    (void)state;
    arris_corner item[MAX];
    for (int format = ARRIS_GREY8; format <= ARRIS_GREY16; format++) {
        arris_image im = picture_new(64, 48, (enum arris_format)format);
        assert_int_equal(find(im, DETECT_SHI_TOMASI, item, MAX).n, 0);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(corners_are_where_they_were_drawn),
        cmocka_unit_test(the_strongest_are_kept_and_the_rest_is_counted),
        cmocka_unit_test(every_size_is_safe),
        cmocka_unit_test(a_blank_picture_has_none),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
