/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_reconstruct.c: the estimate of lines against geometry that is known: exact planes, the
 * Cramér-Rao bound, motions that tell nothing, and segments that are another edge's.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "../plugins/reconstruct/scan.h"
#include "views.h"

/* Frame i of n on an arc that looks at the middle. */
static arris_pose on_arc(int i, int n) {
    double t = (i - (n - 1) / 2.0) / n;
    return pose_at(800 * sin(t), 20 * t, 800 - 800 * cos(t), 0.2 * t, -t, 0.3 + t);
}

/* Distance of a point from the edge's line, mm. */
static double off(const edge *e, const double P[3]) {
    double u[3], d[3], c[3];
    for (int i = 0; i < 3; i++)
        u[i] = e->q[i] - e->p[i], d[i] = P[i] - e->p[i];
    arris_unit(u);
    arris_cross(u, d, c);
    return sqrt(arris_dot(c, c));
}

static double off_at_ends(const line *l, const edge *e) {
    double P[3], Q[3];
    frame_point(&l->f, l->x, -1, P);
    frame_point(&l->f, l->x, 1, Q);
    return fmax(off(e, P), off(e, Q));
}

/* ---- the Cramér-Rao bound, from projection alone ----------------------------------------------
 */

/* Adds the information of one view: the distances of the moved edge's picture from that of the
 * edge, at the places where the edge's picture ends. */
static void add_information(mat4 *F, const edge *e, const frame *f, const double x[4],
                            const arris_pose *pose, double sigma) {
    double a[2], b[2], J[2][4], h = 1e-4;
    if (!project(e, pose, a, b))
        return;
    double dx = b[0] - a[0], dy = b[1] - a[1], length = hypot(dx, dy);
    for (int k = 0; k < 4; k++) {
        double y[4] = {x[0], x[1], x[2], x[3]}, c[2], d[2], r[2];
        edge m;
        y[k] += h;
        frame_point(f, y, -1, m.p);
        frame_point(f, y, 1, m.q);
        project(&m, pose, c, d);
        double slope =
            ((d[1] - c[1]) * dx - (d[0] - c[0]) * dy) / ((d[0] - c[0]) * dx + (d[1] - c[1]) * dy);
        for (int i = 0; i < 2; i++) { /* at a, then b: right of the edge's picture */
            double ax = (i ? b : a)[0] - c[0], ay = (i ? b : a)[1] - c[1];
            r[i] = slope * (ax * dx + ay * dy) / length - (ay * dx - ax * dy) / length;
        }
        J[0][k] = (r[0] + r[1]) / 2 / h;      /* offset */
        J[1][k] = (r[1] - r[0]) / length / h; /* angle */
    }
    double var = sigma * sigma * 100 / length, weight[2] = {1 / var, length * length / (12 * var)};
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++)
            F->m[i][j] += weight[0] * J[0][i] * J[0][j] + weight[1] * J[1][i] * J[1][j];
}

/* ---- one line -------------------------------------------------------------------------------- */

typedef arris_pose path(int i, int n);

static const edge upright = {{-20, -90, 720}, {35, 80, 690}};
static const edge steep = {{-60, -70, 640}, {-20, 60, 900}}; /* goes into the depth */

static void fit_noiseless(const edge *e, path *where, int n) {
    line l;
    linear r;
    line_begin(&l, 0);
    for (int i = 0; i < n; i++) {
        arris_pose pose = where(i, n);
        arris_segment s;
        view v;
        if (!detect(e, &pose, 0, 0, &s))
            continue;
        s.cov[0] = 1e-2, s.cov[2] = 1e-5;
        assert_int_equal(view_make(&v, &s, &camera, &pose, picture), 0);
        line_add(&l, &v, &known, &r);
    }
    line_refine(&l, &known);
    assert_true(l.settled);
    assert_true(line_observable(&l));
    assert_true(off_at_ends(&l, e) < 1e-9);
    assert_true(sqrt(l.all.squares / (2.0 * l.all.n)) < 1e-9);
}

static void exact_planes_give_the_line(void **state) {
    (void)state;
    seed = 1;
    fit_noiseless(&upright, on_path, 40);
    fit_noiseless(&steep, on_path, 40);
    fit_noiseless(&upright, on_arc, 40);
    fit_noiseless(&steep, on_arc, 40);
    fit_noiseless(&steep, on_arc, 130); /* some views are summed up, no longer kept */
}

static void two_views_give_the_line(void **state) {
    (void)state;
    view v[2];
    line l;
    linear r;
    for (int k = 0; k < 2; k++) {
        arris_pose pose = on_arc(k * 30, 31);
        assert_true(see(&steep, &pose, 1e-9, &v[k]));
    }
    line_begin(&l, 0);
    line_add(&l, &v[0], &known, &r);
    line_add(&l, &v[1], &known, &r);
    assert_true(off_at_ends(&l, &steep) < 1e-5);
}

/* 500 trials of n views: the errors are what the covariance says and as small as they can be. */
static void check_statistics(const edge *e, path *where, int n, double sigma) {
    enum { TRIALS = 500 };
    double nees = 0, squares[4] = {0}, bound[4] = {0};
    for (int t = 0; t < TRIALS; t++) {
        line l;
        linear r;
        mat4 F = {{{0}}}, V, inverse;
        double d[4], x[4];
        line_begin(&l, 0);
        for (int i = 0; i < n; i++) {
            arris_pose pose = where(i, n);
            view v;
            if (see(e, &pose, sigma, &v))
                line_add(&l, &v, &known, &r);
        }
        line_refine(&l, &known);
        error_of(&l, e, d);
        truth_in_frame(e, &l.f, x);
        for (int i = 0; i < n; i++) {
            arris_pose pose = where(i, n);
            add_information(&F, e, &l.f, x, &pose, sigma);
        }
        assert_true(mat4_invert(&F, &V) && mat4_invert(&l.cov, &inverse));
        nees += mat4_form(&inverse, d, d) / 4 / TRIALS;
        for (int k = 0; k < 4; k++)
            squares[k] += d[k] * d[k], bound[k] += V.m[k][k];
    }
    print_message("    nees %.3f, error over the bound", nees);
    for (int k = 0; k < 4; k++)
        print_message(" %.3f", sqrt(squares[k] / bound[k]));
    print_message("\n");
    assert_true(nees > 0.8 && nees < 1.25);
    for (int k = 0; k < 4; k++)
        assert_true(sqrt(squares[k] / bound[k]) < 1.2);
}

static void errors_are_honest_and_at_the_bound(void **state) {
    (void)state;
    seed = 2;
    check_statistics(&upright, on_path, 60, 0.1);
    check_statistics(&steep, on_path, 60, 0.02);
    check_statistics(&upright, on_arc, 60, 0.1);
    check_statistics(&steep, on_arc, 40, 0.3);
    check_statistics(&steep, on_arc, 200, 0.1);
}

static void fit_views(line *l, const edge *e, double sigma, int first, int last) {
    linear r;
    line_begin(l, 0);
    for (int i = first; i < last; i++) {
        arris_pose pose = on_path(i, 60);
        view v;
        assert_true(see(e, &pose, sigma, &v));
        line_add(l, &v, &known, &r);
    }
    line_complete(l, &known);
}

static void assert_near(double a, double b) {
    assert_true(fabs(a - b) <= 1e-9 * (1 + fabs(b)));
}

/* Several views at once are each of them, and add up to their sum; one of them is from behind. */
static void views_at_once_are_each(void **state) {
    (void)state;
    enum { N = 7 };
    view v[N];
    line l;
    seed = 4;
    fit_views(&l, &steep, 0.1, 0, 40);
    for (int corrected = 0; corrected < 2; corrected++) {
        pose_noise noise = {0.1, 1e-4, corrected};
        double x[4] = {0.3, -0.2, 0.1, 0.4};
        for (int i = 0; i < N; i++) {
            arris_pose pose = on_arc(i, N);
            assert_true(see(&steep, &pose, 0.3, &v[i]));
            v[i].misfit = 0.1 * i, v[i].left = 1 - 0.1 * i, v[i].shift[i % 3] = 0.2 * i;
            for (int k = 0; k < 3 && i == 4; k++)
                v[i].axis[k] = -v[i].axis[k];
        }
        for (uint32_t n = 1; n <= VIEWS; n++) {
            linears all;
            info sum = {0}, each = {0};
            bool take[VIEWS] = {false};
            views_linearise(v, n, 2, &l.f, x, &noise, &all);
            for (uint32_t k = 0; k < n; k++) {
                linear one, same;
                take[k] = view_linearise(&v[2 * k], &l.f, x, &noise, &one);
                assert_int_equal(take[k], 2 * k != 4);
                assert_int_equal(views_pick(&all, k, &same), take[k]);
                if (!take[k])
                    continue;
                assert_memory_equal(&one, &same, sizeof one);
                assert_near(all.distance[k], linear_distance(&one, NULL));
                info_add(&each, &one, x);
            }
            info_add_views(&sum, &all, take, x);
            for (int i = 0; i < 4; i++) {
                for (int j = 0; j < 4; j++)
                    assert_near(sum.H.m[i][j], each.H.m[i][j]);
                assert_near(sum.g[i], each.g[i]);
            }
            assert_near(sum.c, each.c);
            assert_near(sum.squares, each.squares);
            assert_near(sum.misfit, each.misfit);
            assert_near(sum.weight, each.weight);
            assert_int_equal(sum.n, each.n);
        }
    }
}

/* The estimate view by view is that of all views at once. */
static void incremental_is_batch(void **state) {
    (void)state;
    enum { N = LINE_KEPT };
    line step, batch;
    linear r;
    seed = 3;
    line_begin(&step, 0);
    line_begin(&batch, 0);
    batch.next_fit = UINT32_MAX;
    for (int i = 0; i < N; i++) {
        arris_pose pose = on_arc(i, N);
        view v;
        assert_true(see(&steep, &pose, 0.1, &v));
        line_add(&step, &v, &known, &r);
        line_add(&batch, &v, &known, &r);
    }
    line_fit(&batch, &known);
    double P[3], e[4], running = 0;
    edge found;
    frame_point(&batch.f, batch.x, -1, found.p);
    frame_point(&batch.f, batch.x, 1, found.q);
    error_of(&step, &found, e);
    for (int i = 0; i < 4; i++)
        running = fmax(running, fabs(e[i]) / sqrt(step.cov.m[i][i]));
    assert_true(running < 0.1); /* sigmas: as far as it may be from being linearised anew */
    line_refine(&step, &known);
    frame_point(&step.f, step.x, 1, P);
    assert_true(off(&found, P) < 1e-6);
    frame_point(&step.f, step.x, -1, P);
    assert_true(off(&found, P) < 1e-6);
}

/* Every tenth segment is of another edge, 1 to 30 px off, from the first view on. */
static void outliers_are_left_out(void **state) {
    (void)state;
    double squares = 0, stated = 0;
    seed = 4;
    for (int t = 0; t < 100; t++) {
        line l;
        linear r;
        int bad = 0;
        line_begin(&l, 0);
        for (int i = 0; i < 60; i++) {
            arris_pose pose = on_path(i, 60);
            arris_segment s;
            view v;
            assert_true(detect(&upright, &pose, 0.1, 1, &s));
            if (uniform() < 0.1) {
                double shift = (1 + 29 * uniform()) * (uniform() < 0.5 ? 1 : -1);
                s.x1 += shift, s.x2 += shift * (1 + 0.1 * normal());
                bad++;
            }
            assert_int_equal(view_make(&v, &s, &camera, &pose, picture), 0);
            line_add(&l, &v, &known, &r);
        }
        line_refine(&l, &known);
        assert_true(l.settled && line_observable(&l));
        assert_true(l.all.n + bad <= 61 && l.all.n + bad >= 57);
        double d[4];
        error_of(&l, &upright, d);
        squares += (d[0] * d[0] + d[2] * d[2]) / 200; /* in depth, at both ends */
        stated += (l.cov.m[0][0] + l.cov.m[2][2]) / 200;
    }
    print_message("    error %.3f mm, its sigma %.3f mm\n", sqrt(squares), sqrt(stated));
    assert_true(squares < 1.3 * 1.3 * stated);
}

static bool in_sight(double t) {
    return t < -0.25;
}

static float beside = 100; /* the grey level of the riser */

/* The line that 64 views give whose offset is off by drift(t), t from -1 to 1 over the sweep. */
static void fit_drifting(line *l, double sigma, float chi2, double (*drift)(double t)) {
    linear r;
    line_begin(l, 0);
    for (int i = 0; i < 64; i++) {
        arris_pose pose = on_path(i, 64);
        arris_segment s;
        view v;
        assert_true(detect(&upright, &pose, sigma, 0, &s));
        double shift = drift(i / 31.5 - 1);
        s.x1 += shift, s.x2 += shift;
        s.chi2 = chi2;
        s.lo = in_sight(i / 31.5 - 1) ? beside : 100, s.hi = 200;
        assert_int_equal(view_make(&v, &s, &camera, &pose, picture), 0);
        line_add(l, &v, &known, &r);
    }
    line_complete(l, &known);
    assert_true(l->settled && line_observable(l));
}

/* A riser that is not resolved, as long as it is in sight. */
static double riser(double t) {
    return in_sight(t) ? 0.3 * (-0.25 - t) : 0;
}

static double none(double t) {
    (void)t;
    return 0;
}

/* As a scan does at its end. */
static void part(line *l) {
    line other;
    if (line_contradiction(l, &known) > 40 && !line_split(l, &other, &known))
        line_prune(l, &known);
}

static void the_run_that_agrees_is_the_line(void **state) {
    (void)state;
    double squares = 0, clean = 0;
    uint32_t cut = 0;
    seed = 5;
    for (int t = 0; t < 50; t++) {
        line l;
        double d[4];
        fit_drifting(&l, 0.02, 0, riser);
        part(&l);
        error_of(&l, &upright, d);
        squares += d[0] * d[0] / 50;
        cut += l.n_kept < 64;
        fit_drifting(&l, 0.02, 0, none);
        part(&l);
        error_of(&l, &upright, d);
        clean += d[0] * d[0] / 50;
        assert_int_equal(l.n_kept, 64);
    }
    print_message("    %u of 50 cut, error %.3f mm, without the riser %.3f mm\n", cut,
                  sqrt(squares), sqrt(clean));
    assert_true(cut >= 45);
    assert_true(squares < 0.5 * 0.5); /* all views together are off by 1 mm */
}

/* Where the poses leave it open whether views contradict each other, what they see beside the edge
 * tells. */
static void what_looks_different_is_dropped(void **state) {
    (void)state;
    scene slow = known; /* noise of the positions, that stays for many views */
    slow.noise.position = 0.15;
    slow.memory = 40;
    for (beside = 100; beside >= 20; beside -= 80) {
        line l;
        double d[4];
        seed = 5;
        fit_drifting(&l, 0.02, 0, riser);
        line_prune(&l, &slow);
        error_of(&l, &upright, d);
        print_message("    level %.0f: %u views, error %.3f mm\n", (double)beside, l.n_kept, d[0]);
        assert_int_equal(l.n_kept < 64, beside < 100);
    }
    beside = 100;
}

static double bow[3];

static double bowed(double t) {
    return bow[0] + bow[1] * t + bow[2] * t * t;
}

/* What the profile leaves unexplained is the same in many views. */
static void misfit_does_not_average_out(void **state) {
    (void)state;
    double nees[2] = {0, 0}, place[2] = {-1, 1};
    seed = 6;
    for (int t = 0; t < 100; t++)
        for (int k = 0; k < 2; k++) {
            line l;
            double d[4];
            mat4 inverse;
            for (int i = 0; i < 3; i++)
                bow[i] = k * 0.03 * normal();
            fit_drifting(&l, 0.05, k ? 4 : 1, bowed);
            error_of(&l, &upright, d);
            mat4 P = line_covariance(&l, &known, l.prior, place);
            assert_true(mat4_invert(&P, &inverse));
            nees[k] += mat4_form(&inverse, d, d) / 400;
        }
    print_message("    nees %.2f; with systematic error %.2f\n", nees[0], nees[1]);
    assert_true(nees[0] > 0.5 && nees[0] < 1.5);
    assert_true(nees[1] > 0.3 && nees[1] < 2);
}

/* Views that are no more kept, as two lines of a scan become one at its end, count with the noise
 * of their poses: that of the kept ones is corrected then, but theirs is not. */
static void the_absorbed_keep_the_noise_of_poses(void **state) {
    (void)state;
    static line l[2], other;
    scene s = known;
    s.noise.position = 0.3;
    for (int corrected = 0; corrected < 2; corrected++) {
        seed = 7;
        fit_views(&l[corrected], &upright, 0.05, 0, 55);
        fit_views(&other, &upright, 0.05, 5, 60);
        for (uint32_t i = 0; i < other.n_kept; i++)
            l[corrected].kept[i].left = other.kept[i].left = 0.05;
        s.noise.corrected = corrected;
        line_absorb(&l[corrected], &other, &s);
        s.noise.corrected = false;
        line_weigh(&l[corrected], &s);
        assert_int_equal(l[corrected].all.n, 110);
    }
    for (int i = 0; i < 4; i++) {
        double ratio = l[1].all.H.m[i][i] / l[0].all.H.m[i][i];
        assert_true(ratio > 0.95 && ratio < 1.05);
    }
}

/* ---- a whole scan -----------------------------------------------------------------------------
 */

enum { MAX_LINES = 64 };

static scan *new_scan(void) {
    scan_params p = {.limit = -1, .max_lines = MAX_LINES, .min_views = 4};
    scan *s = scan_new(&p);
    assert_non_null(s);
    return s;
}

static arris_lines *lines_of(scan *s) {
    static arris_line item[MAX_LINES];
    static arris_lines lines;
    lines = (arris_lines){.max = MAX_LINES, .item = item};
    scan_write(s, &lines);
    return &lines;
}

static void assert_sound(const arris_lines *lines) {
    for (uint32_t i = 0; i < lines->n; i++) {
        const arris_line *l = &lines->item[i];
        for (int k = 0; k < 3; k++)
            assert_true(isfinite(l->p[k]) && isfinite(l->q[k]));
        for (int k = 0; k < 21; k++)
            assert_true(isfinite(l->cov[k]));
        for (int k = 0, at = 0; k < 6; at += 6 - k++)
            assert_true(l->cov[at] > 0);
        assert_true(isfinite(l->rms) && isfinite(l->baseline));
    }
}

/* Edge e as track `id` in this frame, when it is seen. */
static void add(scan *s, int id, const edge *e, const arris_pose *true_pose, const arris_pose *pose,
                double sigma) {
    arris_segment g;
    view v;
    bool seen =
        detect(e, true_pose, sigma, 1, &g) && view_make(&v, &g, &camera, pose, picture) == 0;
    scan_add(s, id, seen ? &v : NULL);
}

/* One edge, turned by `degrees` from the motion in the picture's plane or in depth. */
static enum arris_line_state state_at(double degrees, bool in_depth, double sigma) {
    double t = degrees * M_PI / 180;
    edge e = {
        {-100 * cos(t), 30 - (in_depth ? 0 : 100 * sin(t)), 700 - (in_depth ? 100 * sin(t) : 0)},
        {100 * cos(t), 30 + (in_depth ? 0 : 100 * sin(t)), 700 + (in_depth ? 100 * sin(t) : 0)}};
    scan *s = new_scan();
    enum arris_line_state state = ARRIS_UNOBSERVABLE;
    for (int i = 0; i < 135; i++) {
        arris_pose pose = on_path(i, 135);
        add(s, 0, &e, &pose, &pose, sigma);
        scan_end_frame(s, true);
        arris_lines *lines = lines_of(s);
        assert_sound(lines);
        for (uint32_t k = 0; k < lines->n; k++)
            if (degrees < 1)
                assert_int_not_equal(lines->item[k].state, ARRIS_MEASURED);
    }
    scan_finish(s);
    arris_lines *lines = lines_of(s);
    assert_sound(lines);
    assert_int_equal(lines->n, 1);
    state = lines->item[0].state;
    scan_free(s);
    return state;
}

static void parallel_motion_is_refused(void **state) {
    (void)state;
    seed = 5;
    for (int k = 0; k < 3; k++) {
        double sigma = (double[]){0.003, 0.03, 0.3}[k];
        for (int depth = 0; depth < 2; depth++) {
            assert_int_equal(state_at(0, depth, sigma), ARRIS_UNOBSERVABLE);
            assert_int_equal(state_at(0.1, depth, sigma), ARRIS_UNOBSERVABLE);
            assert_int_not_equal(state_at(0.5, depth, sigma), ARRIS_MEASURED);
        }
    }
    assert_int_equal(state_at(4, false, 0.003), ARRIS_MEASURED);
    assert_int_equal(state_at(15, false, 0.03), ARRIS_MEASURED);
}

static void few_views_claim_nothing(void **state) {
    (void)state;
    seed = 6;
    for (int n = 0; n < 6; n++) {
        scan *s = new_scan();
        for (int i = 0; i < n; i++) {
            arris_pose pose = on_path(i, n);
            add(s, 0, &upright, &pose, &pose, 0.1);
            scan_end_frame(s, true);
        }
        scan_finish(s);
        arris_lines *lines = lines_of(s);
        assert_sound(lines);
        assert_in_range(lines->n, 0, n >= 4);
        assert_int_equal(lines->frames, n);
        for (uint32_t k = 0; k < lines->n; k++)
            assert_int_not_equal(lines->item[k].state, ARRIS_MEASURED);
        scan_free(s);
    }
}

static void standing_still_is_unobservable(void **state) {
    (void)state;
    seed = 7;
    scan *s = new_scan();
    for (int i = 0; i < 300; i++) {
        arris_pose pose = pose_at(12, -3, 5, 0.1, 0.05, -0.2);
        add(s, 0, &upright, &pose, &pose, 0.1);
        scan_end_frame(s, true);
        assert_sound(lines_of(s));
    }
    assert_int_equal(lines_of(s)->n, 1);
    assert_int_equal(lines_of(s)->item[0].state, ARRIS_UNOBSERVABLE);
    for (int i = 0; i < 60; i++) { /* and then it moves */
        arris_pose pose = pose_at(12 + 4 * i, -3, 5, 0.1, 0.05, -0.2);
        add(s, 0, &upright, &pose, &pose, 0.1);
        scan_end_frame(s, true);
    }
    scan_finish(s);
    assert_int_equal(lines_of(s)->item[0].state, ARRIS_MEASURED);
    assert_true(off(&upright, lines_of(s)->item[0].p) < 2);
    scan_free(s);
}

/* The ends are those of the edge, also of one that is never in the picture as a whole. */
static void ends_are_where_the_edge_ends(void **state) {
    (void)state;
    const edge edges[2] = {upright, {{-300, -60, 720}, {280, 40, 720}}};
    seed = 8;
    scan *s = new_scan();
    for (int i = 0; i < 135; i++) {
        arris_pose pose = on_path(i, 135);
        for (int k = 0; k < 2; k++)
            add(s, k, &edges[k], &pose, &pose, 0.03);
        scan_end_frame(s, true);
    }
    scan_finish(s);
    arris_lines *lines = lines_of(s);
    assert_int_equal(lines->n, 2);
    for (uint32_t k = 0; k < 2; k++) {
        double d[2] = {0, 0};
        for (int i = 0; i < 3; i++) {
            d[0] += pow(lines->item[k].p[i] - edges[k].p[i], 2);
            d[1] += pow(lines->item[k].q[i] - edges[k].q[i], 2);
        }
        assert_int_equal(lines->item[k].state, ARRIS_MEASURED);
        print_message("    ends off by %.1f and %.1f mm\n", sqrt(d[0]), sqrt(d[1]));
        assert_true(sqrt(d[0]) < 5 && sqrt(d[1]) < 5);
    }
    scan_free(s);
}

/* An edge that is seen in two pieces, the upper one in 14 frames of 40, reaches to the end of that:
 * it was there in the 14, whatever saw the other piece. */
static void pieces_are_of_one_edge(void **state) {
    (void)state;
    edge piece[2] = {upright, upright};
    linear r;
    line l;
    double end[3];
    for (int i = 0; i < 3; i++) {
        piece[0].q[i] = 0.4 * upright.p[i] + 0.6 * upright.q[i];
        piece[1].p[i] = 0.38 * upright.p[i] + 0.62 * upright.q[i];
    }
    line_begin(&l, 0);
    for (int i = 0; i < 40; i++) {
        arris_pose pose = on_path(i, 40);
        for (int k = 0; k < (i % 20 < 7 ? 2 : 1); k++) {
            view v;
            assert_true(see(&piece[k], &pose, 0.05, &v));
            v.frame = (uint32_t)i;
            line_add(&l, &v, &known, &r);
        }
    }
    line_complete(&l, &known);
    frame_point(&l.f, l.x, l.ends[1], end);
    for (int i = 0; i < 3; i++)
        assert_true(fabs(end[i] - upright.q[i]) < 5);
}

/* An edge whose track broke is one line; its neighbour and its opposite are lines of their own. */
static void one_line_per_edge(void **state) {
    (void)state;
    edge neighbour = upright, opposite;
    memcpy(opposite.p, upright.q, sizeof opposite.p);
    memcpy(opposite.q, upright.p, sizeof opposite.q);
    neighbour.p[0] += 8, neighbour.q[0] += 8;
    seed = 9;
    scan *s = new_scan();
    int merged = 0;
    for (int i = 0; i < 100; i++) {
        arris_pose pose = on_path(i, 100);
        add(s, i < 45 ? 0 : 3, &upright, &pose, &pose, 0.05);
        add(s, 1, &neighbour, &pose, &pose, 0.05);
        add(s, 2, &opposite, &pose, &pose, 0.05);
        scan_end_frame(s, true);
        arris_lines *lines = lines_of(s);
        for (uint32_t k = 0; k < lines->n; k++)
            if (lines->item[k].change == ARRIS_MERGED) {
                assert_int_equal(lines->item[k].id, 3);
                assert_int_equal(lines->item[k].into, 0);
                merged++;
            }
    }
    scan_finish(s);
    arris_lines *lines = lines_of(s);
    assert_int_equal(merged, 1);
    assert_int_equal(lines->n, 3);
    for (uint32_t k = 0; k < 3; k++) {
        assert_int_equal(lines->item[k].id, k);
        assert_int_equal(lines->item[k].state, ARRIS_MEASURED);
        assert_in_range(lines->item[k].views, 95, 100);
    }
    scan_free(s);
}

/* Notes what became of the lines, by id. */
static void note_merged(scan *s, int into[3]) {
    const arris_lines *lines = lines_of(s);
    for (uint32_t k = 0; k < lines->n; k++)
        if (lines->item[k].change == ARRIS_MERGED)
            into[lines->item[k].id] = lines->item[k].into;
}

/* Two edges of opposite polarity, 5 mm apart, from poses that are off by 0.4 mm: both are seen for
 * a while, then the one goes, and the track of the other breaks. */
static void see_neighbours(scan *s, int into[3]) {
    const double *p = upright.p, *q = upright.q;
    const edge opposite = {{q[0] + 3, q[1], q[2] + 4}, {p[0] + 3, p[1], p[2] + 4}};
    for (int i = 0; i < 60; i++) {
        arris_pose pose = on_path(i, 60), reported = pose;
        reported.C[0] += 0.4 * normal();
        if (i < 12)
            add(s, 0, &upright, &pose, &reported, 0.05);
        add(s, i < 30 ? 1 : 2, &opposite, &pose, &reported, 0.05);
        scan_end_frame(s, true);
        note_merged(s, into);
    }
    scan_finish(s);
    note_merged(s, into);
}

/* An edge may change its polarity, but what was seen beside another is not that one; and what is
 * known too badly to tell the two apart waits. */
static void neighbours_are_told_apart(void **state) {
    (void)state;
    const scan_params p = {.limit = -1, .pose_sigma = 0.4, .max_lines = MAX_LINES, .min_views = 4};
    for (uint64_t k = 0; k < 20; k++) {
        int into[3] = {-1, -1, -1};
        scan *s = scan_new(&p);
        seed = 41 + k;
        see_neighbours(s, into);
        assert_int_equal(into[1], -1);
        assert_int_equal(into[2], 1);
        scan_free(s);
    }
}

/* Edges that meet are two, however uncertain one of them is after a few views. */
static void meeting_edges_are_two(void **state) {
    (void)state;
    const scene rough = {.scale = 1, .memory = 4, .depth = 1000};
    line a, again, b;
    for (seed = 15; seed < 25; seed++) {
        fit_views(&a, &upright, 0.1, 0, 40);
        fit_views(&again, &upright, 0.1, 30, 60);
        assert_true(line_same(&a, &again, &rough, false) && line_same(&again, &a, &rough, false));
        edge other = upright; /* seen from view 12 it covers the edge, but it leans forward */
        arris_pose pose = on_path(12, 60);
        for (int i = 0; i < 3; i++)
            other.q[i] = pose.C[i] + 0.85 * (upright.q[i] - pose.C[i]);
        for (int n = 4; n < 20; n++) {
            fit_views(&b, &other, 0.3, 10, 10 + n);
            if (b.settled)
                assert_false(line_same(&a, &b, &rough, false) || line_same(&b, &a, &rough, false));
        }
    }
}

/* Ten sweeps there and back, every one with new tracks: the lines are those of the three edges, one
 * of them parallel to the motion. What is only glimpsed in a sweep is told of and retired. */
static void sweeps_fuse(void **state) {
    (void)state;
    const edge edges[3] = {
        upright, {{60, -60, 800}, {90, 60, 780}}, {{-50, 40, 750}, {80, 40, 750}}};
    int retired = 0, id = 0;
    seed = 14;
    scan *s = new_scan();
    for (int sweep = 0; sweep < 10; sweep++, id += 4)
        for (int i = 0; i < 60; i++) {
            arris_pose pose = on_path(sweep % 2 ? 59 - i : i, 60);
            for (int k = 0; k < 3; k++)
                add(s, id + k, &edges[k], &pose, &pose, 0.05);
            edge glimpse = {{-50, -80 + 9.0 * sweep, 700}, {80, -80 + 9.0 * sweep, 700}};
            if (i < 7)
                add(s, id + 3, &glimpse, &pose, &pose, 0.05);
            scan_end_frame(s, true);
            arris_lines *lines = lines_of(s);
            assert_sound(lines);
            for (uint32_t k = 0; k < lines->n; k++)
                retired += lines->item[k].change == ARRIS_RETIRED;
        }
    scan_finish(s);
    arris_lines *lines = lines_of(s);
    assert_true(lines->n >= 3);
    assert_int_equal(lines->lost, 0);
    for (uint32_t k = 0; k < 3; k++) {
        assert_int_equal(lines->item[k].id, k);
        assert_int_equal(lines->item[k].state, k < 2 ? ARRIS_MEASURED : ARRIS_UNOBSERVABLE);
    }
    for (uint32_t k = 3; k < lines->n; k++) {
        assert_int_equal(lines->item[k].change, ARRIS_MERGED);
        assert_int_equal(lines->item[k].into, 2);
    }
    assert_int_equal(retired, 10);
    scan_free(s);
}

/* An edge along the first sweep is told of but not measured; a sweep across it measures it. */
static void a_sweep_across_revives(void **state) {
    (void)state;
    const edge along = {{-60, 20, 750}, {70, 20, 750}};
    seed = 21;
    scan *s = new_scan();
    for (int i = 0; i < 60; i++) {
        arris_pose pose = on_path(i, 60);
        add(s, 0, &along, &pose, &pose, 0.05);
        scan_end_frame(s, true);
    }
    for (int i = 0; i < 10; i++)
        scan_end_frame(s, true);
    assert_int_equal(lines_of(s)->n, 1);
    assert_int_equal(lines_of(s)->item[0].state, ARRIS_UNOBSERVABLE);
    for (int i = 0; i < 60; i++) {
        arris_pose pose = pose_at(0, (i - 30) * 3.0, 0, 0, 0, 0);
        add(s, 1, &along, &pose, &pose, 0.05);
        scan_end_frame(s, true);
        assert_sound(lines_of(s));
    }
    scan_finish(s);
    int measured = 0;
    arris_lines *lines = lines_of(s);
    for (uint32_t k = 0; k < lines->n; k++)
        if (lines->item[k].change < ARRIS_MERGED) {
            assert_int_equal(lines->item[k].state, ARRIS_MEASURED);
            assert_true(off(&along, lines->item[k].p) < 1 && off(&along, lines->item[k].q) < 1);
            measured++;
        }
    assert_int_equal(measured, 1);
    scan_free(s);
}

/* A track that goes over to a parallel edge is two lines in the end, and each is where its edge is,
 * also when the noise of the poses hides it from the track alone. */
static void a_wrong_join_is_parted(void **state) {
    (void)state;
    edge other = upright;
    other.p[0] += 1.5, other.q[0] += 1.5; /* 0.8 px */
    for (int noisy = 0; noisy < 2; noisy++) {
        edge third = {{-90, -60, 800}, {-60, 60, 790}}, fourth = {{60, -70, 760}, {50, 60, 770}};
        scan *s = new_scan();
        seed = 22;
        for (int i = 0; i < 120; i++) {
            arris_pose pose = on_path(i, 120), reported = pose;
            for (int k = 0; k < 3; k++)
                reported.C[k] += noisy * 0.2 * normal();
            add(s, 0, i < 70 ? &upright : &other, &pose, &reported, 0.05);
            add(s, 1, &third, &pose, &reported, 0.05);
            add(s, 2, &fourth, &pose, &reported, 0.05);
            scan_end_frame(s, true);
        }
        scan_finish(s);
        const edge *edges[4] = {&upright, &third, &fourth, &other};
        arris_lines *lines = lines_of(s);
        assert_int_equal(lines->n, 4);
        for (int k = 0; k < 4; k++)
            assert_true(off(edges[k], lines->item[k].p) < 1 && off(edges[k], lines->item[k].q) < 1);
        assert_int_equal(lines->item[0].state, ARRIS_MEASURED);
        scan_free(s);
    }
}

/* The state of an upright edge by its uncertainty: in mm, or by 0.3 % of its distance. */
static void the_limit_decides(void **state) {
    (void)state;
    int before = 0;
    const double limit[] = {-1, 1000, 0.01, 0};
    for (int k = 0; k < 4; k++) {
        scan_params p = {.limit = limit[k], .max_lines = 4, .min_views = 4};
        scan *s = scan_new(&p);
        seed = 23;
        for (int i = 0; i < 60; i++) {
            arris_pose pose = on_path(i, 60);
            add(s, 0, &upright, &pose, &pose, 0.1);
            scan_end_frame(s, true);
        }
        assert_int_equal(lines_of(s)->item[0].state, k < 2 ? ARRIS_MEASURED : ARRIS_WEAK);
        scan_free(s);
    }
    for (int k = 0; k < 2; k++) { /* the same picture of the same world, twice as large */
        scan *s = new_scan();
        seed = 24;
        double size = k + 1;
        int measured = 0;
        edge e = upright;
        for (int i = 0; i < 3; i++)
            e.p[i] *= size, e.q[i] *= size;
        for (int i = 0; i < 60; i++) {
            arris_pose pose = on_path(i, 60);
            pose.C[0] *= size;
            add(s, 0, &e, &pose, &pose, 0.1);
            scan_end_frame(s, true);
            measured += lines_of(s)->n && lines_of(s)->item[0].state == ARRIS_MEASURED;
        }
        assert_in_range(measured, 10, 55);
        assert_true(k == 0 || abs(measured - before) <= 2);
        before = measured;
        scan_free(s);
    }
}

static void changes_are_told(void **state) {
    (void)state;
    int count[5] = {0};
    seed = 10;
    scan *s = new_scan();
    for (int i = 0; i < 120; i++) {
        arris_pose pose = on_path(i < 100 ? i : 99, 100);
        scan_add(s, 0, NULL);
        if (i < 100)
            add(s, 0, &upright, &pose, &pose, 0.05);
        scan_end_frame(s, true);
        arris_lines *lines = lines_of(s);
        for (uint32_t k = 0; k < lines->n; k++) {
            count[lines->item[k].change]++;
            assert_true(i < 100 || lines->item[k].change == ARRIS_SAME);
        }
    }
    assert_int_equal(count[ARRIS_ADDED], 1);
    assert_in_range(count[ARRIS_MOVED], 5, 60);
    assert_true(count[ARRIS_SAME] > 50);
    scan_free(s);
}

/* More edges than there is room for: the rest is counted, and what is measured stays. */
static void a_full_scan_counts(void **state) {
    (void)state;
    scan_params p = {.limit = -1, .max_lines = 4, .min_views = 4};
    scan *s = scan_new(&p);
    seed = 11;
    for (int i = 0; i < 60; i++) {
        arris_pose pose = on_path(i, 60);
        for (int k = 0; k < 7; k++) {
            edge e = upright;
            e.p[0] += 15 * k - 45, e.q[0] += 15 * k - 45;
            add(s, k, &e, &pose, &pose, 0.05);
        }
        scan_end_frame(s, true);
    }
    scan_finish(s);
    assert_int_equal(lines_of(s)->n, 4);
    assert_true(lines_of(s)->lost >= 3);
    scan_free(s);
}

/* ---- the noise of the poses --------------------------------------------------------------------
 */

/* Adds d' C^-1 d / 2 at the end p, d the distance across the line from the true edge. */
static void add_nees(const arris_line *l, const edge *e, double nees[2]) {
    double u[3], v[3], d[3], n[2][3], C[2][2] = {{0}}, r[2];
    static const int at[3][3] = {{0, 1, 2}, {1, 6, 7}, {2, 7, 11}};
    for (int i = 0; i < 3; i++)
        u[i] = l->q[i] - l->p[i], v[i] = e->q[i] - e->p[i];
    for (int i = 0; i < 3; i++) /* from p to the edge, within the plane across the line */
        d[i] =
            e->p[i] - l->p[i] + v[i] * (arris_dot(l->p, u) - arris_dot(e->p, u)) / arris_dot(v, u);
    arris_cross(u, (double[]){1, 0, 0}, n[0]);
    arris_cross(u, n[0], n[1]);
    for (int a = 0; a < 2; a++) {
        arris_unit(n[a]);
        r[a] = arris_dot(n[a], d);
    }
    for (int a = 0; a < 2; a++)
        for (int b = 0; b < 2; b++)
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++)
                    C[a][b] += n[a][i] * l->cov[at[i][j]] * n[b][j];
    double det = C[0][0] * C[1][1] - C[0][1] * C[1][0];
    nees[0] +=
        (C[1][1] * r[0] * r[0] - 2 * C[0][1] * r[0] * r[1] + C[0][0] * r[1] * r[1]) / det / 2;
    nees[1] += 1;
}

/* A scan of upright edges whose reported poses are off by sigma, correlated over frames by rho.
 * nees is the sum over the lines, and their number. */
static void scan_with_jitter(double sigma, double rho, double *found, double nees[2]) {
    enum { EDGES = 9, FRAMES = 100 };
    double d[3] = {0, 0, 0};
    scan *s = new_scan();
    edge e[EDGES];
    for (int k = 0; k < EDGES; k++)
        for (int i = 0; i < 3; i++)
            e[k].p[i] = upright.p[i] + (i ? 25.0 * (k % 3) : 40 * k - 160.0),
            e[k].q[i] = upright.q[i] + (i ? 25.0 * (k % 3) : 30 * k - 120.0);
    for (int i = 0; i < FRAMES; i++) {
        arris_pose pose = on_path(i, FRAMES), at = pose;
        for (int k = 0; k < 3; k++) {
            d[k] = rho * d[k] + sqrt(1 - rho * rho) * sigma * normal();
            at.C[k] += d[k];
        }
        for (int k = 0; k < EDGES; k++)
            add(s, k, &e[k], &at, &pose, 0.02);
        scan_end_frame(s, true);
    }
    scan_finish(s);
    arris_lines *lines = lines_of(s);
    *found = lines->pose_sigma;
    for (uint32_t n = 0; n < lines->n; n++)
        if (lines->item[n].state == ARRIS_MEASURED)
            add_nees(&lines->item[n], &e[lines->item[n].id], nees);
    scan_free(s);
}

static void pose_noise_is_estimated(void **state) {
    (void)state;
    double sum[4] = {0}, found, nees[4][2] = {{0}};
    const double sigma[4] = {0, 0.2, 0.2, 0.2}, rho[4] = {0, 0, 0.7, 0.9},
                 most[4] = {1.8, 1.8, 1.8, 2.8}; /* of many frames a scan has few values */
    seed = 12;
    for (int t = 0; t < 40; t++)
        for (int k = 0; k < 4; k++) {
            scan_with_jitter(sigma[k], rho[k], &found, nees[k]);
            sum[k] += found / 40;
        }
    for (int k = 0; k < 4; k++)
        print_message("    sigma %.2f mm, correlation %.1f: found %.3f mm, nees %.2f (%.0f)\n",
                      sigma[k], rho[k], sum[k], nees[k][0] / nees[k][1], nees[k][1]);
    assert_true(sum[0] < 0.02);
    assert_true(sum[1] > 0.16 && sum[1] < 0.24);
    assert_true(sum[2] > 0.14 && sum[2] < 0.24);
    for (int k = 0; k < 4; k++)
        assert_true(nees[k][0] / nees[k][1] > 0.5 && nees[k][0] / nees[k][1] < most[k]);
}

/* ---- segments ----------------------------------------------------------------------------------
 */

/* End points in the picture of a lens give the view that ideal ones give. */
static void a_lens_is_taken_out(void **state) {
    (void)state;
    arris_camera lens = camera;
    lens.k1 = -0.26, lens.k2 = 0.2, lens.p1 = 1e-3;
    arris_pose pose = on_arc(3, 20);
    arris_segment ideal, bent;
    view a, b;
    seed = 13;
    assert_true(detect(&upright, &pose, 0.01, 0, &ideal));
    bent = ideal;
    arris_distort(&lens, ideal.x1, ideal.y1, &bent.x1, &bent.y1);
    arris_distort(&lens, ideal.x2, ideal.y2, &bent.x2, &bent.y2);
    assert_int_equal(view_make(&a, &ideal, &camera, &pose, picture), 0);
    assert_int_equal(view_make(&b, &bent, &lens, &pose, picture), 0);
    for (int i = 0; i < 3; i++)
        assert_true(fabs(a.plane[i] - b.plane[i]) < 1e-6);
}

static void bad_segments_are_refused(void **state) {
    (void)state;
    arris_pose pose = on_path(0, 1);
    view v;
    arris_segment good = {.x1 = 10, .y1 = 10, .x2 = 100, .y2 = 50, .cov = {1e-4, 0, 1e-7}};
    assert_int_equal(view_make(&v, &good, &camera, &pose, picture), 0);
    for (int k = 0; k < 6; k++) {
        arris_segment s = good;
        double *field[] = {&s.x1, &s.y2, &s.cov[0], &s.cov[2], &s.cov[1], &s.x2};
        *field[k] = k < 5 ? (double)NAN : (double)INFINITY;
        assert_int_equal(view_make(&v, &s, &camera, &pose, picture), ARRIS_E_INPUT);
    }
    pose.C[1] = (double)NAN;
    assert_int_equal(view_make(&v, &good, &camera, &pose, picture), ARRIS_E_INPUT);
    pose.C[1] = 0;
    good.x2 = good.x1, good.y2 = good.y1;
    assert_int_equal(view_make(&v, &good, &camera, &pose, picture), ARRIS_E_INPUT);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(exact_planes_give_the_line),
        cmocka_unit_test(two_views_give_the_line),
        cmocka_unit_test(errors_are_honest_and_at_the_bound),
        cmocka_unit_test(views_at_once_are_each),
        cmocka_unit_test(incremental_is_batch),
        cmocka_unit_test(outliers_are_left_out),
        cmocka_unit_test(the_run_that_agrees_is_the_line),
        cmocka_unit_test(what_looks_different_is_dropped),
        cmocka_unit_test(misfit_does_not_average_out),
        cmocka_unit_test(the_absorbed_keep_the_noise_of_poses),
        cmocka_unit_test(parallel_motion_is_refused),
        cmocka_unit_test(few_views_claim_nothing),
        cmocka_unit_test(standing_still_is_unobservable),
        cmocka_unit_test(ends_are_where_the_edge_ends),
        cmocka_unit_test(pieces_are_of_one_edge),
        cmocka_unit_test(one_line_per_edge),
        cmocka_unit_test(neighbours_are_told_apart),
        cmocka_unit_test(meeting_edges_are_two),
        cmocka_unit_test(sweeps_fuse),
        cmocka_unit_test(a_sweep_across_revives),
        cmocka_unit_test(a_wrong_join_is_parted),
        cmocka_unit_test(the_limit_decides),
        cmocka_unit_test(changes_are_told),
        cmocka_unit_test(a_full_scan_counts),
        cmocka_unit_test(pose_noise_is_estimated),
        cmocka_unit_test(a_lens_is_taken_out),
        cmocka_unit_test(bad_segments_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
