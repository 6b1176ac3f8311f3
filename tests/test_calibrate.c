/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_calibrate.c: the mathematics of `arris calibrate` against cameras, boards and robots that
 * are known: derivatives, honest uncertainties over many calibrations, outliers, and what must be
 * refused.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "../plugins/calibrate/find.h"
#include "../plugins/calibrate/handeye.h"
#include "../plugins/calibrate/quality.h"
#include "board.h"

static shots s;
static cal_result result;
static fault f;

static int calibrate(void) {
    return cal_fit(&s.board, s.view, s.n, &s.options, &result, &f);
}

static double truth(int i) {
    double k[CAL_N];
    cal_from_camera(&lens, k);
    return k[i];
}

static double error_in_sigmas(int i) {
    return (result.k[i] - truth(i)) / sqrt(result.cov[i * CAL_N + i]);
}

/* ---- the model ------------------------------------------------------------------------------ */

static void derivatives_are_those_of_the_projection(void **state) {
    (void)state;
    const cal_board b = {9, 6, 30};
    const double X[3] = {100, 70, 3};
    double k[CAL_N], p[2], q[2], Jk[2][CAL_N], Jp[2][6], JX[2][3];
    cal_from_camera(&lens, k);
    for (int round = 0; round < 20; round++) {
        const cal_pose pose = any_pose(&b);
        assert_true(cal_project(k, &pose, X, p, Jk, Jp, JX));
        for (int i = 0; i < CAL_N + 6 + 3; i++) {
            double k2[CAL_N], d[6] = {0}, X2[3] = {X[0], X[1], X[2]}, h = 1e-6;
            memcpy(k2, k, sizeof k2);
            *(i < CAL_N ? &k2[i] : i < CAL_N + 6 ? &d[i - CAL_N] : &X2[i - CAL_N - 6]) += h;
            const cal_pose moved = cal_moved(&pose, d);
            assert_true(cal_project(k2, &moved, X2, q, NULL, NULL, NULL));
            for (int r = 0; r < 2; r++) {
                const double J = i < CAL_N       ? Jk[r][i]
                                 : i < CAL_N + 6 ? Jp[r][i - CAL_N]
                                                 : JX[r][i - CAL_N - 6];
                assert_true(fabs((q[r] - p[r]) / h - J) < 1e-3 * (1 + fabs(J)));
            }
        }
    }
}

static void model_is_that_of_the_geometry(void **state) {
    (void)state;
    const cal_pose still = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 0}};
    const double X[3] = {120, -80, 500};
    double k[CAL_N], p[2], u, v;
    cal_from_camera(&lens, k);
    assert_true(cal_project(k, &still, X, p, NULL, NULL, NULL));
    const double y = X[1] / X[2], x = X[0] / X[2];
    arris_distort(&lens, lens.fx * x + lens.skew * y + lens.cx, lens.fy * y + lens.cy, &u, &v);
    assert_true(hypot(u - p[0], v - p[1]) < 1e-9);
    assert_false(cal_project(k, &still, (double[]){0, 0, -1}, p, NULL, NULL, NULL));
}

static void rotation_vectors_come_back(void **state) {
    (void)state;
    for (int i = 0; i < 200; i++) {
        const double a = i % 5 ? 3.1 * uniform() : 1e-9 * uniform();
        double w[3] = {normal(), normal(), normal()}, R[9], back[3];
        arris_unit(w);
        for (int j = 0; j < 3; j++)
            w[j] *= a;
        cal_rotation(w, R);
        cal_rotation_vector(R, back);
        for (int j = 0; j < 3; j++)
            assert_true(fabs(w[j] - back[j]) < 1e-9);
    }
}

/* ---- the camera ----------------------------------------------------------------------------- */

static void exact_corners_give_the_exact_camera(void **state) {
    (void)state;
    shoot(&s, 12, 0);
    assert_int_equal(calibrate(), 0);
    for (int i = 0; i < CAL_N; i++)
        assert_true(fabs(result.k[i] - truth(i)) < 1e-4 * (i < CAL_K1 ? 1 : 0.1));
    assert_int_equal(result.views, 12);
}

/* The rms over many calibrations of (estimate - truth) / stated sigma is 1 when the sigma is
 * honest; and 95 in 100 of the stated intervals hold the truth. */
static void uncertainty_is_honest(void **state) {
    (void)state;
    enum { RUNS = 200 };
    double sum[CAL_N] = {0}, all = 0;
    int inside = 0;
    for (int run = 0; run < RUNS; run++) {
        shoot(&s, 15, 0.2);
        assert_int_equal(calibrate(), 0);
        for (int i = 0; i < CAL_N; i++) {
            const double e = error_in_sigmas(i);
            sum[i] += e * e / RUNS;
            inside += fabs(e) < cal_coverage(result.dof[i]);
        }
    }
    for (int i = 0; i < CAL_N; i++) {
        all += sum[i] / CAL_N;
        print_message("%s: normalised error %.2f\n", cal_names[i], sqrt(sum[i]));
        assert_in_range((int)(100 * sqrt(sum[i])), 80, 125);
    }
    print_message("all: %.3f; %.1f %% within the 95 %% intervals\n", sqrt(all),
                  100. * inside / (RUNS * CAL_N));
    assert_in_range(inside, (int)(0.92 * RUNS * CAL_N), (int)(0.98 * RUNS * CAL_N));
}

/* The corners of a view err together, as by a board that is not flat or by bad light: the
 * textbook's covariance would promise several times too much. */
static void uncertainty_is_honest_when_views_err(void **state) {
    (void)state;
    enum { RUNS = 60 };
    double sum = 0;
    for (int run = 0; run < RUNS; run++) {
        shoot(&s, 25, 0.05);
        for (int v = 0; v < s.n; v++) {
            const double a = 0.002 * normal(), b = 0.002 * normal(), c = 0.002 * normal();
            for (int i = 0; i < cal_corners(&s.board); i++) {
                double x = s.corner[v][2 * i] - 320, y = s.corner[v][2 * i + 1] - 240;
                s.corner[v][2 * i] += a * x * y / 100 + b * x * x / 100;
                s.corner[v][2 * i + 1] += c * y * y / 100;
            }
        }
        assert_int_equal(calibrate(), 0);
        for (int i = 0; i < CAL_N; i++)
            sum += pow(error_in_sigmas(i), 2) / (RUNS * CAL_N);
    }
    print_message("normalised error %.2f\n", sqrt(sum));
    assert_in_range((int)(100 * sqrt(sum)), 70, 140);
}

static void fixed_parameters_stay(void **state) {
    (void)state;
    shoot(&s, 12, 0.1);
    s.options.fixed[CAL_SKEW] = s.options.fixed[CAL_K3] = true;
    s.options.value[CAL_SKEW] = 0.3;
    s.options.value[CAL_K3] = 0.02;
    assert_int_equal(calibrate(), 0);
    assert_true(result.k[CAL_SKEW] == 0.3 && result.k[CAL_K3] == 0.02);
    assert_true(result.cov[CAL_SKEW * CAL_N + CAL_SKEW] == 0);
    assert_true(fabs(error_in_sigmas(CAL_FX)) < 4);
}

static void strange_corners_do_no_harm(void **state) {
    (void)state;
    shoot(&s, 15, 0.1);
    for (int v = 0; v < s.n; v++)
        for (int i = v; i < cal_corners(&s.board); i += 17)
            s.corner[v][2 * i] += 4;
    s.corner[3][10] = s.corner[3][11] = NAN;
    assert_int_equal(calibrate(), 0);
    assert_true(result.rejected >= 40);
    for (int i = 0; i < CAL_N; i++)
        assert_true(fabs(error_in_sigmas(i)) < 5);
}

static void bad_view_is_left_out_and_named(void **state) {
    (void)state;
    shoot(&s, 15, 0.1);
    for (int i = 0; i < cal_corners(&s.board); i++)
        s.corner[6][2 * i] += 6 * sin(i); /* as motion and a wrong order make it */
    assert_int_equal(calibrate(), 0);
    for (int v = 0; v < s.n; v++)
        assert_int_equal(*s.view[v].left_out != 0, v == 6);
    assert_non_null(strstr(s.view[6].left_out, "px"));
    for (int i = 0; i < CAL_N; i++)
        assert_true(fabs(error_in_sigmas(i)) < 5);
}

static void bent_board_is_measured(void **state) {
    (void)state;
    double shape[CAL_SHAPE] = {0.8, 0.3, -0.4}, X[3], low = 0, high = 0;
    shoot(&s, 25, 0.05);
    for (int v = 0; v < s.n; v++) {
        const cal_pose p = any_pose(&s.board);
        see(&s.board, shape, &lens, &p, 0.05, s.corner[v]);
    }
    for (int i = 0; i < cal_corners(&s.board); i++) {
        cal_corner(&s.board, shape, i, X, NULL);
        low = fmin(low, X[2]);
        high = fmax(high, X[2]);
    }
    assert_int_equal(calibrate(), 0);
    const double stiff = result.rms;
    s.options.flat = true;
    assert_int_equal(calibrate(), 0);
    assert_true(result.rms < 0.7 * stiff);
    assert_true(fabs(result.bulge - (high - low)) < 0.1);
    for (int i = 0; i < CAL_N; i++)
        assert_true(fabs(error_in_sigmas(i)) < 5);
}

static void wide_angle_is_found_from_nothing(void **state) {
    (void)state;
    const arris_camera wide = {1280, 960, 520, 520, 0, 650, 470, -0.28, 0.09, 0, 0, -0.013};
    shoot(&s, 20, 0.1);
    s.options.width = wide.width;
    s.options.height = wide.height;
    for (int v = 0; v < s.n; v++) {
        const double z = 200 + 150 * uniform();
        const cal_pose p =
            board_at(&s.board, 0.5 * z * (2 * uniform() - 1), 0.35 * z * (2 * uniform() - 1), z,
                     0.6 * (2 * uniform() - 1), 0.6 * (2 * uniform() - 1), 0.3);
        see(&s.board, NULL, &wide, &p, 0.1, s.corner[v]);
    }
    assert_int_equal(calibrate(), 0);
    assert_true(fabs(result.k[CAL_FX] - 520) < 1 && fabs(result.k[CAL_CX] - 650) < 1);
}

static void refuse(const char *why) {
    assert_int_equal(calibrate(), ARRIS_E_INPUT);
    if (!strstr(f.text, why))
        fail_msg("it does not say '%s' but '%s'", why, f.text);
    assert_non_null(f.hint);
}

static void what_tells_nothing_is_refused(void **state) {
    (void)state;
    shoot(&s, 1, 0.1);
    refuse("1 of 1 views");
    shoot(&s, 10, 0);
    for (int v = 1; v < s.n; v++)
        for (int i = 0; i < 2 * cal_corners(&s.board); i++)
            s.corner[v][i] = s.corner[0][i] + 0.1 * normal();
    cal_leave_out_same(&s.board, s.view, s.n, &s.options);
    assert_string_equal(s.view[9].left_out, "it shows the same as view 0");
    refuse("1 of 10 views");
    for (int times = 0; times < 10; times++) {
        shoot(&s, 20, 0.15);
        for (int v = 0; v < s.n; v++) {
            const cal_pose p = board_at(&s.board, 100 * normal(), 60 * normal(),
                                        400 + 400 * uniform(), 0, 0, normal());
            see(&s.board, NULL, &lens, &p, 0.15, s.corner[v]);
        }
        refuse("focal length is unobservable");
    }
    for (int v = 0; v < s.n; v++)
        for (int i = 0; i < 2 * cal_corners(&s.board); i++)
            s.corner[v][i] = 640 * uniform();
    assert_true(calibrate() < 0);
}

static void quality_tells_what_is_missing(void **state) {
    (void)state;
    cal_quality q;
    shoot(&s, 24, 0.1);
    assert_int_equal(calibrate(), 0);
    assert_int_equal(cal_assess(&s.board, s.view, s.n, &s.options, &result, 600, &q, &f), 0);
    assert_true(q.halved && q.apart < 2 && q.sigma.worst > q.sigma.middle && q.sigma.middle > 0);
    const double near = q.sigma.middle;
    cal_map_sigma(&result, 1200, &q.sigma);
    assert_true(fabs(q.sigma.middle / near - 2) < 0.01);
    for (int v = 0; v < s.n; v++) { /* all in the upper left, leaning one way */
        const cal_pose p = board_at(&s.board, -120 + 10 * normal(), -60 + 10 * normal(),
                                    700 + 50 * normal(), 0, 0.4 + 0.1 * uniform(), 0);
        see(&s.board, NULL, &lens, &p, 0.02, s.corner[v]);
    }
    s.options.fixed[CAL_K3] = s.options.fixed[CAL_SKEW] = true;
    assert_int_equal(calibrate(), 0);
    assert_int_equal(cal_assess(&s.board, s.view, s.n, &s.options, &result, 0, &q, &f), 0);
    assert_true(fabs(q.distance - 700) < 70);
    int corner = 0, tilt = 0;
    for (int i = 0; i < q.n_advice; i++) {
        corner += strstr(q.advice[i], "lower right corner") != NULL;
        tilt += strstr(q.advice[i], "upper edge tilted") != NULL;
    }
    assert_true(corner == 1 && tilt == 1);
}

/* ---- the hand-eye --------------------------------------------------------------------------- */

typedef struct robot {
    cal_pose X, Y; /* camera to flange, board to base */
    he_view view[BOARD_VIEWS];
} robot;

/* Views of a board by a camera on a flange that is reported with noise, mm and rad. One axis: it
 * only turns about the camera's axis. */
static void move_robot(robot *r, const cal_board *b, int n, double mm, double angle,
                       bool one_axis) {
    const double wx[3] = {0.1, -0.05, 1.6};
    shoot(&s, n, 0.15);
    s.board = *b;
    r->X = (cal_pose){.t = {30, -90, -35}};
    cal_rotation(wx, r->X.R);
    r->Y = (cal_pose){.R = {1, 0, 0, 0, 1, 0, 0, 0, 1}, .t = {-80, 230, 3}};
    for (int v = 0; v < n; v++) {
        const cal_pose P = one_axis ? board_at(b, 0, 0, 500, 0, 0, 0.2 * v) : any_pose(b);
        const cal_pose Pi = cal_inverse(&P), Xi = cal_inverse(&r->X);
        cal_pose F = cal_compose(&r->Y, &Pi);
        double d[6];
        F = cal_compose(&F, &Xi);
        for (int i = 0; i < 6; i++)
            d[i] = (i < 3 ? angle : mm) * normal();
        see(b, NULL, &lens, &P, 0.15, s.corner[v]);
        r->view[v] = (he_view){.view = &s.view[v], .flange = cal_moved(&F, d)};
    }
}

static void handeye_is_honest(void **state) {
    (void)state;
    enum { RUNS = 100 };
    const cal_board b = {9, 6, 30};
    robot r;
    he_result h;
    double sum[6] = {0}, mm = 0, angle = 0;
    for (int run = 0; run < RUNS; run++) {
        move_robot(&r, &b, 25, 0.5, 1e-3, false);
        assert_int_equal(he_fit(&b, &lens, r.view, 25, &h, &f), 0);
        double turn[9], back[9], w[3];
        const cal_pose Xi = cal_inverse(&r.X);
        memcpy(back, Xi.R, sizeof back);
        cal_multiply(h.camera_to_flange.R, back, turn);
        cal_rotation_vector(turn, w);
        for (int i = 0; i < 3; i++) {
            sum[i] += pow(h.camera_to_flange.t[i] - r.X.t[i], 2) / h.cov[7 * i] / RUNS;
            sum[3 + i] += w[i] * w[i] / h.cov[7 * (3 + i)] / RUNS;
        }
        mm += h.sigma_mm / RUNS;
        angle += h.sigma_angle / RUNS;
    }
    for (int i = 0; i < 6; i++) {
        print_message("%s: normalised error %.2f\n",
                      (const char *[]){"x", "y", "z", "turn x", "turn y", "turn z"}[i],
                      sqrt(sum[i]));
        assert_in_range((int)(100 * sqrt(sum[i])), 80, 130);
    }
    print_message("the robot's noise: %.3f mm, %.2e rad\n", mm, angle);
    assert_true(fabs(mm - 0.5) < 0.05 && fabs(angle - 1e-3) < 1e-4);
}

static void robot_resolves_how_the_board_lies(void **state) {
    (void)state;
    static const cal_board boards[] = {{7, 7, 30}, {9, 7, 30}, {8, 8, 30}};
    for (int k = 0; k < 3; k++) {
        robot r;
        he_result h;
        const cal_board *b = &boards[k];
        move_robot(&r, b, 20, 0.3, 1e-3, false);
        for (int v = 1; v < 20; v++) {
            if (v % 2)
                find_turn_half(b, s.corner[v]);
            if (k == 2 && v % 3)
                find_turn_quarter(b, s.corner[v]);
        }
        assert_int_equal(he_fit(b, &lens, r.view, 20, &h, &f), 0);
        for (int i = 0; i < 3; i++)
            assert_true(fabs(h.camera_to_flange.t[i] - r.X.t[i]) < 5 * sqrt(h.cov[7 * i]));
        assert_int_equal(h.views, 20);
    }
}

static void handeye_leaves_out_and_refuses(void **state) {
    (void)state;
    const cal_board b = {9, 6, 30};
    robot r;
    he_result h;
    move_robot(&r, &b, 20, 0.2, 5e-4, false);
    r.view[4].flange.t[0] += 40;
    assert_int_equal(he_fit(&b, &lens, r.view, 20, &h, &f), 0);
    assert_int_equal(h.views, 19);
    assert_non_null(strstr(s.view[4].left_out, "flange is"));
    for (int i = 0; i < 3; i++)
        assert_true(fabs(h.camera_to_flange.t[i] - r.X.t[i]) < 5 * sqrt(h.cov[7 * i]));
    move_robot(&r, &b, 20, 0.2, 5e-4, true);
    assert_int_equal(he_fit(&b, &lens, r.view, 20, &h, &f), ARRIS_E_INPUT);
    assert_non_null(strstr(f.text, "one axis"));
    move_robot(&r, &b, 3, 0.2, 5e-4, false);
    assert_int_equal(he_fit(&b, &lens, r.view, 3, &h, &f), ARRIS_E_INPUT);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(derivatives_are_those_of_the_projection),
        cmocka_unit_test(model_is_that_of_the_geometry),
        cmocka_unit_test(rotation_vectors_come_back),
        cmocka_unit_test(exact_corners_give_the_exact_camera),
        cmocka_unit_test(uncertainty_is_honest),
        cmocka_unit_test(uncertainty_is_honest_when_views_err),
        cmocka_unit_test(fixed_parameters_stay),
        cmocka_unit_test(strange_corners_do_no_harm),
        cmocka_unit_test(bad_view_is_left_out_and_named),
        cmocka_unit_test(bent_board_is_measured),
        cmocka_unit_test(wide_angle_is_found_from_nothing),
        cmocka_unit_test(what_tells_nothing_is_refused),
        cmocka_unit_test(quality_tells_what_is_missing),
        cmocka_unit_test(handeye_is_honest),
        cmocka_unit_test(robot_resolves_how_the_board_lies),
        cmocka_unit_test(handeye_leaves_out_and_refuses),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
