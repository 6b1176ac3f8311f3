/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_usb.c: what usbsrc makes of a camera's descriptors, of its payloads, whole and damaged, and
 * of its clock. tests/vm runs it on a device.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "usb/assembler.h"
#include "usb/clock.h"
#include "usb/descriptors.h"
#include "vm/uvc_descriptors.h"

/* ---- descriptors ----------------------------------------------------------------------------- */

static uvc_camera cam;
static fault why;

static void a_camera_is_understood(void **state) {
    (void)state;
    for (int bulk = 0; bulk <= 1; bulk++) {
        uvc_bytes b = uvc_configuration(bulk);
        assert_int_equal(uvc_parse(b.data, b.n, &cam, &why), 0);
        assert_true(cam.control == 0 && cam.streaming == 1 && cam.version == 0x110);
        assert_int_equal(cam.clock, CAMERA_CLOCK);
        assert_true(cam.terminal == CAMERA_TERMINAL_ID && cam.unit == PROCESSING_UNIT_ID);
        assert_true(cam.terminal_controls == 0x2a && cam.unit_controls == 0x201);
        static const char *const names[] = {"YUYV", "GREY", "MJPEG"};
        assert_int_equal(cam.n_frames, 3);
        for (int i = 0; i < 3; i++) {
            const uvc_frame *m = &cam.frame[i];
            assert_string_equal(m->pixels->name, names[i]);
            assert_true(m->format == i + 1 && m->frame == 1 && m->width == 320 && m->height == 240);
            assert_true(m->n == 2 && m->interval[0] == 333333 && m->usual == 666666 && !m->step);
        }
        assert_int_equal(cam.n_alternates, bulk ? 1 : 2);
        const uvc_alternate *last = &cam.alternate[cam.n_alternates - 1];
        assert_true(last->bulk == bulk && last->endpoint == 0x81 &&
                    last->packet == (bulk ? 512 : 1024));
        assert_int_equal(last->setting, bulk ? 0 : 2);
    }
}

/* Every byte is damaged in every way, and the list is cut everywhere: whatever is accepted holds.
 */
static void nothing_in_it_is_trusted(void **state) {
    (void)state;
    unsigned refused = 0;
    for (size_t at = 0; at < uvc_configuration(0).n; at++)
        for (int value = 0; value < 256; value++) {
            uvc_bytes b = uvc_configuration(0);
            b.data[at] = (uint8_t)value;
            uint8_t *exact = malloc(b.n);
            memcpy(exact, b.data, b.n);
            if (uvc_parse(exact, b.n, &cam, &why)) {
                refused++;
            } else {
                assert_true(cam.n_frames && cam.n_frames <= 3 && cam.n_alternates);
                for (uint32_t i = 0; i < cam.n_frames; i++)
                    assert_true(cam.frame[i].width && cam.frame[i].height && cam.frame[i].usual &&
                                uvc_interval(&cam.frame[i], 30));
                for (uint32_t i = 0; i < cam.n_alternates; i++)
                    assert_true(cam.alternate[i].packet);
            }
            free(exact);
        }
    assert_true(refused > 1000);
    uvc_bytes b = uvc_configuration(1);
    for (size_t n = 0; n < b.n; n++) {
        uint8_t *exact = malloc(n ? n : 1);
        memcpy(exact, b.data, n);
        assert_int_equal(uvc_parse(exact, n, &cam, &why), ARRIS_E_INPUT);
        free(exact);
    }
}

/* The interface may have a bulk endpoint for stills beside the pictures' own. */
static void stills_are_not_the_stream(void **state) {
    (void)state;
    uvc_bytes b = uvc_configuration(0);
    UVC_ADD(&b, 7, 5, 0x82, 2, U16(512), 0);
    assert_int_equal(uvc_parse(b.data, b.n, &cam, &why), 0);
    assert_int_equal(cam.n_alternates, 2);
    for (uint32_t i = 0; i < cam.n_alternates; i++)
        assert_true(!cam.alternate[i].bulk && cam.alternate[i].endpoint == 0x81);
}

static void intervals_are_the_nearest(void **state) {
    (void)state;
    uvc_frame listed = {.usual = 333333, .n = 3, .interval = {166666, 333333, 666666}},
              range = {.usual = 400000, .n = 2, .interval = {100000, 1000000}, .step = 50000};
    assert_int_equal(uvc_interval(&listed, 0), 333333);
    assert_int_equal(uvc_interval(&listed, 1000), 166666);
    assert_int_equal(uvc_interval(&listed, 29), 333333);
    assert_int_equal(uvc_interval(&listed, 1), 666666);
    assert_int_equal(uvc_interval(&range, 0), 400000);
    assert_int_equal(uvc_interval(&range, 30), 350000);
    assert_int_equal(uvc_interval(&range, 1e6), 100000);
    assert_int_equal(uvc_interval(&range, 0.1), 1000000);
}

/* ---- payloads -------------------------------------------------------------------------------- */

enum { SIZE = 100, FID = 1, END = 2, ERR = 64 };
static assembler a;

static int begin(void **state) {
    (void)state;
    return assembler_init(&a, SIZE, SIZE);
}

static int end(void **state) {
    (void)state;
    assembler_free(&a);
    return 0;
}

/* A payload of n bytes `value`. */
static void payload(int bits, size_t n, int value) {
    uint8_t *p = malloc(n + 2);
    p[0] = 2;
    p[1] = (uint8_t)bits;
    memset(p + 2, value, n);
    assembler_begin(&a, p, n + 2, 1000 + value);
    assembler_end(&a);
    free(p);
}

static void takes(int value) {
    const picture *p = assembler_oldest(&a);
    assert_non_null(p);
    assert_int_equal(p->n, SIZE);
    assert_int_equal(p->arrived, 1000 + value);
    for (int i = 0; i < SIZE; i++)
        assert_int_equal(p->data[i], value);
    assembler_next(&a);
}

#define COUNTS(f, s, l, w, d)                                                                      \
    do {                                                                                           \
        assert_int_equal(a.counts.flagged, f);                                                     \
        assert_int_equal(a.counts.shorter, s);                                                     \
        assert_int_equal(a.counts.longer, l);                                                      \
        assert_int_equal(a.counts.wrong_id, w);                                                    \
        assert_int_equal(a.counts.dropped, d);                                                     \
    } while (0)

static void whole_pictures_come_in_order(void **state) {
    (void)state;
    payload(0, 40, 1), payload(0, 40, 1), payload(END, 20, 1);
    payload(FID | END, SIZE, 2);
    payload(0, 60, 3), payload(0, 40, 3); /* its end is not marked, but */
    payload(FID, 100, 4);                 /* another one begins */
    payload(FID | END, 0, 4);
    payload(FID | END, 0, 4); /* nothing more of it */
    for (int i = 1; i <= 4; i++)
        takes(i);
    assert_null(assembler_oldest(&a));
    COUNTS(0, 0, 0, 0, 0);
}

static void damaged_pictures_are_left_out(void **state) {
    (void)state;
    payload(END, SIZE - 1, 1);
    payload(FID | END, SIZE + 1, 2);
    payload(0, 50, 3), payload(ERR, 25, 3), payload(END, 25, 3);
    payload(FID, 50, 4), assembler_gap(&a), payload(FID | END, 50, 4);
    payload(END, SIZE, 5);
    takes(5);
    assert_null(assembler_oldest(&a));
    COUNTS(2, 1, 1, 0, 0);
}

static void damaged_headers_cost_one_picture(void **state) {
    (void)state;
    static const uint8_t bad[][3] = {{0, 0, 0}, {1, 0, 0}, {200, 0, 0}};
    for (int i = 0; i < 3; i++) {
        payload(0, 50, 1);
        assembler_begin(&a, bad[i], 3, 0);
        assembler_end(&a);
        payload(END, 50, 1);
        payload(FID | END, SIZE, 2);
        takes(2);
        assert_null(assembler_oldest(&a));
        assert_int_equal(a.counts.flagged, i + 1);
    }
    assembler_begin(&a, bad[0], 3, 0); /* where one would have begun */
    assembler_more(&a, bad[0], 3);
    assembler_end(&a);
    payload(FID | END, SIZE, 7);
    takes(7);
    COUNTS(4, 0, 0, 0, 0);
}

static void a_wrong_id_is_seen_through(void **state) {
    (void)state;
    payload(END, SIZE, 1);
    payload(0, 50, 2), payload(END, 50, 2); /* did not toggle */
    payload(FID | END, SIZE, 3);
    for (int i = 1; i <= 3; i++)
        takes(i);
    COUNTS(0, 0, 0, 1, 0);
    payload(0, 50, 4), payload(FID | END, 50, 4); /* toggled too early: both parts are too short */
    payload(END, SIZE, 5);
    takes(5);
    COUNTS(0, 2, 0, 1, 0);
}

static void nobody_takes_them(void **state) {
    (void)state;
    for (int i = 0; i < ASSEMBLER_PICTURES + 3; i++)
        payload(END | (i & 1), SIZE, i);
    for (int i = 3; i < ASSEMBLER_PICTURES + 3; i++)
        takes(i);
    assert_null(assembler_oldest(&a));
    COUNTS(0, 0, 0, 0, 3);
}

static void clocks_are_read_when_the_header_holds_them(void **state) {
    (void)state;
    uint8_t p[12 + SIZE] = {12, 0x0c | END, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9};
    assembler_begin(&a, p, sizeof p, 0);
    assert_true(a.has_clock && a.stc == 0x08070605);
    assembler_end(&a);
    assert_true(assembler_oldest(&a)->has_pts && assembler_oldest(&a)->pts == 0x04030201);
    assembler_next(&a);
    p[0] = 11; /* one byte too short for both */
    p[1] |= FID;
    assembler_begin(&a, p, 11 + SIZE, 0);
    assert_false(a.has_clock);
    assembler_end(&a);
    assert_true(assembler_oldest(&a)->has_pts);
}

/* ---- the clock ------------------------------------------------------------------------------- */

/* A camera's clock of 1 MHz that runs 50 ppm fast and wraps round; payloads arrive 1 to 9 ms late.
 */
static void the_cameras_clock_dates_pictures(void **state) {
    (void)state;
    source_clock c;
    clock_init(&c, 1000000);
    int64_t when, worst = 0;
    assert_false(clock_date(&c, 0, 0, &when));
    for (int64_t t = 0; t < 20000000000; t += 10000000) { /* ns */
        uint32_t ticks = 0xffff0000u + (uint32_t)((double)t * 1.00005 / 1000);
        int64_t arrived = t + 1000000 + rand() % 8000000;
        clock_note(&c, ticks, arrived);
        if (t < 1000000000)
            continue;
        assert_true(clock_date(&c, ticks - 30000, arrived, &when)); /* begun 30 ms before */
        int64_t error = llabs(when - (t - 30000000));
        worst = error > worst ? error : worst;
    }
    assert_true(worst < 1500000); /* the least delay, 1 ms, and what it drifts in the window */
}

/* Its frequency is not what it says: then its dates are not to be believed. */
static void a_wrong_clock_is_found_out(void **state) {
    (void)state;
    source_clock c;
    clock_init(&c, 48000000);
    int64_t when = 0;
    for (int64_t t = 0; t < 5000000000; t += 10000000)
        clock_note(&c, (uint32_t)(t / 1000), t);
    assert_false(clock_date(&c, 5000000 - 40000000, 5000000000, &when));
    clock_init(&c, 0);
    clock_note(&c, 1, 1);
    assert_false(clock_date(&c, 1, 1, &when));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_camera_is_understood),
        cmocka_unit_test(nothing_in_it_is_trusted),
        cmocka_unit_test(stills_are_not_the_stream),
        cmocka_unit_test(intervals_are_the_nearest),
        cmocka_unit_test_setup_teardown(whole_pictures_come_in_order, begin, end),
        cmocka_unit_test_setup_teardown(damaged_pictures_are_left_out, begin, end),
        cmocka_unit_test_setup_teardown(damaged_headers_cost_one_picture, begin, end),
        cmocka_unit_test_setup_teardown(a_wrong_id_is_seen_through, begin, end),
        cmocka_unit_test_setup_teardown(nobody_takes_them, begin, end),
        cmocka_unit_test_setup_teardown(clocks_are_read_when_the_header_holds_them, begin, end),
        cmocka_unit_test(the_cameras_clock_dates_pictures),
        cmocka_unit_test(a_wrong_clock_is_found_out),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
