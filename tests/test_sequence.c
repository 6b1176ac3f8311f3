/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_sequence.c: tracking and reconstruction of sequences in which something is the matter: with
 * the motion, with the poses, with the frames, with the light, with the object. The lines are known
 * in 3D and the stages run as they do in a pipeline, feedback included.
 */
#include "world.h"

/* ---- motion ---------------------------------------------------------------------------------- */

static arris_pose along_x(double i) {
    return pose_at((i - 50) * 4.1, 0, 0, 0, 0, 0);
}

static void shoot_straight(int i, arris_pose *pose, arris_segments *out) {
    *pose = along_x(i);
    see_all(pose, out);
}

static void a_plain_sequence(void **state) {
    (void)state;
    for (uint64_t s = 1; s < 6; s++) {
        begin(s);
        add_plates();
        play(shoot_straight);
        assert_one_track_each(0);
        assert_int_equal(assert_true_lines(), 20);
    }
}

/* 0 to 5 degrees from the motion. Within half a degree, a line is never measured. */
static void lines_along_the_motion(void **state) {
    (void)state;
    static const double degrees[] = {0, 0.1, -0.3, 0.5, 1, -2, 3, 5};
    for (uint64_t s = 1; s < 6; s++) {
        begin(s);
        for (int k = 0; k < 8; k++) {
            double y = -90 + 25 * k, slope = tan(degrees[k] * M_PI / 180);
            add(-80, y - 80 * slope, 800, 80, y + 80 * slope, 800);
        }
        add(-90, -90, 700, -80, 90, 700);
        play(shoot_straight);
        assert_one_track_each(0);
        assert_true_lines();
        for (int k = 0; k < 4; k++)
            assert_false(is_measured(k));
        assert_true(is_measured(7));
    }
}

/* The camera goes ahead and turns: the epipole is in the picture and wanders, lines cross it. */
static void shoot_ahead(int i, arris_pose *pose, arris_segments *out) {
    *pose = pose_at(0, 0, 4 * i, 1e-4 * i, -5e-4 * i, 2e-3 * i);
    see_all(pose, out);
}

static void forward_motion(void **state) {
    (void)state;
    for (uint64_t s = 1; s < 6; s++) {
        begin(s);
        add_plates();
        add(-60, 20, 900, 70, -30, 950); /* through the epipole */
        add(5, -80, 1000, 0, 90, 1000);
        add(-60, 100, -200, -60, 100, 2000); /* a rail along the motion */
        play(shoot_ahead);
        assert_one_track_each(2);
        assert_true(assert_true_lines() >= 12);
        assert_false(is_measured(22));
    }
}

/* The camera turns about its centre: lines are followed, none is measured. */
static void shoot_turning(int i, arris_pose *pose, arris_segments *out) {
    *pose = pose_at(0, 0, 0, 0, 0.1 * sin(i * 0.2), 0.02 * i);
    see_all(pose, out);
}

static void shoot_standing(int i, arris_pose *pose, arris_segments *out) {
    (void)i;
    *pose = along_x(50);
    see_all(pose, out);
}

static void zero_baseline(void **state) {
    (void)state;
    begin(1);
    add_plates();
    play(shoot_turning);
    assert_int_equal(swaps, 0);
    for (int i = 0; i < n_edges; i++)
        assert_true(changes[i] <= 1); /* it leaves the picture */
    assert_int_equal(assert_true_lines(), 0);
    play(shoot_standing);
    assert_one_track_each(0);
    assert_int_equal(assert_true_lines(), 0);
}

/* Round the middle, and back to where it began: every line is found again as itself. */
static void shoot_round(int i, arris_pose *pose, arris_segments *out) {
    double t = 2 * M_PI * i / 200;
    *pose = pose_at(700 * sin(t), 300 * (1 - cos(t)), 0, 0, 0, 0.2 * sin(t));
    see_all(pose, out);
}

static void closed_loops(void **state) {
    (void)state;
    for (uint64_t s = 1; s < 6; s++) {
        begin(s);
        now.frames = 390;
        add_plates();
        play(shoot_round);
        int lost = 0; /* left before the motion told how far away they are */
        for (int i = 0; i < n_edges; i++)
            lost += changes[i] > 0;
        assert_int_equal(swaps, 0);
        assert_true(lost <= 2);
        assert_int_equal(assert_true_lines(), 20);
    }
}

/* ---- lines that are alike -------------------------------------------------------------------- */

static void parallel_pairs(void **state) {
    (void)state;
    for (uint64_t s = 1; s < 6; s++) {
        begin(s);
        for (int k = 0; k < 6; k++) { /* 3 to 8 px apart, alternately at another depth */
            double z = k % 2 ? 800 : 700, x = -150 + 60 * k, apart = (3 + k) * z / 380;
            add(x, -80, z, x + 5 * k, 80, z);
            add(x + apart, -80, z + (k % 3 ? 0 : 5), x + 5 * k + apart, 80, z);
        }
        play(shoot_straight);
        assert_one_track_each(0);
        assert_int_equal(assert_true_lines(), 12);
    }
}

/* A grid whose pitch is the step: every picture of it is like the one before. Only its ends and two
 * lines elsewhere tell. */
static void add_grid(void) {
    for (int k = 0; k < 21; k++)
        add(-41 + 4.1 * k, -60, 800, -41 + 4.1 * k, 60, 800);
    add(-120, -80, 700, -100, 80, 700);
    add(100, -80, 900, 120, 80, 900);
}

static void a_grid_of_the_steps_pitch(void **state) {
    (void)state;
    for (uint64_t s = 1; s < 6; s++) {
        begin(s);
        add_grid();
        play(shoot_straight);
        assert_one_track_each(0);
        assert_int_equal(assert_true_lines(), 23);
    }
}

/* ---- frames ---------------------------------------------------------------------------------- */

static double place[SEQUENCE_FRAMES]; /* of frame i, in steps */
static bool hold_picture;             /* the picture is that of the frame before, the pose is not */

static void shoot_places(int i, arris_pose *pose, arris_segments *out) {
    arris_pose seen = along_x(hold_picture && i % 9 == 8 ? place[i - 1] : place[i]);
    see_all(&seen, out);
    *pose = along_x(place[i]);
}

static void follow_places(int expected) {
    play(shoot_places);

    assert_one_track_each(hold_picture ? 12 : 0);
    assert_true(assert_true_lines() >= expected);
}

static void frames_dropped_doubled_reversed_stopped(void **state) {
    (void)state;
    for (uint64_t s = 1; s < 4; s++)
        for (int grid = 0; grid < 2; grid++) {
            begin(s);
            if (grid)
                add_grid();
            else
                add_plates();
            double at = 0;
            for (int i = 0; i < 100; i++) {
                place[i] = at;
                at += i < 10 ? 1 : i % 7 == 0 ? 0 : i % 11 == 0 ? 3 : i > 40 && i < 60 ? 0 : 1;
            }
            follow_places(n_edges - 1);
            for (int i = 0; i < 100; i++)
                place[i] = i < 60 ? i : 118 - i; /* back again */
            follow_places(n_edges - 1);
        }
}

/* A grabber that hands out a picture twice: the pose and the picture don't go together. */
static void pictures_come_twice(void **state) {
    (void)state;
    for (uint64_t s = 1; s < 4; s++) {
        begin(s);
        add_plates();
        for (int i = 0; i < 100; i++)
            place[i] = i;
        hold_picture = true;
        follow_places(19);
        hold_picture = false;
    }
}

static void shoot_between_blanks(int i, arris_pose *pose, arris_segments *out) {
    *pose = along_x(i);
    if (i % 30 >= 25) /* blank */
        return;
    if (i % 30 >= 15 && i > 30) /* nothing but noise, for longer than a track lives */
        see_noise(60, out);
    else
        see_all(pose, out);
}

static void blank_and_noisy_frames_between(void **state) {
    (void)state;
    for (uint64_t s = 1; s < 4; s++) {
        begin(s);
        add_plates();
        play(shoot_between_blanks);
        assert_one_track_each(4);
        assert_int_equal(assert_true_lines(), 20);
    }
}

/* ---- poses ----------------------------------------------------------------------------------- */

static enum { LATE, NEVER, EVERY_THIRD_NONE, EVERY_TENTH_NAN, LAGGING } poses;

static void shoot_with_bad_poses(int i, arris_pose *pose, arris_segments *out) {
    arris_pose there = along_x(i);
    see_all(&there, out);
    *pose = there;
    if (poses == NEVER || (poses == LATE && i < 30) || (poses == EVERY_THIRD_NONE && i % 3 == 2))
        *pose = (arris_pose){.C = {9e9, 9e9, 9e9}};
    if (poses == EVERY_TENTH_NAN && i % 10 == 9)
        pose->C[i / 10 % 3] = pose->R[i / 10 % 9] = (double)NAN;
    if (poses == LAGGING)
        *pose = along_x(i - 1);
}

static void poses_that_are_missing_or_bad(void **state) {
    (void)state;
    for (poses = LATE; poses <= LAGGING; poses++) {
        begin(1);
        add_plates();
        play(shoot_with_bad_poses);
        assert_one_track_each(1);
        if (poses == LAGGING) /* then all is measured, one step beside */
            for (int i = 0; i < n_edges; i++)
                world[i].p[0] -= 4.1, world[i].q[0] -= 4.1;
        assert_int_equal(assert_true_lines(), poses == NEVER ? 0 : 20);
    }
}

/* Positions that are reported 0.3 mm off, the same way for some frames, as robots do. */
static void shoot_with_jitter(int i, arris_pose *pose, arris_segments *out) {
    static double off[3];
    arris_pose there = along_x(i);
    see_all(&there, out);
    *pose = there;
    for (int k = 0; k < 3; k++) {
        off[k] = 0.8 * off[k] + 0.18 * normal();
        pose->C[k] += off[k];
    }
}

static void a_robot_that_sticks_and_slips(void **state) {
    (void)state;
    for (uint64_t s = 1; s < 6; s++) {
        begin(s);
        add_plates();
        play(shoot_with_jitter);
        assert_one_track_each(0);
        assert_true_lines();
    }
}

/* ---- the object and the light ---------------------------------------------------------------- */

/* The ground behind a plate goes from dark to bright and back as the camera passes. */
static void shoot_before_stripes(int i, arris_pose *pose, arris_segments *out) {
    *pose = along_x(i);
    for (int k = 0; k < n_edges; k++) {
        world[k].lo = 100 + 60 * (float)sin(0.12 * i + k);
        world[k].hi = 100;
        see(k, pose, out);
    }
}

static void polarity_flips(void **state) {
    (void)state;
    for (uint64_t s = 1; s < 6; s++) {
        begin(s);
        add_plates();
        play(shoot_before_stripes);
        assert_int_equal(swaps, 0);
        assert_int_equal(assert_true_lines(), 20);
    }
}

/* The edges of shadows that swing with their lamp by a few mm, beside edges that stay. (Had they
 * moved evenly, they would be lines at another depth to anyone.) */
static void shoot_shadows(int i, arris_pose *pose, arris_segments *out) {
    *pose = along_x(i);
    see_all(pose, out);
    for (int k = 0; k < 4; k++) {
        double x = -100 + 65 * k + (2 + k) * sin(0.4 * i + k);
        edge shadow = {{x, -100, 1000}, {x + 20, 100, 1000}, 100, 70};
        see_part(&shadow, FOREIGN, 0, 1, pose, out);
    }
}

static void shadows_that_move(void **state) {
    (void)state;
    for (uint64_t s = 1; s < 6; s++) {
        begin(s);
        add_plates();
        play(shoot_shadows);
        assert_int_equal(swaps, 0);
        assert_true(assert_true_lines() >= 14); /* no shadow is among them */
    }
}

/* Upright cylinders; their limbs are the tangents from the camera. */
static const double cylinder[3][3] = {{-100, 800, 40}, {0, 900, 60}, {110, 750, 25}};

static void shoot_limbs(int i, arris_pose *pose, arris_segments *out) {
    *pose = along_x(i);
    see_all(pose, out);
    for (int k = 0; k < 3; k++)
        for (int side = -1; side <= 1; side += 2) {
            double x = cylinder[k][0] - pose->C[0], z = cylinder[k][1], r = cylinder[k][2];
            double d = hypot(x, z), t = atan2(x, z) + side * asin(r / d),
                   reach = sqrt(d * d - r * r);
            double X = pose->C[0] + reach * sin(t), Z = reach * cos(t);
            edge limb = {{X, -70, Z}, {X, 70, Z}, side < 0 ? 60 : 140, side < 0 ? 140 : 60};
            see_part(&limb, FOREIGN, 0, 1, pose, out);
        }
}

/* Sigmas by which the line is beside the nearest cylinder's surface. */
static double beside_surface(const arris_line *l) {
    double least = (double)INFINITY;
    for (int k = 0; k < 3; k++) {
        double mm, r = cylinder[k][2], dx = l->p[0] - cylinder[k][0], dz = l->p[2] - cylinder[k][1];
        double d = hypot(dx, dz), x = cylinder[k][0] + dx * r / d, z = cylinder[k][1] + dz * r / d;
        edge on = {{x, -70, z}, {x, 70, z}, 0, 0};
        least = fmin(least, fmax(sigmas_off(&on, l, 0, &mm), sigmas_off(&on, l, 1, &mm)));
    }
    return least;
}

/* A limb wanders over the surface: what is measured of it, if anything, must be a line that is on
 * it. */
static void limbs_of_cylinders(void **state) {
    (void)state;
    for (uint64_t s = 1; s < 6; s++) {
        begin(s);
        add(-160, -80, 700, -150, 80, 720);
        add(170, -80, 850, 160, 80, 800);
        play(shoot_limbs);
        assert_int_equal(swaps, 0);
        for (uint32_t i = 0; i < n_results; i++) {
            double mm;
            if (result[i].state != ARRIS_MEASURED)
                continue;
            edge_of(&result[i], &mm);
            if (mm > 1 && beside_surface(&result[i]) > 5)
                fail_msg("line %d: %g mm from an edge, %g sigmas from a surface", result[i].id, mm,
                         beside_surface(&result[i]));
        }
        assert_true(is_measured(0));
        assert_true(is_measured(1));
    }
}

/* An edge in two or three pieces, broken elsewhere in every frame, as at T-junctions. */
static void shoot_broken(int i, arris_pose *pose, arris_segments *out) {
    *pose = along_x(i);
    for (int k = 0; k < n_edges; k++) {
        double a = 0.2 + 0.3 * uniform(), b = uniform() < 0.5 ? 1 : 0.6 + 0.2 * uniform();
        if (uniform() < 0.3) {
            see(k, pose, out);
            continue;
        }
        see_part(&world[k], k, 0, a, pose, out);
        see_part(&world[k], k, a + 0.03, b, pose, out);
        see_part(&world[k], k, b + 0.03, 1, pose, out);
    }
}

static void broken_chains(void **state) {
    (void)state;
    for (uint64_t s = 1; s < 6; s++) {
        begin(s);
        for (int k = 0; k < 6; k++)
            add(-150 + 50 * k, -90, 700 + 50 * k, -140 + 55 * k, 90, 750 + 30 * k);
        play(shoot_broken);
        assert_int_equal(swaps, 0);
        assert_int_equal(assert_true_lines(), 6);
    }
}

/* Something passes before the lines and hides each for 12 to 30 frames, longer than max-gap. */
static void shoot_behind(int i, arris_pose *pose, arris_segments *out) {
    *pose = along_x(i);
    for (int k = 0; k < n_edges; k++) {
        int from = 25 + 2 * k, to = from + 12 + k;
        if (i < from || i >= to)
            see(k, pose, out);
    }
}

static void lines_come_back_from_behind(void **state) {
    (void)state;
    for (uint64_t s = 1; s < 6; s++) {
        begin(s);
        add_plates();
        play(shoot_behind);
        assert_one_track_each(0);
        assert_int_equal(assert_true_lines(), 20);
    }
}

/* A long fence is passed: lines enter on one side and leave on the other. */
static void shoot_fence(int i, arris_pose *pose, arris_segments *out) {
    *pose = pose_at(8.0 * i, 0, 0, 0, 0, 0);
    see_all(pose, out);
}

static void lines_enter_and_leave(void **state) {
    (void)state;
    for (uint64_t s = 1; s < 4; s++) {
        begin(s);
        now.frames = 200;
        for (int k = 0; k < 60; k++)
            add(-200 + 35 * k, -90 + k % 7 * 5, 700 + 40 * (k % 5), -180 + 35 * k + k % 11, 80,
                720 + 40 * (k % 4));
        play(shoot_fence);
        assert_one_track_each(0);
        assert_true(assert_true_lines() >= 45);
    }
}

/* ---- very many ------------------------------------------------------------------------------- */

static void shoot_many(int i, arris_pose *pose, arris_segments *out) {
    *pose = pose_at(4.1 * i, 0, 0, 0, 0, 0);
    for (int k = 0; k < 10000; k++) {
        truth[out->n] = k;
        shown[k]++;
        double z = 700 + 3 * (k % 97), x = 40 * (k % 100) - 380 * 4.1 * i / z, y = 40 * (k / 100);
        out->item[out->n++] = (arris_segment){.x1 = x,
                                              .y1 = y,
                                              .x2 = x + 12,
                                              .y2 = y + 28,
                                              .cov = {4e-4, 0, 1e-6},
                                              .lo = 40,
                                              .hi = 160};
    }
}

static void ten_thousand_lines(void **state) {
    (void)state;
    begin(1);
    now.frames = 6;
    now.camera.width = now.camera.height = 4096;
    now.shoot = shoot_many;
    play_with("track max-tracks=12000");
    assert_int_equal(swaps, 0);
    for (int k = 0; k < 10000; k++)
        assert_int_equal(held[k] + changes[k], 6);
    assert_int_equal(tracks_total, 10000);
}

/* ---- wrong use ------------------------------------------------------------------------------- */

static void depths_from_far_to_near(void **state) {
    (void)state;
    arris_error err;
    begin(1);
    now.shoot = shoot_straight;
    arris_pipeline *p = arris_parse("sequence ! track near=900 far=300 ! reconstruct ! seen", &err);
    assert_non_null(p);
    assert_int_equal(arris_check(p, &err), ARRIS_E_USAGE);
    assert_non_null(strstr(err.text, "near is 900 mm and far is 300 mm"));
    arris_free(p);
}

int main(int argc, char **argv) {
    if (!find_stages())
        return 1;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_plain_sequence),
        cmocka_unit_test(lines_along_the_motion),
        cmocka_unit_test(forward_motion),
        cmocka_unit_test(zero_baseline),
        cmocka_unit_test(closed_loops),
        cmocka_unit_test(parallel_pairs),
        cmocka_unit_test(a_grid_of_the_steps_pitch),
        cmocka_unit_test(frames_dropped_doubled_reversed_stopped),
        cmocka_unit_test(pictures_come_twice),
        cmocka_unit_test(blank_and_noisy_frames_between),
        cmocka_unit_test(poses_that_are_missing_or_bad),
        cmocka_unit_test(a_robot_that_sticks_and_slips),
        cmocka_unit_test(polarity_flips),
        cmocka_unit_test(shadows_that_move),
        cmocka_unit_test(limbs_of_cylinders),
        cmocka_unit_test(broken_chains),
        cmocka_unit_test(lines_come_back_from_behind),
        cmocka_unit_test(lines_enter_and_leave),
        cmocka_unit_test(ten_thousand_lines),
        cmocka_unit_test(depths_from_far_to_near),
    };
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
