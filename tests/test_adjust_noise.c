/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_adjust_noise.c: what `adjust` finds out of simulated scans: the noise, covariances that are
 * true, what lens and poses have in common, lines and poses that are not what they seem.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <math.h>

#include "adjust/adjust.h"
#include "adjust/record.h"
#include "drawn_scan.h"

static void noise_and_covariance_are_true(void **unused) {
    (void)unused;
    enum { SCANS = 4 };
    scan_plan plan = {45, 14, 10, 0.2, 2e-4, 0.02, false};
    adjust_params params = {.robust = 4, .backend = &adj_cholmod};
    double nees = 0, n = 0, before = 0, after = 0, sigma[2] = {0, 0}, factor = 0;
    for (int k = 0; k < SCANS; k++) {
        record r;
        arris_lines lines = {0};
        adjusted result;
        state = 100 + k;
        simulate(&plan, &r, &lines);
        assert_int_equal(record_adjust(&r, &lines, &params, &result), 0);
        assert_non_null(result.pose);
        for (uint32_t i = 0; i < plan.frames; i++)
            for (int c = 0; c < 3; c++) {
                before += pow(r.frame[i].pose.C[c] - sim.pose[i].C[c], 2);
                after += pow(result.pose[i].C[c] - sim.pose[i].C[c], 2);
            }
        add_nees(&lines, &nees, &n);
        for (int c = 0; c < 6; c++)
            sigma[c / 3] += result.q.sigma[c] / 3 / SCANS;
        factor += result.q.factor / SCANS;
        assert_true(result.q.scale_sigma > 1e-5 && result.q.scale_sigma < 1e-2);
        free_scan(&r, &lines, &result);
    }
    print_message("nees %.2f of %.0f lines; positions %.4f -> %.4f mm; sigma %.3f mm %.2e rad; "
                  "factor %.3f\n",
                  nees / n, n, sqrt(before / 3 / SCANS / plan.frames),
                  sqrt(after / 3 / SCANS / plan.frames), sigma[0], sigma[1], factor);
    assert_true(nees / n > 0.4 && nees / n < 2);
    assert_true(after < 0.5 * before);
    assert_true(fabs(sigma[0] / 0.2 - 1) < 0.15 && fabs(sigma[1] / 2e-4 - 1) < 0.2);
    assert_true(fabs(factor - 1) < 0.1);
}

/* Edges whose profiles fit ill may err alike: that makes their lines less sure, but what the poses
 * err by is told from them all the same. */
static void ill_profiles_do_not_hide_the_noise(void **unused) {
    (void)unused;
    scan_plan plan = {60, 14, 6, 0.2, 2e-4, 0.05, false};
    adjust_params params = {.robust = 4, .backend = &adj_cholmod};
    adjusted result[2];
    double variance[2] = {0, 0};
    for (int ill = 0; ill < 2; ill++) {
        record r;
        arris_lines lines = {0};
        state = 140;
        simulate(&plan, &r, &lines);
        for (uint32_t i = 0; i < r.n; i++)
            r.item[i].chi2 = ill ? 3 : 1;
        assert_int_equal(record_adjust(&r, &lines, &params, &result[ill]), 0);
        for (uint32_t l = 0; l < lines.n; l++)
            variance[ill] += lines.item[l].cov[0];
        free_scan(&r, &lines, &result[ill]);
    }
    for (int k = 0; k < 6; k++) {
        double good = result[0].q.sigma[k], ill = result[1].q.sigma[k];
        print_message("sigma %.3g, %.3g\n", good, ill);
        assert_near(ill / good, 1, 0.05);
    }
    assert_true(variance[1] > 1.1 * variance[0]);
}

/* Nothing but the reported poses tells the scale: as a state it stays where it was, is known no
 * better than beforehand, and takes nothing from the noise of the poses. */
static void a_scale_that_nothing_tells_stays(void **unused) {
    (void)unused;
    scan_plan plan = {60, 14, 10, 0.2, 2e-4, 0.02, false};
    adjust_params params = {.robust = 4, .backend = &adj_cholmod};
    adjusted result[2];
    for (int k = 0; k < 2; k++) {
        record r;
        arris_lines lines = {0};
        state = 31;
        simulate(&plan, &r, &lines);
        params.common = k ? ADJ_SCALE : 0;
        assert_int_equal(record_adjust(&r, &lines, &params, &result[k]), 0);
        free_scan(&r, &lines, &result[k]);
    }
    const adj_quality *without = &result[0].q, *with = &result[1].q;
    print_message("scale %.1e, sigma %.1e; x %.3f, %.3f mm\n", result[1].state[0],
                  with->scale_sigma, without->sigma[0], with->sigma[0]);
    assert_true(fabs(result[1].state[0]) < 1e-4);
    assert_string_equal(result[0].undetermined, "");
    assert_non_null(strstr(result[1].undetermined, "state scale"));
    assert_true(without->scale_sigma < 1e-3 && fabs(with->scale_sigma / 0.01 - 1) < 0.1);
    for (int k = 0; k < 6; k++)
        assert_true(with->determined[k] && fabs(with->sigma[k] / without->sigma[k] - 1) < 0.1);
}

/* RMS (mm) of what frames err by along x, apart from their mean and trend. */
static double shape_of(const double *error, uint32_t n) {
    double mean = 0, trend = 0, squares = 0, sum = 0;
    for (uint32_t i = 0; i < n; i++)
        mean += error[i] / n;
    for (uint32_t i = 0; i < n; i++) {
        double t = i - (n - 1) / 2.0;
        trend += t * error[i], squares += t * t;
    }
    for (uint32_t i = 0; i < n; i++)
        sum += pow(error[i] - mean - trend / squares * (i - (n - 1) / 2.0), 2);
    return sqrt(sum / n);
}

/* A robot that sticks and slips errs alike for some frames: no line takes that for its own, few as
 * they are, and ill as their profiles fit. */
static void poses_that_err_alike_are_adjusted(void **unused) {
    (void)unused;
    enum { SCANS = 8, FRAMES = 100 };
    scan_plan plan = {FRAMES, 5, 4, 0, 0, 0.03, false};
    adjust_params params = {.robust = 4, .backend = &adj_cholmod};
    double before = 0, after = 0;
    for (int k = 0; k < SCANS; k++) {
        record r;
        arris_lines lines = {0};
        adjusted result;
        double reported[FRAMES], left[FRAMES], slip = 0;
        state = 60 + (uint64_t)k;
        simulate(&plan, &r, &lines);
        for (uint32_t i = 0; i < FRAMES; i++) {
            slip = 0.9 * slip + 0.13 * gauss();
            reported[i] = slip;
            r.frame[i].pose.C[0] += slip, r.frame[i].at.C[0] += slip;
        }
        for (uint32_t i = 0; i < r.n; i++)
            r.item[i].chi2 = 2;
        assert_int_equal(record_adjust(&r, &lines, &params, &result), 0);
        for (uint32_t i = 0; i < FRAMES; i++)
            left[i] = result.pose[i].C[0] - sim.pose[i].C[0];
        before += shape_of(reported, FRAMES) / SCANS;
        after += shape_of(left, FRAMES) / SCANS;
        free_scan(&r, &lines, &result);
    }
    print_message("positions along x, but for mean and trend: %.3f -> %.3f mm\n", before, after);
    assert_true(after < 0.5 * before);
}

/* A line that was followed from its edge over to one behind it is where most of its views saw it,
 * and leaves the poses alone. */
static void views_of_another_edge_do_no_harm(void **unused) {
    (void)unused;
    enum { WHICH = 6 };
    scan_plan plan = {60, 10, 5, 0.1, 1e-4, 0.02, false};
    adjust_params params = {.robust = 4, .backend = &adj_cholmod};
    record r;
    arris_lines lines = {0};
    adjusted result;
    uint32_t strayed = 0, seen = 0;
    state = 23;
    simulate(&plan, &r, &lines);
    for (uint32_t i = 0; i < r.n; i++)
        seen += r.item[i].track == WHICH;
    for (uint32_t i = 0, k = 0; i < r.n; i++) {
        sighting *o = &r.item[i];
        if (o->track != WHICH || k++ < 2 * seen / 3)
            continue;
        double shift = 0.03 * ++strayed / hypot(o->x2 - o->x1, o->y2 - o->y1); /* px a frame */
        double nx = -(o->y2 - o->y1) * shift, ny = (o->x2 - o->x1) * shift;
        o->x1 += nx, o->x2 += nx, o->y1 += ny, o->y2 += ny;
    }
    assert_int_equal(record_adjust(&r, &lines, &params, &result), 0);
    print_message("%u of %u views strayed, %u agree; nees %.2f\n", strayed, seen,
                  lines.item[WHICH].views, nees_of(&lines.item[WHICH], WHICH));
    assert_true(strayed > 10 && lines.item[WHICH].views < seen - strayed / 2);
    assert_true(nees_of(&lines.item[WHICH], WHICH) < 4);
    for (uint32_t i = 0; i < lines.n; i++)
        if (i % 4 && lines.item[i].views > 20)
            assert_true(nees_of(&lines.item[i], i) < 6);
    free_scan(&r, &lines, &result);
}

/* Bends all sightings by what a lens model may leave, px by adj_lens. */
static void bend(record *r, const double lens[ADJ_LENS_TERMS]) {
    for (uint32_t i = 0; i < r->n; i++) {
        double *const to[2][2] = {{&r->item[i].x1, &r->item[i].y1},
                                  {&r->item[i].x2, &r->item[i].y2}};
        for (int end = 0; end < 2; end++) {
            double x[2] = {*to[end][0], *to[end][1]}, by[ADJ_LENS_TERMS][2];
            adj_lens(&r->camera, x, by);
            for (int k = 0; k < ADJ_LENS_TERMS; k++)
                *to[end][0] -= lens[k] * by[k][0], *to[end][1] -= lens[k] * by[k][1];
        }
    }
}

/* What the lens model left becomes a state where it is evident, and only there. */
static void a_lens_that_is_off_is_found(void **unused) {
    (void)unused;
    static const double left[2][ADJ_LENS_TERMS] = {{0}, {-0.8, 0.3, 0.2, -0.1}};
    scan_plan plan = {60, 20, 10, 0.2, 2e-4, 0.02, false};
    adjust_params params = {.robust = 4, .backend = &adj_cholmod};
    for (int k = 0; k < 2; k++) {
        record r;
        arris_lines lines = {0};
        adjusted result;
        double nees = 0, n = 0;
        state = 41;
        simulate(&plan, &r, &lines);
        bend(&r, left[k]);
        assert_int_equal(record_adjust(&r, &lines, &params, &result), 0);
        add_nees(&lines, &nees, &n);
        print_message("lens %.2f %.2f %.2f %.2f px; nees %.2f\n", result.state[0], result.state[1],
                      result.state[2], result.state[3], nees / n);
        assert_int_equal(result.common, k ? ADJ_LENS : 0);
        for (int i = 0; k && i < ADJ_LENS_TERMS; i++)
            assert_near(result.state[i], left[k][i], 0.1);
        assert_true(nees / n < 2);
        free_scan(&r, &lines, &result);
    }
}

/* Of its middle, mm. */
static double distance_from_truth(const arris_line *l, uint32_t i) {
    double u[3], d[3], n[3];
    for (int k = 0; k < 3; k++) {
        u[k] = sim.Q[i][k] - sim.P[i][k];
        d[k] = (l->p[k] + l->q[k]) / 2 - sim.P[i][k];
    }
    arris_unit(u);
    arris_cross(u, d, n);
    return sqrt(arris_dot(n, n));
}

/* Puts beside the line what comes into sight on its left with the frames, and moves its views by
 * that; some of them run the other way. */
static void put_beside(record *r, uint32_t line, bool known) {
    for (uint32_t i = 0; i < r->n; i++) {
        sighting *o = &r->item[i];
        double wider = 0.15 * fmax(0, 2.0 * o->frame / r->n_frames - 1), by = 1.1 * wider;
        double dx = o->x2 - o->x1, dy = o->y2 - o->y1, length = hypot(dx, dy);
        double blur = 0.6 + 0.004 * gauss(), left = 1 + 0.2 * gauss();
        if (o->track == (int32_t)line) {
            blur += wider, left += 100 * wider;
            o->x1 += by * dy / length, o->x2 += by * dy / length;
            o->y1 -= by * dx / length, o->y2 -= by * dx / length;
        }
        if (known)
            o->blur = (float)blur, o->beside[0] = (float)left, o->beside[1] = 1;
        if (o->frame % 3 == 0) {
            sighting was = *o;
            o->x1 = was.x2, o->y1 = was.y2, o->x2 = was.x1, o->y2 = was.y1;
            o->beside[0] = was.beside[1], o->beside[1] = was.beside[0];
        }
    }
}

static void what_is_beside_is_taken_out(void **unused) {
    (void)unused;
    enum { LINE = 5 };
    scan_plan plan = {80, 16, 3, 0.05, 2e-5, 0.02, false};
    adjust_params params = {.robust = 4, .backend = &adj_cholmod};
    double error[2];
    for (int known = 0; known < 2; known++) {
        record r;
        arris_lines lines = {0};
        adjusted result;
        state = 12;
        simulate(&plan, &r, &lines);
        put_beside(&r, LINE, known);
        assert_int_equal(record_adjust(&r, &lines, &params, &result), 0);
        error[known] = distance_from_truth(&lines.item[LINE], LINE);
        free_scan(&r, &lines, &result);
    }
    print_message("off by %.3f mm, then %.3f\n", error[0], error[1]);
    assert_true(error[1] < 0.4 * error[0]);
}

/* A pose that is wrong is named, and does no harm. */
static void outliers_are_named(void **unused) {
    (void)unused;
    scan_plan plan = {40, 14, 9, 0.1, 1e-4, 0.02, false};
    adjust_params params = {.robust = 4, .backend = &adj_cholmod};
    record r;
    arris_lines lines = {0};
    adjusted result;
    state = 5;
    simulate(&plan, &r, &lines);
    r.frame[17].pose.C[1] += 4;
    r.frame[17].at.C[1] += 4;
    assert_int_equal(record_adjust(&r, &lines, &params, &result), 0);
    for (uint32_t i = 0; i < plan.frames; i++)
        assert_int_equal(r.frame[i].outlier, i == 17);
    assert_true(result.q.sigma[1] < 0.2);
    free_scan(&r, &lines, &result);
}

/* Nor does one that sees too little to say where it is instead. */
static void outliers_may_see_little(void **unused) {
    (void)unused;
    for (uint64_t seed = 1; seed < 40; seed++) {
        scan_plan plan = {40, 14, 9, 0.1, 1e-4, 0.005, seed % 2};
        adjust_params params = {.robust = 4, .backend = &adj_cholmod};
        record r;
        arris_lines lines = {0};
        adjusted result;
        uint32_t n = 0, seen = 0;
        state = seed;
        simulate(&plan, &r, &lines);
        r.frame[17].pose.C[0] += 4;
        r.frame[17].at.C[0] += 4;
        for (uint32_t i = 0; i < r.n; i++)
            if (r.item[i].frame != 17 || seen++ < 1 + seed % 3)
                r.item[n++] = r.item[i];
        r.n = n;
        assert_int_equal(record_adjust(&r, &lines, &params, &result), 0);
        assert_non_null(result.pose);
        assert_true(result.q.sigma[0] < 0.2);
        free_scan(&r, &lines, &result);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(noise_and_covariance_are_true),
        cmocka_unit_test(ill_profiles_do_not_hide_the_noise),
        cmocka_unit_test(a_scale_that_nothing_tells_stays),
        cmocka_unit_test(poses_that_err_alike_are_adjusted),
        cmocka_unit_test(views_of_another_edge_do_no_harm),
        cmocka_unit_test(a_lens_that_is_off_is_found),
        cmocka_unit_test(what_is_beside_is_taken_out),
        cmocka_unit_test(outliers_are_named),
        cmocka_unit_test(outliers_may_see_little),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
