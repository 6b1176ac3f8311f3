/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_geometry.c: the camera model, the rotation of eq. 2.7, projection and planes, against
 * formulas written down a second time and against geometry that is known.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "arris_geometry.h"

#define NEAR(a, b, tol) assert_true(fabs((a) - (b)) <= (tol))

static const arris_camera box = {320,       240,      380.60892, 378.42038, 0.05367, 153.27998,
                                 119.84683, -0.25888, 0.36657,   0.0011,    5e-05,   0};
/* the corners are bent by more than a hundred pixels */
static const arris_camera heavy = {1280,  960,   900,  880,  12.5,    652.2,
                                   470.1, -0.42, 0.25, 2e-3, -1.5e-3, -0.03};
static const arris_camera pincushion = {640, 480, 500, 510,  -3,   300,
                                        250, 0.3, 0.1, 1e-3, 1e-3, 0.05};

/* ---- camera --------------------------------------------------------------------------------- */

/* Bouguet's page "Description of the calibration parameters", line by line. */
static void bouguet(const arris_camera *c, double xn, double yn, double *xp, double *yp) {
    double kc[5] = {c->k1, c->k2, c->p1, c->p2, c->k3}, alpha = c->skew / c->fx;
    double r = sqrt(xn * xn + yn * yn);
    double f = 1 + kc[0] * pow(r, 2) + kc[1] * pow(r, 4) + kc[4] * pow(r, 6);
    double dx = 2 * kc[2] * xn * yn + kc[3] * (r * r + 2 * xn * xn);
    double dy = kc[2] * (r * r + 2 * yn * yn) + 2 * kc[3] * xn * yn;
    double xd = f * xn + dx, yd = f * yn + dy;
    *xp = c->fx * (xd + alpha * yd) + c->cx;
    *yp = c->fy * yd + c->cy;
}

static void distort_is_bouguets(void **state) {
    (void)state;
    const arris_camera *cameras[] = {&box, &heavy, &pincushion};
    for (int k = 0; k < 3; k++)
        for (double yn = -0.6; yn < 0.6; yn += 0.07)
            for (double xn = -0.7; xn < 0.7; xn += 0.07) {
                const arris_camera *c = cameras[k];
                double u, v, xp, yp;
                arris_distort(c, c->fx * xn + c->skew * yn + c->cx, c->fy * yn + c->cy, &u, &v);
                bouguet(c, xn, yn, &xp, &yp);
                NEAR(u, xp, 1e-9);
                NEAR(v, yp, 1e-9);
            }
}

static void undistort_inverts(void **state) {
    (void)state;
    const arris_camera *cameras[] = {&box, &heavy, &pincushion};
    for (int k = 0; k < 3; k++) {
        const arris_camera *c = cameras[k];
        double moved = 0;
        for (int v = 0; v < c->height; v += 7)
            for (int u = 0; u < c->width; u += 7) {
                double x, y, u2, v2;
                assert_int_equal(arris_undistort(c, u, v, &x, &y), 0);
                arris_distort(c, x, y, &u2, &v2);
                NEAR(u2, u, 1e-9);
                NEAR(v2, v, 1e-9);
                moved = fmax(moved, hypot(x - u, y - v));
            }
        assert_true(moved > 2); /* the lens does bend this picture */
    }
}

/* The other way round proves that it is the inverse on the right side of the fold. */
static void undistort_finds_the_point_that_was_distorted(void **state) {
    (void)state;
    for (int y = -40; y < 1000; y += 13)
        for (int x = -60; x < 1340; x += 13) {
            double u, v, x2, y2;
            arris_distort(&heavy, x, y, &u, &v);
            assert_int_equal(arris_undistort(&heavy, u, v, &x2, &y2), 0);
            NEAR(x2, x, 1e-8);
            NEAR(y2, y, 1e-8);
        }
}

/* k1 alone folds at r = sqrt(-1/(3 k1)): distorted radii above 2/3 of that have no inverse. k2 lets
 * this model rise again further out, where a false one would be found. */
static void undistort_refuses_beyond_the_fold(void **state) {
    (void)state;
    arris_camera c = {640, 480, 300, 300, 0, 320, 240, -0.4, 0.06, 0, 0, 0};
    double fold = INFINITY;
    for (double r = 0; r < 3 && isinf(fold); r += 1e-4)
        if (1 + 3 * c.k1 * r * r + 5 * c.k2 * pow(r, 4) <= 0)
            fold = r;
    assert_true(isfinite(fold));
    double rd = fold * (1 + c.k1 * fold * fold + c.k2 * pow(fold, 4)), x, y;
    assert_int_equal(arris_undistort(&c, 320 + 300 * rd * 0.999, 240, &x, &y), 0);
    assert_true((x - 320) / 300 < fold);
    for (double r = 0; r < 0.9999 * fold; r += fold / 2000) {
        double u = 320 + 300 * r * (1 + c.k1 * r * r + c.k2 * pow(r, 4));
        assert_int_equal(arris_undistort(&c, u, 240, &x, &y), 0);
        NEAR(x, 320 + 300 * r, 1e-6);
    }
    assert_int_equal(arris_undistort(&c, 320 + 300 * rd * 1.001, 240, &x, &y), ARRIS_E_INPUT);
    assert_true(isfinite(x) && isfinite(y));
    assert_int_equal(arris_undistort(&c, 320 + 300 * rd * 4, 240, &x, &y), ARRIS_E_INPUT);
}

static void ideal_camera(void **state) {
    (void)state;
    arris_camera i = arris_camera_ideal(&heavy);
    double u, v;
    assert_true(arris_camera_distorts(&heavy));
    assert_false(arris_camera_distorts(&i));
    assert_true(i.fx == heavy.fx && i.skew == heavy.skew && i.width == heavy.width);
    arris_distort(&i, 1234.5, -67.25, &u, &v);
    NEAR(u, 1234.5, 1e-9);
    NEAR(v, -67.25, 1e-9);
}

static void cameras_compare(void **state) {
    (void)state;
    arris_camera c = box;
    assert_true(arris_camera_same(&box, &c));
    c.k3 = 1e-12;
    assert_false(arris_camera_same(&box, &c));
    assert_false(arris_camera_same(&box, NULL));
    assert_false(arris_camera_same(NULL, &box));
    assert_true(arris_camera_same(NULL, NULL));
}

static void cameras_are_checked(void **state) {
    (void)state;
    double not_finite[] = {NAN, INFINITY, -INFINITY};
    assert_null(arris_camera_check(&box));
    for (int k = 0; k < 10; k++) /* fx to k3 */
        for (int i = 0; i < 3; i++) {
            arris_camera c = box;
            double *field[] = {&c.fx, &c.fy, &c.skew, &c.cx, &c.cy,
                               &c.k1, &c.k2, &c.p1,   &c.p2, &c.k3};
            *field[k] = not_finite[i];
            assert_non_null(arris_camera_check(&c));
        }
    arris_camera c = box;
    c.fy = 0;
    assert_non_null(arris_camera_check(&c));
    c = box;
    c.width = 0;
    assert_non_null(arris_camera_check(&c));
}

/* ---- rotation ------------------------------------------------------------------------------- */

static void multiply(const double A[9], const double B[9], double C[9]) {
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            C[3 * i + j] = A[3 * i] * B[j] + A[3 * i + 1] * B[3 + j] + A[3 * i + 2] * B[6 + j];
}

/* (Rx Ry Rz)^T, each a right-handed rotation about its axis. */
static void axis_product(double o, double t, double k, double R[9]) {
    double Rx[9] = {1, 0, 0, 0, cos(o), -sin(o), 0, sin(o), cos(o)};
    double Ry[9] = {cos(t), 0, sin(t), 0, 1, 0, -sin(t), 0, cos(t)};
    double Rz[9] = {cos(k), -sin(k), 0, sin(k), cos(k), 0, 0, 0, 1};
    double A[9], B[9];
    multiply(Rx, Ry, A);
    multiply(A, Rz, B);
    for (int i = 0; i < 9; i++)
        R[i] = B[3 * (i % 3) + i / 3];
}

static void rotation_is_the_product_of_the_axes(void **state) {
    (void)state;
    for (double o = -3; o < 3; o += 0.7)
        for (double t = -1.5; t < 1.6; t += 0.3)
            for (double k = -3; k < 3; k += 0.7) {
                double R[9], S[9];
                arris_rotation(o, t, k, R);
                axis_product(o, t, k, S);
                for (int i = 0; i < 9; i++)
                    NEAR(R[i], S[i], 1e-15);
            }
}

static void angles_round_trip(void **state) {
    (void)state;
    for (double o = -3.1; o < 3.1; o += 0.31)
        for (double t = -1.57; t < 1.57; t += 0.157)
            for (double k = -3.1; k < 3.1; k += 0.31) {
                double R[9], o2, t2, k2;
                arris_rotation(o, t, k, R);
                arris_angles(R, &o2, &t2, &k2);
                NEAR(o2, o, 1e-11);
                NEAR(t2, t, 1e-11);
                NEAR(k2, k, 1e-11);
            }
}

static void angles_at_ninety_degrees(void **state) {
    (void)state;
    double gaps[] = {0, 1e-15, 1e-12, 1e-10, 2e-9, 1e-6};
    for (int s = -1; s <= 1; s += 2)
        for (int g = 0; g < 6; g++) {
            double R[9], S[9], o, t, k;
            arris_rotation(0.4, s * (M_PI / 2 - gaps[g]), -1.1, R);
            arris_angles(R, &o, &t, &k);
            arris_rotation(o, t, k, S);
            for (int i = 0; i < 9; i++)
                NEAR(R[i], S[i], 2e-9);
            NEAR(t, s * (M_PI / 2 - gaps[g]), 1e-9);
            if (gaps[g] < 1e-11)
                assert_true(o == 0);
        }
}

/* ---- projection, planes, lines -------------------------------------------------------------- */

static arris_pose some_pose(void) {
    arris_pose p = {.valid = true, .C = {120, -80, 40}};
    arris_rotation(0.2, -0.3, 1.1, p.R);
    return p;
}

static void project_by_hand(void **state) {
    (void)state;
    arris_pose at = {.valid = true, .C = {10, 20, -500}, .R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    double x = -1, y = -1, X[3] = {60, -30, 500}, behind[3] = {0, 0, -501};
    NEAR(arris_project(&box, &at, X, &x, &y), 1000, 0);
    NEAR(x, 380.60892 * 0.05 + 0.05367 * -0.05 + 153.27998, 1e-12);
    NEAR(y, 378.42038 * -0.05 + 119.84683, 1e-12);
    x = y = 7;
    NEAR(arris_project(&box, &at, behind, &x, &y), -1, 0);
    assert_true(x == 7 && y == 7);
    assert_true(arris_project(&box, &at, at.C, &x, &y) == 0 && x == 7);
}

static void bearing_inverts_projection(void **state) {
    (void)state;
    arris_pose p = some_pose();
    for (double v = 0; v < 960; v += 111)
        for (double u = 0; u < 1280; u += 111) {
            double d[3], X[3], x, y;
            arris_bearing(&heavy, &p, u, v, d);
            NEAR(arris_dot(d, d), 1, 1e-14);
            for (int i = 0; i < 3; i++)
                X[i] = p.C[i] + 750 * d[i];
            assert_true(arris_project(&heavy, &p, X, &x, &y) > 0);
            NEAR(x, u, 1e-9);
            NEAR(y, v, 1e-9);
        }
}

static void view_plane_holds_both_bearings(void **state) {
    (void)state;
    arris_pose p = some_pose();
    double segments[][4] = {{10, 20, 900, 700}, {600, 400, 600.001, 400}, {0, 0, 0, 900}};
    for (int i = 0; i < 3; i++) {
        double n[3], a[3], b[3];
        assert_int_equal(arris_view_plane(&heavy, &p, segments[i], n), 0);
        arris_bearing(&heavy, &p, segments[i][0], segments[i][1], a);
        arris_bearing(&heavy, &p, segments[i][2], segments[i][3], b);
        NEAR(arris_dot(n, n), 1, 1e-14);
        NEAR(arris_dot(n, a), 0, 1e-14);
        NEAR(arris_dot(n, b), 0, 1e-14);
    }
    double point[4] = {5, 6, 5, 6}, n[3];
    assert_int_equal(arris_view_plane(&heavy, &p, point, n), ARRIS_E_INPUT);
}

/* Planes of two views of a known 3D line meet in it. */
static void two_planes_meet_in_the_line(void **state) {
    (void)state;
    arris_pose p = some_pose(), q = some_pose();
    q.C[0] += 300;
    double A[3] = {-100, 50, 900}, B[3] = {200, 180, 1100}, n[2][3], u[3], e[4];
    arris_pose *poses[] = {&p, &q};
    for (int i = 0; i < 2; i++) {
        assert_true(arris_project(&box, poses[i], A, &e[0], &e[1]) > 0);
        assert_true(arris_project(&box, poses[i], B, &e[2], &e[3]) > 0);
        assert_int_equal(arris_view_plane(&box, poses[i], e, n[i]), 0);
        NEAR(arris_dot(n[i], A), arris_dot(n[i], poses[i]->C), 1e-9);
    }
    arris_cross(n[0], n[1], u);
    arris_unit(u);
    double AB[3] = {300, 130, 200};
    arris_unit(AB);
    NEAR(fabs(arris_dot(u, AB)), 1, 1e-12);
}

static void line_at_is_the_nearest_point(void **state) {
    (void)state;
    double X[3] = {1, 2, 3}, u[3] = {2, -1, 2}, C[3] = {40, 50, -60}, d[3], P[3];
    arris_unit(u);
    for (int i = 0; i < 3; i++) { /* aimed at 7.5 mm along the line, then lifted off it */
        P[i] = X[i] + 7.5 * u[i];
        d[i] = P[i] - C[i];
    }
    arris_unit(d);
    NEAR(arris_line_at(X, u, C, d), 7.5, 1e-10);
    double up[3];
    arris_cross(u, d, up);
    for (int i = 0; i < 3; i++)
        C[i] += 5 * up[i];
    NEAR(arris_line_at(X, u, C, d), 7.5, 1e-10);
    assert_true(isnan(arris_line_at(X, u, C, u)));
    double back[3] = {-u[0], -u[1], -u[2]};
    assert_true(isnan(arris_line_at(X, u, C, back)));
}

static void vectors(void **state) {
    (void)state;
    double x[3] = {1, 0, 0}, y[3] = {0, 1, 0}, z[3], v[3] = {3, 4, 12}, zero[3] = {0, 0, 0};
    arris_cross(x, y, z);
    assert_true(z[0] == 0 && z[1] == 0 && z[2] == 1);
    arris_cross(x, y, x); /* in place */
    assert_true(x[0] == 0 && x[1] == 0 && x[2] == 1);
    NEAR(arris_unit(v), 13, 0);
    NEAR(v[2], 12 / 13., 1e-16);
    assert_true(arris_unit(zero) == 0 && zero[0] == 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(distort_is_bouguets),
        cmocka_unit_test(undistort_inverts),
        cmocka_unit_test(undistort_finds_the_point_that_was_distorted),
        cmocka_unit_test(undistort_refuses_beyond_the_fold),
        cmocka_unit_test(ideal_camera),
        cmocka_unit_test(cameras_compare),
        cmocka_unit_test(cameras_are_checked),
        cmocka_unit_test(rotation_is_the_product_of_the_axes),
        cmocka_unit_test(angles_round_trip),
        cmocka_unit_test(angles_at_ninety_degrees),
        cmocka_unit_test(project_by_hand),
        cmocka_unit_test(bearing_inverts_projection),
        cmocka_unit_test(view_plane_holds_both_bearings),
        cmocka_unit_test(two_planes_meet_in_the_line),
        cmocka_unit_test(line_at_is_the_nearest_point),
        cmocka_unit_test(vectors),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
