/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_window.c: the fixed lag of adjust: what it finds beside the adjustment of the whole, how
 * true its covariances are, what odd scans do to it, and that threads do nothing to it.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <math.h>

#include "adjust/window.h"
#include "drawn_scan.h"
#include "process.h"
#include "scratch.h"

enum { MANY = 400 };

/* The sightings of a frame go into the window. */
static void add_frame(window *w, const record *r, uint32_t frame) {
    window_frame(w, &r->frame[frame].pose);
    for (uint32_t i = 0; i < r->n; i++) {
        const sighting *o = &r->item[i];
        if (o->frame != frame)
            continue;
        arris_segment s = {.x1 = o->x1,
                           .y1 = o->y1,
                           .x2 = o->x2,
                           .y2 = o->y2,
                           .cov = {(double)o->cov[0], (double)o->cov[1], (double)o->cov[2]}};
        window_add(w, o->track, &s, &camera);
    }
}

/* What the window makes of the running lines, in `out`, which has room for MANY. */
static void adjust(window *w, const arris_lines *running, arris_lines *out) {
    arris_line *item = out->item;
    memcpy(item, running->item, running->n * sizeof *item);
    *out = *running;
    out->item = item;
    window_adjust(w, out);
}

static window *begin(uint32_t frames, double position, double rotation) {
    window_params p = {frames, position, rotation, 4};
    window *w = window_new(&p, &camera, MANY);
    assert_non_null(w);
    return w;
}

/* Distance of the ends of two lines across the second, in sigmas of that. */
static double apart(const arris_line *a, const arris_line *b) {
    static const int diagonal[6] = {0, 6, 11, 15, 18, 20};
    double most = 0, u[3];
    for (int k = 0; k < 3; k++)
        u[k] = b->q[k] - b->p[k];
    arris_unit(u);
    for (int end = 0; end < 2; end++) {
        const double *x = end ? a->q : a->p, *y = end ? b->q : b->p;
        double d[3] = {x[0] - y[0], x[1] - y[1], x[2] - y[2]}, along = arris_dot(d, u), sum = 0;
        double variance = 0;
        for (int k = 0; k < 3; k++) {
            sum += (d[k] - along * u[k]) * (d[k] - along * u[k]);
            variance += b->cov[diagonal[3 * end + k]];
        }
        most = fmax(most, sqrt(sum / variance));
    }
    return most;
}

/* ---- what comes of it ------------------------------------------------------------------------ */

/* All frames in the window, it is the adjustment of the whole; with few, nearly. */
static void the_past_is_kept(void **unused) {
    (void)unused;
    static arris_line item[2][MANY];
    scan_plan plan = {40, 12, 10, 0.2, 2e-4, 0.02, false};
    adjust_params params = {
        .pose_sigma = 0.2, .rot_sigma = 2e-4, .robust = 4, .backend = &adj_cholmod};
    adjusted result;
    record r;
    arris_lines lines = {0}, out[2] = {{.item = item[0]}, {.item = item[1]}};
    state = 5;
    simulate(&plan, &r, &lines);
    for (int k = 0; k < 2; k++) {
        window *w = begin(k ? 8 : plan.frames, 0.2, 2e-4);
        for (uint32_t i = 0; i < plan.frames; i++) {
            add_frame(w, &r, i);
            adjust(w, &lines, &out[k]);
        }
        for (int i = 0; i < 5; i++)
            adjust(w, &lines, &out[k]);
        window_free(w);
    }
    assert_int_equal(record_adjust(&r, &lines, &params, &result), 0);
    record_adjusted_free(&result);
    double most[2] = {0, 0};
    for (uint32_t l = 0; l < lines.n; l++)
        for (int k = 0; k < 2; k++) {
            double ratio = out[k].item[l].cov[11] / lines.item[l].cov[11];
            most[k] = fmax(most[k], apart(&out[k].item[l], &lines.item[l]));
            assert_true(ratio > 0.5 && ratio < 2);
        }
    print_message("farthest from the whole, sigmas: %.3f, of 8 frames %.3f\n", most[0], most[1]);
    assert_true(most[0] < 0.3 && most[1] < 0.6);
    record_free(&r);
    free(lines.item);
}

/* The noise is unknown, and at each of some lengths of the scan the covariances are true. */
static void covariances_are_true(void **unused) {
    (void)unused;
    static arris_line item[MANY];
    enum { SCANS = 12, STEPS = 4 };
    scan_plan plan = {80, 14, 6, 0.2, 2e-4, 0.02, false};
    double nees[STEPS] = {0}, n[STEPS] = {0}, sigma = 0;
    for (int scan = 0; scan < SCANS; scan++) {
        record r;
        arris_lines lines = {0}, out = {.item = item};
        window *w = begin(16, 0, 0);
        state = 100 + (uint64_t)scan;
        simulate(&plan, &r, &lines);
        for (uint32_t i = 0; i < plan.frames; i++) {
            add_frame(w, &r, i);
            adjust(w, &lines, &out);
            for (uint32_t l = 0; i % 20 == 19 && l < lines.n; l++)
                if (memcmp(out.item[l].p, lines.item[l].p, sizeof lines.item[l].p) != 0) {
                    nees[i / 20] += nees_of(&out.item[l], l);
                    n[i / 20]++;
                }
        }
        sigma += out.pose_sigma / SCANS;
        window_free(w);
        record_free(&r);
        free(lines.item);
    }
    for (int k = 0; k < STEPS; k++) {
        print_message("after %d frames: nees %.2f of %.0f\n", 20 * k + 20, nees[k] / n[k], n[k]);
        assert_true(n[k] > 2 * SCANS && nees[k] > 0.4 * n[k] && nees[k] < 2.5 * n[k]);
    }
    assert_near(sigma, plan.position, 0.15 * plan.position);
}

/* A pose that is wrong does no harm. */
static void a_wrong_pose_is_weighed_down(void **unused) {
    (void)unused;
    static arris_line item[2][MANY];
    scan_plan plan = {60, 14, 8, 0.1, 1e-4, 0.02, false};
    arris_lines lines = {0}, out[2] = {{.item = item[0]}, {.item = item[1]}};
    record r;
    state = 9;
    simulate(&plan, &r, &lines);
    for (int k = 0; k < 2; k++) {
        window *w = begin(16, 0, 0);
        r.frame[30].pose.C[0] += k ? 5 : 0;
        for (uint32_t i = 0; i < plan.frames; i++) {
            add_frame(w, &r, i);
            adjust(w, &lines, &out[k]);
        }
        window_free(w);
    }
    for (uint32_t l = 0; l < lines.n; l++)
        assert_true(apart(&out[1].item[l], &out[0].item[l]) < 1);
    record_free(&r);
    free(lines.item);
}

/* ---- odd scans ------------------------------------------------------------------------------- */

static void all_finite(const arris_lines *l) {
    for (uint32_t i = 0; i < l->n; i++) {
        double sum = 0;
        for (int k = 0; k < 21; k++)
            sum += l->item[i].cov[k] + l->item[i].p[k % 3] + l->item[i].q[k % 3];
        assert_true(isfinite(sum) && isfinite(l->item[i].rms));
    }
}

/* More lines and segments than find room; some merged, some retired, some back again. */
static void crowds_come_and_go(void **unused) {
    (void)unused;
    static arris_line item[MANY];
    scan_plan plan = {60, 300, 12, 0.2, 2e-4, 0.02, false};
    record r;
    arris_lines lines = {0}, out = {.item = item};
    window *w = begin(8, 0, 0);
    state = 7;
    simulate(&plan, &r, &lines);
    adjust(w, &lines, &out); /* before there is a frame */
    all_finite(&out);
    for (uint32_t i = 0; i < plan.frames; i++) {
        arris_lines some = lines;
        for (uint32_t l = 0; l < lines.n; l++) {
            arris_line *o = &lines.item[l];
            o->change = (l + i) % 50 == 0 ? ARRIS_RETIRED : ARRIS_SAME;
            o->change = (l + i) % 70 == 1 ? ARRIS_MERGED : o->change;
            o->into = o->change == ARRIS_MERGED ? (int32_t)((l + 1) % lines.n) : -1;
        }
        some.n = lines.n - i % 7 * 20;
        if (i % 9 != 8)
            add_frame(w, &r, i);
        adjust(w, &some, &out);
        all_finite(&out);
    }
    window_free(w);
    record_free(&r);
    free(lines.item);
}

/* One line; a camera that stands still; lines all parallel, a line that is a point. */
static void little_is_told(void **unused) {
    (void)unused;
    static arris_line item[MANY];
    const scan_plan plans[] = {{40, 1, 10, 0.2, 2e-4, 0.02, false},
                               {40, 8, 0, 0, 0, 0.02, false},
                               {40, 8, 10, 0.2, 2e-4, 0.02, true},
                               {40, 8, 10, 0, 0, 1e-6, false}};
    for (size_t k = 0; k < sizeof plans / sizeof *plans; k++) {
        record r;
        arris_lines lines = {0}, out = {.item = item};
        window *w = begin(8, 0, 0);
        state = 3;
        simulate(&plans[k], &r, &lines);
        if (k == 3)
            memcpy(lines.item[2].q, lines.item[2].p, sizeof lines.item[2].q);
        for (uint32_t i = 0; i < plans[k].frames; i++) {
            add_frame(w, &r, i);
            adjust(w, &lines, &out);
            all_finite(&out);
        }
        window_free(w);
        record_free(&r);
        free(lines.item);
    }
}

/* ---- the stage ------------------------------------------------------------------------------- */

static char *running_lines(const char *rest) {
    char box[PATH_MAX], line[2 * PATH_MAX];
    if (!realpath("samples/box/frames.csv", box))
        fail_msg("samples/box is not there: run from the root of the checkout");
    snprintf(line, sizeof line, "imagesrc location=%s ! edges ! undistort ! segments ! track ! %s",
             box, rest);
    process p = arris_launch(scratch("."), line);
    if (p.code)
        fail_msg("'%s' ends with %d and says:\n%s", line, p.code, p.err);
    process_free(&p);
    return file_text(scratch("lines"));
}

/* The same bytes with and without threads, other ones without a window. */
static void threads_do_not_matter(void **unused) {
    (void)unused;
    char *one = running_lines("reconstruct ! adjust window=8 ! testlines location=lines");
    char *two = running_lines("queue ! reconstruct ! queue ! adjust window=8 ! queue ! testlines "
                              "location=lines");
    char *none = running_lines("reconstruct ! adjust window=0 ! testlines location=lines");
    char *before = running_lines("reconstruct ! testlines location=lines");
    assert_true(strlen(one) > 1000);
    assert_string_equal(one, two);
    assert_string_equal(none, before);
    assert_string_not_equal(one, none);
    free(one), free(two), free(none), free(before);
}

int main(void) {
    scratch_mkdir("plugins");
    scratch_link("plugins/lines.so", "tests/plugins/lines.so");
    setenv("ARRIS_PLUGIN_PATH", scratch("plugins"), 1);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_past_is_kept),
        cmocka_unit_test(covariances_are_true),
        cmocka_unit_test(a_wrong_pose_is_weighed_down),
        cmocka_unit_test(crowds_come_and_go),
        cmocka_unit_test(little_is_told),
        cmocka_unit_test(threads_do_not_matter),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
