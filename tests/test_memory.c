/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_memory.c: how the poses' noise hangs together, of noise that is drawn: rough, as an
 * autoregressive process of the first order, and smooth, as white noise behind a Gaussian.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "../plugins/reconstruct/memory.h"
#include "views.h"

enum { FRAMES = 100, LINES = 5, DRAWS = 60 };
static const double SIGMA = 0.3; /* mm, of the positions along the motion */

/* Unit variance, a correlation of 0.8 from frame to frame. */
static void draw_rough(double e[FRAMES]) {
    const double rho = 0.8;
    e[0] = normal();
    for (int i = 1; i < FRAMES; i++)
        e[i] = rho * e[i - 1] + sqrt(1 - rho * rho) * normal();
}

/* Unit variance, a correlation of exp(-k² / (4 * 2.4²)) over k frames: 0.96, over five 0.34. */
static void draw_smooth(double e[FRAMES]) {
    enum { REACH = 10 };
    double white[FRAMES + 2 * REACH], squares = 0;
    for (int i = 0; i < FRAMES + 2 * REACH; i++)
        white[i] = normal();
    for (int k = -REACH; k <= REACH; k++)
        squares += exp(-k * k / (2.4 * 2.4));
    for (int i = 0; i < FRAMES; i++) {
        e[i] = 0;
        for (int k = -REACH; k <= REACH; k++)
            e[i] += exp(-k * k / (2 * 2.4 * 2.4)) * white[i + REACH + k] / sqrt(squares);
    }
}

static edge edge_of(int k) {
    return (edge){{-60 + 30 * k, -90, 700 + 20 * k}, {-65 + 30 * k, 80, 690}};
}

/* A line by the poses as they are reported, off by e. The third is not seen for 12 frames. */
static void fit(line *l, int k, const double e[FRAMES], const scene *s) {
    edge of = edge_of(k);
    linear r;
    line_begin(l, k);
    for (int i = 0; i < FRAMES; i++) {
        arris_pose truth = on_path(i, FRAMES), pose = truth;
        arris_segment g;
        view v;
        if (!detect(&of, &truth, 0.03, 0, &g) || (k == 2 && i >= 40 && i < 52))
            continue;
        pose.C[0] += SIGMA * e[i];
        assert_int_equal(view_make(&v, &g, &camera, &pose, picture), 0);
        v.frame = (uint32_t)i;
        line_add(l, &v, s, &r);
    }
    line_complete(l, s);
    assert_true(l->settled && l->n_kept < l->seen);
}

/* The mean weight of the smooth memories, which are every second one; *nees of the lines' ends. */
static double draw_all(void draw(double e[FRAMES]), double *nees) {
    static line l[LINES];
    const double ends[2] = {-1, 1};
    double smooth = 0;
    *nees = 0;
    seed = 1;
    for (int t = 0; t < DRAWS; t++) {
        scene s = known;
        double e[FRAMES];
        s.noise.position = SIGMA;
        draw(e);
        memory_begin(&s.memories);
        for (int k = 0; k < LINES; k++) {
            fit(&l[k], k, e, &s);
            memory_add(&s.memories, &l[k], &s);
        }
        memory_end(&s.memories);
        assert_true(s.memories.known);
        for (int k = 1; k < MEMORIES; k += 2)
            smooth += s.memories.weight[k] / DRAWS;
        for (int k = 0; k < LINES; k++) {
            edge of = edge_of(k);
            double d[4];
            mat4 inverse;
            line_weigh(&l[k], &s);
            error_of(&l[k], &of, d);
            mat4 P = line_covariance(&l[k], &s, l[k].prior, ends);
            assert_true(mat4_invert(&P, &inverse));
            *nees += mat4_form(&inverse, d, d) / 4 / (DRAWS * LINES);
        }
    }
    print_message("    smooth %.2f, nees %.2f\n", smooth, *nees);
    return smooth;
}

static void the_likelihood_tells_smooth_from_rough(void **state) {
    (void)state;
    double nees[2];
    double rough = draw_all(draw_rough, &nees[0]), smooth = draw_all(draw_smooth, &nees[1]);
    assert_true(rough < 0.5 && smooth > 0.9);
    for (int k = 0; k < 2; k++)
        assert_true(nees[k] > 0.6 && nees[k] < 1.4);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_likelihood_tells_smooth_from_rough),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
