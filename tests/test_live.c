/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_live.c: that frames of cameras carry the middle of their exposure.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <time.h>

#include <cmocka.h>

#include "camera/live.h"
#include "internal.h"

static int64_t wall_us(void) {
    struct timespec t;
    clock_gettime(CLOCK_REALTIME, &t);
    return (int64_t)t.tv_sec * 1000000 + t.tv_nsec / 1000;
}

/* A frame stamped 40 ms ago: how long ago its middle was, ms; known as well as this took. */
static void check(live l, bool start, double exposure, double expected) {
    arris_frame f = {.seq = 0};
    int64_t before = wall_us();
    live_frame(&l, &f, 17, arris_now() - 40000000, start, exposure);
    int64_t after = wall_us();
    int64_t middle = arris_frame_utime(&f) + (int64_t)(expected * 1000);
    assert_true(middle >= before - 2 && middle <= after + 2);
    assert_int_equal(arris_frame_index(&f), 17);
    assert_int_equal(l.made, 1);
}

static void frames_are_dated_by_the_middle_of_their_exposure(void **state) {
    (void)state;
    live said = {.exposure_time = -1}, given = {.exposure_time = 8},
         slow = {.exposure_time = -1, .readout = 5};
    check(said, true, 0, 40);
    check(said, true, 10, 35); /* it began 40 ms ago */
    check(said, false, 10, 45);
    check(given, true, 10, 36); /* the user knows better */
    check(given, false, 0, 44);
    check(slow, false, 10, 50); /* its last byte came 5 ms after the exposure's end */
    check(slow, true, 10, 35);
}

static void it_ends_after_as_many_as_are_wanted(void **state) {
    (void)state;
    arris_frame f = {.seq = 0};
    live l = {.frames = 2};
    assert_false(live_done(&l));
    live_frame(&l, &f, 0, 0, true, 0);
    assert_false(live_done(&l));
    live_frame(&l, &f, 1, 0, true, 0);
    assert_true(live_done(&l));
    l.frames = -1;
    assert_false(live_done(&l));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frames_are_dated_by_the_middle_of_their_exposure),
        cmocka_unit_test(it_ends_after_as_many_as_are_wanted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
