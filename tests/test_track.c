/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_track.c: the box tracker on lines that move as lines in a picture do: they cross, break,
 * come and go, and the camera stops, turns back, or skips a frame.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "../plugins/track/index.h"
#include "../plugins/track/sweep.h"
#include "../plugins/track/tracker.h"
#include "chance.h"

enum { MOST = 20000 };

static arris_segment item[MOST];
static arris_track found[MOST];
static arris_segments segments;
static arris_tracks tracks;

static tracker *begin(int32_t max_tracks) {
    tracker *t = tracker_new(&(tracker_params){
        .box = 5, .near = 100, .far = 10000, .max_gap = 5, .max_tracks = max_tracks});
    assert_non_null(t);
    segments = (arris_segments){.max = MOST, .item = item};
    tracks = (arris_tracks){.max = MOST, .item = found};
    return t;
}

/* Adds a segment as a detector finds it: 0.1 px off across the line, 1.5 px along it. */
static void put(double x1, double y1, double x2, double y2) {
    double length = hypot(x2 - x1, y2 - y1), ux = (x2 - x1) / length, uy = (y2 - y1) / length;
    double a = 1.5 * normal(), b = 1.5 * normal(), c = 0.1 * normal(), d = 0.1 * normal();
    item[segments.n++] = (arris_segment){.x1 = x1 + a * ux - c * uy,
                                         .y1 = y1 + a * uy + c * ux,
                                         .x2 = x2 + b * ux - d * uy,
                                         .y2 = y2 + b * uy + d * ux};
}

static void run(tracker *t) {
    tracker_run(t, &segments, NULL, &tracks);
    segments.n = 0;
}

/* The id of the track that has the segment, or -1. */
static int32_t track_of(int32_t segment) {
    for (uint32_t i = 0; i < tracks.n; i++)
        if (found[i].segment == segment)
            return found[i].id;
    return -1;
}

/* Every segment has one track, ids ascend, and none was used before it was started. */
static void assert_sound(uint32_t n_segments) {
    uint32_t seen = 0;
    for (uint32_t i = 0; i < tracks.n; i++) {
        assert_true(i == 0 || found[i].id > found[i - 1].id);
        assert_in_range(found[i].id, 0, tracks.total - 1);
        seen += found[i].segment >= 0;
    }
    assert_int_equal(seen, n_segments);
}

/* ---- what the camera does -----------------------------------------------------------------------
 */

/* Twelve lines, in pairs 3 to 8 px apart of the same polarity, that move by 2.3 px a step, less
 * when they are far. The segment of line k is k. */
static void scene(double steps) {
    for (int k = 0; k < 12; k++) {
        double apart = 3 + k / 2, speed = 2.3 - 0.1 * (k / 2), slope = 5.0 * (k / 2 - 3);
        double x = 30 + 45 * (k / 2) + (k % 2) * apart + speed * steps;
        put(x, 40 + k, x + slope, 180 - 3 * k);
    }
}

/* Frame i is taken at the i-th of these places, in steps; every track stays with its line. */
static void follow(const double *places, int n) {
    tracker *t = begin(100);
    for (int i = 0; i < n; i++) {
        scene(places[i]);
        run(t);
        assert_sound(12);
        for (int k = 0; k < 12; k++)
            assert_int_equal(track_of(k), k);
    }
    assert_int_equal(tracks.total, 12);
    tracker_free(t);
}

static void pairs_do_not_swap(void **state) {
    (void)state;
    double at_once[40], softly[40] = {0};
    for (seed = 1; seed < 20; seed++) {
        for (int i = 0; i < 40; i++) {
            at_once[i] = i;
            softly[i] = i ? softly[i - 1] + fmin(1, 0.25 * i) : 0;
        }
        follow(at_once, 40);
        follow(softly, 40);
    }
}

static void motion_reverses(void **state) {
    (void)state;
    double places[40];
    for (seed = 1; seed < 20; seed++) {
        for (int i = 0; i < 40; i++)
            places[i] = i < 20 ? i : 38 - i;
        follow(places, 40);
    }
}

static void motion_stops_and_goes_on(void **state) {
    (void)state;
    double places[60];
    for (seed = 1; seed < 20; seed++) {
        for (int i = 0; i < 60; i++)
            places[i] = i < 15 ? i : i < 45 ? 14 : i - 30;
        follow(places, 60);
    }
}

static void frames_are_doubled_and_dropped(void **state) {
    (void)state;
    double places[60], at;
    for (seed = 1; seed < 20; seed++) {
        at = 0;
        for (int i = 0; i < 60; i++) {
            places[i] = at;
            at += i < 3 ? 1 : i % 7 == 0 ? 0 : i % 11 == 0 ? 2 : 1;
        }
        follow(places, 60);
    }
}

static void fast_motion_is_found(void **state) {
    (void)state;
    double places[20];
    for (seed = 1; seed < 20; seed++)
        for (int k = -1; k <= 1; k += 2) {
            for (int i = 0; i < 20; i++)
                places[i] = 7.5 * k * i; /* 17 px a frame, three times the box */
            follow(places, 20);
        }
}

/* ---- what lines do ------------------------------------------------------------------------------
 */

static void crossing_lines_keep_their_tracks(void **state) {
    (void)state;
    seed = 2;
    tracker *t = begin(100);
    for (int i = 0; i < 60; i++) { /* one goes right, one left, through each other */
        put(100 + 1.5 * i, 20, 140 + 1.5 * i, 200);
        put(220 - 1.2 * i, 20, 170 - 1.2 * i, 200);
        run(t);
        assert_sound(2);
        assert_int_equal(track_of(0), 0);
        assert_int_equal(track_of(1), 1);
    }
    tracker_free(t);
}

static void gaps_are_filled(void **state) {
    (void)state;
    seed = 3;
    tracker *t = begin(100);
    for (int i = 0; i < 60; i++) {
        bool hidden = (i >= 20 && i < 25) || (i >= 40 && i < 46); /* 5 frames, then 6 */
        if (!hidden)
            put(50 + 2 * i, 30, 60 + 2 * i, 180);
        run(t);
        assert_int_equal(tracks.n, i == 45 ? 0 : 1);
        if (i < 45)
            assert_int_equal(found[0].id, 0);
        if (i < 45)
            assert_int_equal(found[0].segment, hidden ? -1 : 0);
        if (i > 45)
            assert_int_equal(track_of(0), 1); /* a new one: ids are not used again */
    }
    tracker_free(t);
}

static void new_lines_are_added(void **state) {
    (void)state;
    seed = 4;
    tracker *t = begin(100);
    for (int i = 0; i < 40; i++) {
        for (int k = 0; k <= i / 10; k++)
            put(40 + 50 * k + 2 * i, 30, 30 + 50 * k + 2 * i, 150);
        run(t);
        assert_sound((uint32_t)i / 10 + 1);
        assert_int_equal(tracks.total, i / 10 + 1);
    }
    tracker_free(t);
}

/* A line that enters the picture grows, and leaving it shrinks, by more than the box. */
static void lines_enter_and_leave(void **state) {
    (void)state;
    seed = 5;
    tracker *t = begin(100);
    for (int i = 0; i < 70; i++) { /* 30 degrees from the motion, 8 px a frame, seen in 0..319 */
        double x1 = 330 - 8 * i, x2 = x1 + 160, y = 60;
        double w0 = fmax(0, -x1 / (x2 - x1)), w1 = fmin(1, (319 - x1) / (x2 - x1));
        if ((w1 - w0) * 160 < 15)
            continue;
        put(x1 + 160 * w0, y + 92 * w0, x1 + 160 * w1, y + 92 * w1);
        run(t);
        assert_sound(1);
        assert_int_equal(track_of(0), 0);
    }
    tracker_free(t);
}

/* A segment that breaks in two: the track stays with one part and is whole again afterwards. */
static void broken_segments_rejoin(void **state) {
    (void)state;
    seed = 6;
    tracker *t = begin(100);
    for (int i = 0; i < 30; i++) {
        double x = 80 + 2 * i;
        bool broken = i >= 10 && i < 14;
        put(x, 20, x + (broken ? 15 : 30), broken ? 110 : 200);
        if (broken)
            put(x + 16.3, 118, x + 30, 200);
        run(t);
        assert_int_equal(track_of(0), 0);
        if (broken)
            assert_int_equal(track_of(1), 1);
    }
    tracker_free(t);
}

static void polarity_tells_edges_apart(void **state) {
    (void)state;
    seed = 7;
    tracker *t = begin(100);
    for (int i = 0; i < 30; i++) { /* a stripe of 2 px: its sides are of opposite polarity */
        put(60 + 2 * i, 30, 70 + 2 * i, 180);
        put(72 + 2 * i, 180, 62 + 2 * i, 30);
        run(t);
        assert_int_equal(track_of(0), 0);
        assert_int_equal(track_of(1), 1);
    }
    tracker_free(t);
}

static void nothing_is_found_in_noise(void **state) {
    (void)state;
    seed = 8;
    tracker *t = begin(1000);
    int longest[4000] = {0};
    for (int i = 0; i < 50; i++) {
        for (int k = 0; k < 30; k++) {
            double x = 320 * uniform(), y = 240 * uniform(), a = 2 * M_PI * uniform();
            put(x, y, x + 20 * cos(a), y + 20 * sin(a));
        }
        run(t);
        assert_sound(30);
        for (uint32_t k = 0; k < tracks.n; k++)
            longest[found[k].id] += found[k].segment >= 0;
    }
    for (uint32_t k = 0; k < tracks.total; k++)
        assert_in_range(longest[k], 1, 5);
    tracker_free(t);
}

/* ---- bounds -------------------------------------------------------------------------------------
 */

/* Ten thousand segments that all move: all are followed, and what exceeds the room is counted. */
static void ten_thousand(int32_t room, uint32_t lost) {
    tracker *t = begin(room);
    seed = 9;
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 10000; k++) {
            double x = 40 * (k % 100) + 2 * i, y = 40 * (k / 100);
            put(x, y, x + 12, y + 28);
        }
        run(t);
        assert_int_equal(tracks.n, 10000 - lost);
        assert_int_equal(tracks.lost, lost);
        assert_sound(10000 - lost);
    }
    assert_int_equal(tracks.total, 10000 - lost);
    tracker_free(t);
}

static void many_segments_are_bounded(void **state) {
    (void)state;
    ten_thousand(10000, 0);
    ten_thousand(3000, 7000);
}

/* The layer is smaller than the tracker. */
static void a_small_layer_truncates(void **state) {
    (void)state;
    seed = 10;
    tracker *t = begin(100);
    tracks.max = 3;
    scene(0);
    run(t);
    assert_int_equal(tracks.n, 3);
    assert_int_equal(tracks.lost, 9);
    assert_int_equal(tracks.total, 12);
    tracker_free(t);
}

static void points_and_nan_start_nothing_that_lasts(void **state) {
    (void)state;
    tracker *t = begin(10);
    for (int i = 0; i < 20; i++) {
        item[0] = (arris_segment){.x1 = (double)NAN, .y1 = 1, .x2 = 30, .y2 = 4};
        item[1] = (arris_segment){.x1 = 20, .y1 = 20, .x2 = 20, .y2 = 20};
        item[2] = (arris_segment){.x1 = 50, .y1 = 20, .x2 = 50, .y2 = 90};
        segments.n = 3;
        run(t);
        assert_true(tracks.n <= 10);
        assert_true(track_of(2) >= 0);
    }
    for (uint32_t k = 0; k < tracks.n; k++)
        assert_true(found[k].segment == 2 || found[k].id > 2);
    tracker_free(t);
}

/* ---- what is foreseen of the lines --------------------------------------------------------------
 */

static const arris_camera camera = {320, 240, 380, 378, 0.5, 158.5, 121, 0, 0, 0, 0, 0};
static const double DEPTH = 800;

static void run_at(tracker *t, double shift) {
    arris_pose pose = {.valid = true, .R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    pose.C[0] = -shift * DEPTH / camera.fx; /* what is at that depth has moved by so many px */
    tracker_run(t, &segments, &(viewpoint){&camera, &pose, 0.3, 2e-4}, &tracks);
    segments.n = 0;
}

static void foresee_at(tracker *t, int32_t line, double x1, double y1, double x2, double y2) {
    arris_segment where = {.x1 = x1, .y1 = y1, .x2 = x2, .y2 = y2};
    forecast f = {.where = where, .cov = {0.1, 0.05, 0.1}, .line = true};
    tracker_foresee(t, line, &f, DEPTH);
}

/* A grid of pitch 9 px that jumps by any amount: the picture alone can't tell which line is which.
 */
static void foreseen_lines_are_told_apart_in_a_grid(void **state) {
    (void)state;
    tracker *t = begin(100);
    seed = 9;
    for (int i = 0; i < 50; i++) {
        double shift = i ? 60 * uniform() - 30 : 0;
        for (int k = 0; k < 20; k++) {
            double x = 70 + 9 * k + shift;
            foresee_at(t, k, x, 40, x + 3, 200);
            put(x, 40, x + 3, 200);
        }
        foresee_at(t, 99, 70, 40, 73, 200); /* there is no such track */
        run_at(t, shift);
        assert_sound(20);
        for (int k = 0; k < 20; k++)
            assert_int_equal(track_of(k), k);
    }
    assert_int_equal(tracks.total, 20);
    tracker_free(t);
}

/* What is foreseen holds for one frame: then the track's own motion is asked again. */
static void foresight_ends_with_the_frame(void **state) {
    (void)state;
    tracker *t = begin(10);
    for (int i = 0; i < 12; i++) {
        put(50 + 2 * i, 40, 52 + 2 * i, 200);
        if (i == 5)
            foresee_at(t, 0, item[0].x1, item[0].y1, item[0].x2, item[0].y2);
        run(t);
        assert_int_equal(track_of(0), 0);
    }
    tracker_free(t);
}

/* A track that is long gone comes back under its id where its line is foreseen, and only there; and
 * ids still ascend. */
static void a_line_is_taken_up_again(void **state) {
    (void)state;
    tracker *t = begin(10);
    for (int i = 0; i < 60; i++) {
        bool hidden = i >= 10 && i < 40;
        put(200, 40, 210, 200);
        if (!hidden)
            put(100, 40, 110, 200);
        if (i == 20)
            put(103, 40, 113, 200); /* 3 px off: another line */
        if (i > 5) {
            foresee_at(t, 0, 200, 40, 210, 200);
            foresee_at(t, 1, 99.375, 30, 110.625, 210);
        }
        run_at(t, 0);
        assert_int_equal(track_of(0), 0);
        if (!hidden)
            assert_int_equal(track_of(1), 1);
        if (i == 20)
            assert_int_equal(track_of(1), 2);
        for (uint32_t k = 1; k < tracks.n; k++)
            assert_true(found[k].id > found[k - 1].id);
    }
    assert_int_equal(tracks.total, 3);
    tracker_free(t);
}

/* Two tracks whose lines were found to be one: the younger is looked for where that is. */
static void a_merged_track_follows_its_line(void **state) {
    (void)state;
    tracker *t = begin(10);
    put(100, 40, 110, 200);
    run_at(t, 0);
    for (int i = 0; i < 10; i++)
        run_at(t, 0); /* gone */
    put(100, 40, 110, 200);
    run_at(t, 0);
    tracker_merge(t, 1, 0);
    for (int i = 0; i < 20; i++) {
        double shift = 180 * uniform() - 90; /* so far that only its line tells where it is */
        put(100 + shift, 40, 110 + shift, 200);
        put(103 + shift, 40, 113 + shift, 200);
        foresee_at(t, 0, 100 + shift, 40, 110 + shift, 200);
        run_at(t, shift);
        assert_int_equal(track_of(0), 1);
    }
    tracker_free(t);
}

/* Only where a 3D line is known, an edge may turn from dark-bright to bright-dark. */
static void a_known_line_may_flip(void **state) {
    (void)state;
    for (int known = 0; known < 2; known++) {
        tracker *t = begin(10);
        for (int i = 0; i < 20; i++) {
            bool flipped = i >= 10;
            if (flipped)
                put(110, 200, 100, 40);
            else
                put(100, 40, 110, 200);
            item[0].lo = flipped ? 80 : 20; /* what is on the right is the object */
            item[0].hi = 80;
            if (flipped)
                item[0].hi = 140;
            if (known)
                foresee_at(t, 0, 100, 40, 110, 200);
            run_at(t, 0);
            assert_int_equal(track_of(0), known || !flipped ? 0 : 1);
        }
        tracker_free(t);
    }
}

static void a_line_is_foreseen_where_it_projects(void **state) {
    (void)state;
    arris_line l = {.state = ARRIS_MEASURED, .p = {-20, -100, 900}, .q = {30, 120, 820}};
    arris_pose pose = {.valid = true, .C = {40, 5, 10}};
    forecast f;
    double x, y, z, depth;
    arris_camera lens = camera;
    lens.k1 = -0.2;
    arris_rotation(0.05, -0.1, 0.2, pose.R);
    viewpoint v = {&lens, &pose, 0, 0};
    l.cov[0] = l.cov[6] = l.cov[11] = 0.09; /* p is known to 0.3 mm, q exactly */
    assert_true(foresee(&l, &v, &f, &depth));
    assert_true(arris_project(&lens, &pose, l.q, &x, &y) > 0);
    arris_distort(&lens, x, y, &x, &y);
    assert_true(fabs(f.where.x2 - x) < 1e-9);
    assert_true(fabs(f.where.y2 - y) < 1e-9);
    z = arris_project(&lens, &pose, l.p, &x, &y);
    double detected = f.cov[2]; /* nothing but what a segment may be off */
    assert_true(fabs(f.cov[0] - detected - pow(380 * 0.3 / z, 2)) < 1e-9);
    assert_true(fabs(f.cov[1] - detected) < 1e-9);
    l.cov[3] = l.cov[9] = l.cov[14] = 0.09; /* q is off as p is */
    l.cov[15] = l.cov[18] = l.cov[20] = 0.09;
    assert_true(foresee(&l, &v, &f, &depth));
    assert_true(fabs((f.cov[1] - detected) / sqrt((f.cov[0] - detected) * (f.cov[2] - detected)) -
                     1) < 1e-9);
    double shared = f.cov[1];
    v.position = 1;
    assert_true(foresee(&l, &v, &f, &depth));
    assert_true(fabs(f.cov[1] - shared - pow(380 / depth, 2)) < 1e-9);
    l.p[2] = l.q[2] = -100; /* behind the camera */
    assert_false(foresee(&l, &v, &f, &depth));
    l.p[2] = l.q[2] = 900;
    l.p[0] = l.q[0] = 4000; /* beside its picture */
    assert_false(foresee(&l, &v, &f, &depth));
}

/* A rail that passes under the camera: what is in front of it is foreseen, on its line. */
static void what_is_in_front_is_foreseen(void **state) {
    (void)state;
    arris_line l = {.state = ARRIS_MEASURED, .p = {-60, 100, -400}, .q = {-60, 100, 2000}};
    arris_pose origin = {.valid = true, .R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    viewpoint here = {&camera, &origin, 0.3, 2e-4};
    forecast f;
    double depth, x, y, P[3] = {-60, 100, 1000};
    assert_true(foresee(&l, &here, &f, &depth));
    arris_project(&camera, &origin, P, &x, &y);
    double dx = f.where.x2 - f.where.x1, dy = f.where.y2 - f.where.y1;
    assert_true(fabs((y - f.where.y1) * dx - (x - f.where.x1) * dy) / hypot(dx, dy) < 1e-9);
    assert_true(hypot(dx, dy) > 500); /* from below the picture to the horizon */
}

/* ---- the index ----------------------------------------------------------------------------------
 */

static double distance(const arris_segment *s, double x, double y) {
    double dx = s->x2 - s->x1, dy = s->y2 - s->y1;
    double t = ((x - s->x1) * dx + (y - s->y1) * dy) / (dx * dx + dy * dy);
    t = fmin(fmax(t, 0), 1);
    return hypot(s->x1 + t * dx - x, s->y1 + t * dy - y);
}

static bool nearer(const arris_segment *a, const arris_segment *b, double reach) {
    for (int i = 0; i <= 200; i++)
        if (distance(b, a->x1 + (a->x2 - a->x1) * i / 200, a->y1 + (a->y2 - a->y1) * i / 200) <
            reach)
            return true;
    return false;
}

static arris_segment anywhere(double length) {
    double x = 2500 * uniform() - 250, y = 2500 * uniform() - 250, a = 2 * M_PI * uniform();
    double l = length * uniform();
    return (arris_segment){.x1 = x, .y1 = y, .x2 = x + l * cos(a), .y2 = y + l * sin(a)};
}

/* All that is near is found, once; also when the room for long segments runs out. */
static void what_is_near_is_found(void **state) {
    (void)state;
    enum { N = 600 };
    seed = 11;
    segment_index *x = index_new(N);
    assert_non_null(x);
    for (int turn = 0; turn < 40; turn++) {
        double length = turn % 2 ? 60 : 3000, reach = 60 * uniform();
        for (int i = 0; i < N; i++)
            item[i] = anywhere(length);
        item[3].x1 = (double)NAN;
        item[4].x2 = 1e300;
        index_fill(x, item, N);
        arris_segment where = anywhere(turn % 3 ? 100 : 1000);
        uint32_t n;
        const uint32_t *near = index_near(x, &where, reach, &n);
        static int found_times[N];
        memset(found_times, 0, sizeof found_times);
        for (uint32_t i = 0; i < n; i++)
            found_times[near[i]]++;
        for (int i = 0; i < N; i++) {
            assert_in_range(found_times[i], 0, 1);
            if (i != 3 && i != 4 && nearer(&where, &item[i], reach))
                assert_int_equal(found_times[i], 1);
        }
    }
    index_free(x);
}

/* ---- sweeps -------------------------------------------------------------------------------------
 */

static const depths any_depth = {.mean = 0.00125, .sigma = 0.0006, .least = 1e-4, .most = 1e-2};

/* The picture of a line in space, off by 0.1 px across at its ends. */
static arris_segment picture_of(const double p[3], const double q[3], const arris_pose *pose) {
    arris_segment s = {.cov = {0.005, 0, 2e-6}};
    assert_true(arris_project(&camera, pose, p, &s.x1, &s.y1) > 0);
    assert_true(arris_project(&camera, pose, q, &s.x2, &s.y2) > 0);
    double u[2], a = 0.1 * normal(), b = 0.1 * normal();
    segment_direction(&s, u);
    s.x1 -= a * u[1], s.y1 += a * u[0], s.x2 -= b * u[1], s.y2 += b * u[0];
    return s;
}

/* Along a path of 4 mm steps in the direction d, turning a little, every sighting is within the
 * forecast, which narrows. Returns whether the depth is known in the end, and then is it. */
static bool sweep_along(const double p[3], const double q[3], const double d[3]) {
    sweep s = {.length = 0};
    double w, truth = 0;
    viewpoint v = {.camera = &camera, .position = 0, .rotation = 0};
    arris_pose pose = {.valid = true};
    for (int i = 0; i < 40; i++) {
        forecast f;
        for (int k = 0; k < 3; k++)
            pose.C[k] = 4 * d[k] * i;
        arris_rotation(1e-3 * i, -5e-4 * i, 2e-3 * i, pose.R);
        v.pose = &pose;
        arris_segment seen = picture_of(p, q, &pose);
        if (i == 0)
            sweep_begin(&s, &seen, &v, &any_depth);
        assert_true(sweep_forecast(&s, &v, &f));
        assert_true(forecast_misfit(&f, &seen) < 1);
        sweep_sight(&s, &seen, &v, &any_depth);
        truth = (arris_dot(pose.R + 6, p) + arris_dot(pose.R + 6, q)) / 2 -
                arris_dot(pose.R + 6, pose.C);
    }
    bool known = sweep_depth(&s, &v, &w);
    if (known)
        assert_true(fabs(1 / w - truth) < 0.1 * truth);
    return known;
}

static void a_sweep_narrows(void **state) {
    (void)state;
    static const double aside[3] = {1, 0, 0}, ahead[3] = {0.1, -0.05, 0.99};
    for (seed = 1; seed < 30; seed++) {
        double x = 200 * uniform() - 100, z = 500 + 900 * uniform();
        double p[3] = {x, -90, z}, q[3] = {x + 20, 80, z + 100};
        assert_true(sweep_along(p, q, aside));
        double r[3] = {60, -80, z}, t[3] = {70, 90, z};
        assert_true(sweep_along(r, t, ahead));
        double a[3] = {-60, 50, z}, b[3] = {60, 50, z}; /* along the motion */
        assert_false(sweep_along(a, b, aside));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pairs_do_not_swap),
        cmocka_unit_test(motion_reverses),
        cmocka_unit_test(motion_stops_and_goes_on),
        cmocka_unit_test(frames_are_doubled_and_dropped),
        cmocka_unit_test(fast_motion_is_found),
        cmocka_unit_test(crossing_lines_keep_their_tracks),
        cmocka_unit_test(gaps_are_filled),
        cmocka_unit_test(new_lines_are_added),
        cmocka_unit_test(lines_enter_and_leave),
        cmocka_unit_test(broken_segments_rejoin),
        cmocka_unit_test(polarity_tells_edges_apart),
        cmocka_unit_test(nothing_is_found_in_noise),
        cmocka_unit_test(many_segments_are_bounded),
        cmocka_unit_test(a_small_layer_truncates),
        cmocka_unit_test(points_and_nan_start_nothing_that_lasts),
        cmocka_unit_test(foreseen_lines_are_told_apart_in_a_grid),
        cmocka_unit_test(foresight_ends_with_the_frame),
        cmocka_unit_test(a_line_is_taken_up_again),
        cmocka_unit_test(a_merged_track_follows_its_line),
        cmocka_unit_test(a_known_line_may_flip),
        cmocka_unit_test(a_line_is_foreseen_where_it_projects),
        cmocka_unit_test(what_is_in_front_is_foreseen),
        cmocka_unit_test(what_is_near_is_found),
        cmocka_unit_test(a_sweep_narrows),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
