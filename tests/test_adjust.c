/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_adjust.c: lines and poses together: derivatives against finite differences, the ways to
 * factor against each other, the selected inverse against the whole one, and what a scan does not
 * tell.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <math.h>

#include "adjust/adjust.h"
#include "adjust/input.h"
#include "adjust/record.h"
#include "drawn_scan.h"

/* ---- derivatives ----------------------------------------------------------------------------- */

static void residuals_have_their_derivatives(void **unused) {
    (void)unused;
    scan_plan plan = {12, 8, 30, 0.5, 5e-2, 0.05, false};
    record r;
    arris_lines lines = {0};
    adj_problem p;
    state = 7;
    simulate(&plan, &r, &lines);
    make_problem(&r, &lines, &p);
    adj_set_common(&p, ADJ_LENS);
    assert_true(p.n_views > 20);
    for (uint32_t i = 0; i < p.n_views; i++) {
        const adj_view *v = &p.view[i];
        double r0[2], Jp[2][6], Jl[2][4], Jc[2][ADJ_LENS_TERMS], lo[2], hi[2];
        adj_pose pose = p.frame[v->frame].pose;
        adj_line line = p.line[v->line];
        memcpy(pose.R, sim.pose[v->frame].R, sizeof pose.R);
        assert_true(adj_residual(&p, v, &pose, &line, r0, Jp, Jl));
        adj_residual_lens(&p, v, &pose, &line, Jc);
        for (int k = 0; k < 14; k++) {
            double h = k < 3 ? 1e-3 : k < 6 ? 1e-6 : 1e-3, d[6] = {0};
            for (int side = -1; side <= 1; side += 2) {
                adj_pose moved = pose;
                adj_line shifted = line;
                if (k < 6)
                    d[k] = side * h, adj_pose_move(&moved, d);
                else if (k < 10)
                    shifted.x[k - 6] += side * h;
                else
                    p.state[k - 10] = side * h;
                assert_true(adj_residual(&p, v, &moved, &shifted, side < 0 ? lo : hi, NULL, NULL));
                memset(p.state, 0, sizeof p.state);
            }
            for (int q = 0; q < 2; q++) {
                double J = k < 6 ? Jp[q][k] : k < 10 ? Jl[q][k - 6] : Jc[q][k - 10];
                double found = (hi[q] - lo[q]) / (2 * h);
                assert_true(fabs(found - J) < 1e-5 * (1 + fabs(J)));
            }
        }
    }
    adj_free(&p);
    record_free(&r);
    free(lines.item);
}

static void errors_have_their_derivatives(void **unused) {
    (void)unused;
    scan_plan plan = {6, 3, 30, 0, 0, 0.05, false};
    record r;
    arris_lines lines = {0};
    adj_problem p;
    state = 9;
    simulate(&plan, &r, &lines);
    make_problem(&r, &lines, &p);
    adj_set_common(&p, ADJ_SCALE | ADJ_DRIFT | ADJ_HAND_EYE | ADJ_DELAY | ADJ_LENS);
    assert_int_equal(adj_n_common(&p), ADJ_COMMON);
    double turn[6] = {1, 2, 3, 0.1, -0.2, 0.15}, e[6], J[9], G[6][ADJ_COMMON], h = 1e-6;
    adj_pose_move(&p.frame[2].pose, turn);
    adj_error(&p, 2, e, J, G);
    for (int k = 0; k < 6; k++)
        assert_near(e[k], turn[k], 1e-9);
    for (int k = 0; k < 3; k++) {
        double d[6] = {0}, lo[6], hi[6];
        adj_pose was = p.frame[2].pose;
        d[3 + k] = h, adj_pose_move(&p.frame[2].pose, d), adj_error(&p, 2, hi, NULL, NULL);
        p.frame[2].pose = was;
        d[3 + k] = -h, adj_pose_move(&p.frame[2].pose, d), adj_error(&p, 2, lo, NULL, NULL);
        p.frame[2].pose = was;
        for (int i = 0; i < 3; i++)
            assert_near((hi[3 + i] - lo[3 + i]) / (2 * h), J[3 * i + k], 1e-6);
    }
    for (int k = 0; k < ADJ_COMMON; k++) {
        double moved[6];
        p.state[k] = h, adj_error(&p, 2, moved, NULL, NULL), p.state[k] = 0;
        for (int i = 0; i < 6; i++)
            assert_near((moved[i] - e[i]) / h, -G[i][k], 1e-5 * (1 + fabs(G[i][k])));
    }
    adj_free(&p);
    record_free(&r);
    free(lines.item);
}

/* ---- the solution ---------------------------------------------------------------------------- */

/* All back ends, with common states and without, find the same; at it the cost has no slope. */
static void back_ends_agree(void **unused) {
    (void)unused;
    const adj_backend *backend[2] = {&adj_cholmod, &adj_eigen};
    scan_plan plan = {25, 12, 12, 0.2, 2e-4, 0.02, false};
    record r;
    arris_lines lines = {0};
    state = 3;
    simulate(&plan, &r, &lines);
    for (unsigned common = 0; common <= 31; common += 31) {
        double cost[2], place[2][3], cov[2][16];
        for (int b = 0; b < 2; b++) {
            adj_problem p;
            make_problem(&r, &lines, &p);
            adj_set_common(&p, common);
            double before = adj_cost(&p);
            adj_work *w = adj_work_new(&p, backend[b]);
            assert_non_null(w);
            assert_true(adj_minimise(&p, w, 50, 1e-12) > 0);
            cost[b] = adj_cost(&p);
            assert_true(cost[b] < before / 5);
            memcpy(place[b], p.frame[3].pose.C, sizeof place[b]);
            assert_int_equal(adj_marginals(&p, w), 0);
            adj_line_covariance(w, 2, cov[b]);
            for (int k = 0; k < 6; k++) {
                double d[6] = {0}, h = k < 3 ? 1e-4 : 1e-7;
                adj_pose was = p.frame[5].pose;
                d[k] = h, adj_pose_move(&p.frame[5].pose, d);
                double hi = adj_cost(&p);
                p.frame[5].pose = was;
                d[k] = -h, adj_pose_move(&p.frame[5].pose, d);
                double lo = adj_cost(&p), bend = (hi + lo - 2 * cost[b]);
                p.frame[5].pose = was;
                assert_true(bend > 0 && fabs(hi - lo) < 0.02 * bend);
            }
            adj_work_free(w);
            adj_free(&p);
        }
        assert_near(cost[1], cost[0], 1e-6 * cost[0]);
        for (int k = 0; k < 3; k++)
            assert_near(place[1][k], place[0][k], 1e-6);
        for (int k = 0; k < 16; k++)
            assert_near(cov[1][k], cov[0][k], 1e-6 * fabs(cov[0][5 * (k / 5)]) + 1e-12);
    }
    record_free(&r);
    free(lines.item);
}

enum { N = 40 };

/* A band with a border. */
static adj_matrix make_matrix(void) {
    static int ptr[N + 1], row[N * N], order[N];
    static double val[N * N];
    int n = 0;
    for (int j = 0; j < N; j++) {
        ptr[j] = n;
        for (int i = 0; i <= j; i++)
            if (i == j || j - i < 4 || j == N - 1)
                row[n] = i, val[n++] = i == j ? 10 + i : sin(i + 3 * j);
        order[j] = (7 * j) % N; /* any will do */
    }
    ptr[N] = n;
    return (adj_matrix){N, ptr, row, order, val};
}

/* With the factor of a matrix that is near, what is left of the error is what was asked for. */
static void an_old_factor_solves(void **unused) {
    (void)unused;
    adj_matrix A = make_matrix();
    adj_solver *s = adj_cholmod.create();
    adj_factor f;
    double b[N], x[N], exact[N], work[ADJ_CONJUGATE * N], shares[3] = {1e-1, 1e-3, 1e-9};
    int turns[3];
    assert_int_equal(adj_cholmod.analyse(s, &A), 0);
    for (int j = 0; j < N; j++)
        b[j] = cos(j);
    for (int k = 0; k < 3; k++) {
        A = make_matrix();
        assert_int_equal(adj_cholmod.factor(s, &A, &f), 0);
        for (int j = 0; j < N; j++)
            A.val[A.ptr[j + 1] - 1] *= 1.5 + sin(7 * j);
        turns[k] = adj_conjugate(&A, &f, b, x, N, shares[k], work);
        assert_int_equal(adj_conjugate(&A, &f, b, exact, turns[k] - 1, shares[k], work), 0);
        assert_int_equal(adj_cholmod.factor(s, &A, &f), 0);
        adj_factor_solve(&f, b, exact, work);
        double all = 0, gained = 0;
        for (int j = 0; j < N; j++)
            all += b[j] * exact[j], gained += b[j] * x[j];
        assert_true(gained < all * (1 + 1e-12) && gained > all * (1 - 10 * shares[k]));
    }
    assert_true(turns[0] > 0 && turns[1] > turns[0] && turns[2] > turns[1]);
    adj_cholmod.free(s);
}

/* The entries that are computed are those of the whole inverse. */
static void selected_inverse_is_the_inverse(void **unused) {
    (void)unused;
    int place[N];
    double work[N], b[N], x[N], *inverse = calloc(N * N, sizeof *inverse);
    adj_matrix A = make_matrix();
    for (int j = 0; j < N; j++)
        place[j] = -1;
    const adj_backend *backend[2] = {&adj_cholmod, &adj_eigen};
    for (int k = 0; k < 2; k++) {
        adj_solver *s = backend[k]->create();
        adj_factor f;
        assert_int_equal(backend[k]->analyse(s, &A), 0);
        assert_int_equal(backend[k]->factor(s, &A, &f), 0);
        adj_factor_invert(&f, inverse, place, work);
        for (int j = 0; j < N; j++) {
            memset(b, 0, sizeof b);
            b[f.perm[j]] = 1;
            adj_factor_solve(&f, b, x, work);
            for (int m = f.ptr[j]; m < f.ptr[j] + f.nz[j]; m++)
                assert_near(inverse[m], x[f.perm[f.row[m]]], 1e-12);
        }
        A.val[A.ptr[6 + 1] - 1] = -1; /* not positive definite any more */
        assert_int_equal(backend[k]->factor(s, &A, &f), ARRIS_E_INPUT);
        A = make_matrix();
        backend[k]->free(s);
    }
    free(inverse);
}

/* ---- what a scan does not tell --------------------------------------------------------------- */

static void all_finite(const arris_lines *lines) {
    for (uint32_t i = 0; i < lines->n; i++) {
        for (int k = 0; k < 21; k++)
            assert_true(isfinite(lines->item[i].cov[k]));
        for (int k = 0; k < 3; k++)
            assert_true(isfinite(lines->item[i].p[k] + lines->item[i].q[k]));
    }
}

static void what_is_not_told_is_said(void **unused) {
    (void)unused;
    const scan_plan plan[] = {{30, 1, 9, 0.1, 0, 0.02, false},
                              {2, 12, 9, 0.1, 0, 0.02, false},
                              {30, 12, 9, 0.1, 1e-4, 0.02, true},
                              {30, 8, 0, 0, 0, 0.02, false},
                              {30, 8, 9, 0, 0, 0, false}};
    for (size_t k = 0; k < sizeof plan / sizeof *plan; k++) {
        adjust_params params = {.robust = 4, .backend = &adj_cholmod};
        record r;
        arris_lines lines = {0};
        adjusted result;
        state = 11 + k;
        simulate(&plan[k], &r, &lines);
        int rc = record_adjust(&r, &lines, &params, &result);
        print_message("scan %zu: %d, not determined: %s\n", k, rc, result.undetermined);
        all_finite(&lines);
        if (k < 4)
            assert_true(*result.undetermined);
        free_scan(&r, &lines, &result);
    }
}

/* ---- files ----------------------------------------------------------------------------------- */

static void lines_are_read_and_refused(void **unused) {
    (void)unused;
    static const char good[] =
        "{\"format\": \"arris-lines/1\", \"frames\": 9, \"lines\": [{\"id\": 4, \"p\": [1,2,3], "
        "\"q\": [4,5,6], \"views\": 7, \"state\": \"weak\", \"cov\": null}]}";
    static const char *const bad[] = {
        "",
        "{",
        "[]",
        "{\"format\": \"arris-lines/1\"}",
        "{\"format\": \"arris-lines/1\", \"lines\": [{}]}",
        "{\"format\": \"arris-lines/1\", \"lines\": [{\"id\": 1, \"p\": [1,2], \"q\": [1,2,3], "
        "\"state\": \"weak\", \"cov\": null}]}"};
    arris_lines lines = {0};
    fault f;
    assert_int_equal(input_lines(good, sizeof good - 1, "x", &lines, &f), 0);
    assert_int_equal(lines.n, 1);
    assert_int_equal(lines.item[0].id, 4);
    assert_int_equal(lines.item[0].state, ARRIS_WEAK);
    free(lines.item);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        memset(&lines, 0, sizeof lines);
        assert_int_equal(input_lines(bad[i], strlen(bad[i]), "x", &lines, &f), ARRIS_E_INPUT);
        free(lines.item);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(residuals_have_their_derivatives),
        cmocka_unit_test(errors_have_their_derivatives),
        cmocka_unit_test(back_ends_agree),
        cmocka_unit_test(an_old_factor_solves),
        cmocka_unit_test(selected_inverse_is_the_inverse),
        cmocka_unit_test(what_is_not_told_is_said),
        cmocka_unit_test(lines_are_read_and_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
