/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_adjust_board.c: `adjust` on a real robot arm over a real chessboard, whose grid is known:
 * the lines through its corners, with the poses that the robot reported. Needs ../shared/data.
 *
 * Where the board lies in the robot's axes is known by a fit of hand and eye alone, which is off by
 * several millimetres; so the grid is laid on the lines, by turning and moving it, before it is
 * compared. The lens model is off as well, by up to 2 px at the edge of the picture: that has to be
 * found out. Rows and columns see two directions of motion apart from each other; the diagonals
 * bind them.
 */
// clang-format off
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <cmocka.h>
// clang-format on

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "adjust/record.h"
#include "calibrate/find.h"
#include "calibrate/views.h"
#include "camera.h"
#include "frames.h"

enum { COLS = 8, ROWS = 7, GRID = COLS + ROWS, LINES = GRID + 16, MAX_FRAMES = 100 };
#define SQUARE 40.0 /* mm */
#define CORNER                                                                                     \
    0.16          /* px, sigma: 0.12, and 200 times a corner of 56 is on a line, with 112 numbers */
#define GUESS 3.0 /* mm, by which the lines are off in the beginning */
#define FAR 20.0  /* px: a board that was found and one that is expected lie nearer */

/* Where line k begins, and which way it goes, in squares: the rows, the columns, then the diagonals
 * of four corners and more, a falling and a rising one in turn. Returns how many corners it has. */
static int lattice_line(int k, int from[2], int step[2]) {
    int n = 0, column = (k - GRID) / 2 - 3;
    from[0] = k < ROWS ? 0 : k - ROWS, from[1] = k < ROWS ? k : 0;
    step[0] = k < ROWS, step[1] = k >= ROWS;
    if (k >= GRID) {
        bool rising = (k - GRID) % 2;
        from[0] = column < 0 ? 0 : column, from[1] = column < 0 ? -column : 0;
        from[0] = rising ? COLS - 1 - from[0] : from[0];
        step[0] = rising ? -1 : 1;
    }
    for (int x = from[0], y = from[1]; x >= 0 && x < COLS && y < ROWS; x += step[0], y += step[1])
        n++;
    return n;
}

/* Line k on the board, from P to Q. */
static void grid_line(int k, double P[3], double Q[3]) {
    int from[2], step[2], n = lattice_line(k, from, step);
    for (int i = 0; i < 2; i++)
        P[i] = from[i] * SQUARE, Q[i] = (from[i] + (n - 1) * step[i]) * SQUARE;
    P[2] = Q[2] = 0;
}

/* ---- what was seen --------------------------------------------------------------------------- */

/* The mean distance of the corners from where the pose has them, px. */
static double misfit(const arris_camera *c, const arris_pose *pose, const double *corner) {
    double sum = 0, n = 0;
    for (int i = 0; i < COLS * ROWS; i++) {
        double X[3] = {i % COLS * SQUARE, i / COLS * SQUARE, 0}, x, y, u, v;
        if (!isfinite(corner[2 * i]) || !(arris_project(c, pose, X, &x, &y) > 0))
            continue;
        arris_distort(c, x, y, &u, &v);
        sum += hypot(u - corner[2 * i], v - corner[2 * i + 1]);
        n++;
    }
    return n > 0 ? sum / n : (double)INFINITY;
}

/* The line through the ideal points that is nearest to them all. False: they are too few. */
static bool fit_segment(double (*point)[2], int n, arris_segment *s) {
    double x = 0, y = 0, xx = 0, xy = 0, yy = 0, from = 0, to = 0, along = 0;
    for (int i = 0; i < n; i++)
        x += point[i][0] / n, y += point[i][1] / n;
    for (int i = 0; i < n; i++) {
        double dx = point[i][0] - x, dy = point[i][1] - y;
        xx += dx * dx, xy += dx * dy, yy += dy * dy;
    }
    double angle = atan2(2 * xy, xx - yy) / 2, c = cos(angle), d = sin(angle);
    for (int i = 0; i < n; i++) {
        double t = c * (point[i][0] - x) + d * (point[i][1] - y);
        from = fmin(from, t), to = fmax(to, t), along += t * t;
    }
    double middle = (from + to) / 2; /* which offset and angle are counted from */
    *s =
        (arris_segment){.x1 = x + from * c, .y1 = y + from * d, .x2 = x + to * c, .y2 = y + to * d};
    s->cov[2] = CORNER * CORNER / along;
    s->cov[1] = middle * s->cov[2];
    s->cov[0] = CORNER * CORNER / n + middle * middle * s->cov[2];
    return n >= 4;
}

static void add_views(adj_problem *p, record *r, const arris_camera *c, uint32_t frame,
                      const double *corner) {
    for (int k = 0; k < LINES; k++) {
        double point[COLS][2];
        arris_segment s;
        int n = 0, from[2], step[2], corners = lattice_line(k, from, step);
        for (int i = 0; i < corners; i++) {
            int at = (from[1] + i * step[1]) * COLS + from[0] + i * step[0];
            if (isfinite(corner[2 * at]) && arris_undistort(c, corner[2 * at], corner[2 * at + 1],
                                                            &point[n][0], &point[n][1]) == 0)
                n++;
        }
        if (!fit_segment(point, n, &s))
            continue;
        assert_true(adj_add_view(p, frame, (uint32_t)k, &s) >= 0);
        record_add(r, k, &s, &p->camera);
    }
}

/* ---- how good it is -------------------------------------------------------------------------- */

typedef struct score {
    double ends, scaled, square; /* mm: rms of the grid's ends, but for the scale; of a square */
} score;

/* Solves N x = its last column, by Gauss. */
static void solve(double N[7][8], int n, double x[7]) {
    for (int i = 0; i < n; i++)
        for (int k = i + 1; k < n; k++)
            for (int j = 7; j >= i; j--)
                N[k][j] -= N[k][i] / N[i][i] * N[i][j];
    for (int i = n - 1; i >= 0; i--) {
        x[i] = N[i][7];
        for (int j = i + 1; j < n; j++)
            x[i] -= N[i][j] * x[j];
        x[i] /= N[i][i];
    }
}

/* v without its part along u. */
static void across(const double u[3], const double v[3], double out[3]) {
    double along = arris_dot(u, v);
    for (int i = 0; i < 3; i++)
        out[i] = v[i] - along * u[i];
}

/* Lays the ends X of the grid's lines on the lines that were found, by turning, moving and, with n
 * = 7 in place of 6, scaling them about the grid's middle: one step. Returns their rms distance
 * (mm) before it, and what the scale changes. */
static double lay(const arris_lines *lines, int n, double X[2 * GRID][3], double *scale) {
    const double middle[3] = {(COLS - 1) * SQUARE / 2, (ROWS - 1) * SQUARE / 2, 0};
    double N[7][8] = {{0}}, x[7] = {0}, sum = 0;
    for (int k = 0; k < 2 * GRID; k++) {
        const arris_line *l = &lines->item[k / 2];
        double u[3], d[3], e[3], y[3], J[7][3];
        for (int i = 0; i < 3; i++)
            u[i] = l->q[i] - l->p[i], d[i] = X[k][i] - l->p[i], y[i] = X[k][i] - middle[i];
        arris_unit(u);
        across(u, d, e);
        for (int i = 0; i < 3; i++) {
            double axis[3] = {i == 0, i == 1, i == 2}, turned[3];
            arris_cross(axis, y, turned);
            across(u, turned, J[i]);
            across(u, axis, J[3 + i]);
        }
        across(u, y, J[6]);
        for (int i = 0; i < n; i++) {
            for (int j = 0; j < n; j++)
                N[i][j] += arris_dot(J[i], J[j]);
            N[i][7] -= arris_dot(J[i], e);
        }
        sum += arris_dot(e, e);
    }
    solve(N, n, x);
    for (int k = 0; k < 2 * GRID; k++) {
        double y[3], turned[3];
        for (int i = 0; i < 3; i++)
            y[i] = X[k][i] - middle[i];
        arris_cross(x, y, turned);
        for (int i = 0; i < 3; i++)
            X[k][i] += turned[i] + x[3 + i] + x[6] * y[i];
    }
    *scale *= 1 + x[6];
    return sqrt(sum / (2 * GRID));
}

static double rms_of_ends(const arris_lines *lines, int n, double *scale) {
    double X[2 * GRID][3], rms = 0;
    for (int k = 0; k < GRID; k++)
        grid_line(k, X[2 * k], X[2 * k + 1]);
    *scale = 1;
    for (int i = 0; i < 10; i++)
        rms = lay(lines, n, X, scale);
    return rms;
}

static score score_of(const arris_lines *lines) {
    score s;
    s.ends = rms_of_ends(lines, 6, &s.square);
    s.scaled = rms_of_ends(lines, 7, &s.square);
    s.square *= SQUARE;
    return s;
}

/* ---- the test -------------------------------------------------------------------------------- */

static void read_scan(const char *folder, adj_problem *p, record *r, uint32_t *frames) {
    frame_list list;
    view_list views = {.board = {COLS, ROWS, SQUARE}};
    fault f;
    arris_camera c;
    char path[FRAMES_PATH];
    snprintf(path, sizeof path, "%s/camera.json", folder);
    assert_int_equal(camera_load(path, &c, &f), 0);
    snprintf(path, sizeof path, "%s/frames.csv", folder);
    assert_int_equal(frames_load(&list, path, 0, &f), 0);
    assert_true(list.n <= MAX_FRAMES);
    assert_int_equal(adj_init(p, MAX_FRAMES, LINES, MAX_FRAMES * LINES), 0);
    p->camera = arris_camera_ideal(&c);
    assert_int_equal(record_init(r, &p->camera, MAX_FRAMES, MAX_FRAMES * LINES), 0);
    for (int k = 0; k < LINES; k++) {
        double P[3], Q[3];
        grid_line(k, P, Q);
        for (int i = 0; i < 3; i++)
            P[i] += GUESS * sin(5 * k + 2 * i), Q[i] += GUESS * cos(3 * k + i);
        adj_add_line(p, P, Q, 300);
    }
    for (size_t i = 0; i < list.n; i++) {
        arris_pose pose;
        assert_int_equal(frames_path(&list, list.item[i].file, path, &f), 0);
        assert_int_equal(views_load_picture(&views, path, &f), 0);
        cal_view *v = &views.item[views.n - 1];
        frames_pose(&list.item[i], &pose);
        if (!*v->left_out && misfit(&c, &pose, v->corner) > FAR)
            find_turn_half(&views.board, v->corner);
        if (*v->left_out || misfit(&c, &pose, v->corner) > FAR)
            continue;
        int64_t frame = adj_add_frame(p, &pose, (double)list.item[i].utime / 1e6);
        assert_true(record_frame(r, list.item[i].index, list.item[i].utime, &pose));
        add_views(p, r, &c, (uint32_t)frame, v->corner);
    }
    *frames = (uint32_t)list.n;
    views_free(&views);
    frames_free(&list);
}

/* The lines as the robot's poses have them. */
static void triangulate(adj_problem *p, arris_lines *lines) {
    adj_work *w = adj_work_new(p, &adj_cholmod);
    assert_non_null(w);
    for (int k = 0; k < 6; k++)
        p->sigma[k] = 1e-9;
    assert_true(adj_minimise(p, w, 50, 1e-6) > 0);
    for (int k = 0; k < LINES; k++) {
        arris_line *l = &lines->item[k];
        *l = (arris_line){.id = k, .state = ARRIS_MEASURED, .into = -1};
        adj_line_points(&p->line[k], l->p, l->q);
    }
    adj_work_free(w);
}

/* Those lines, and as they are with the poses adjusted. */
static void measure(const char *name) {
    adj_problem p;
    record r;
    adjusted a;
    arris_line item[LINES];
    arris_lines lines = {.item = item, .n = LINES, .max = LINES};
    adjust_params params = {.robust = 4, .backend = &adj_cholmod};
    char folder[100];
    uint32_t frames;
    snprintf(folder, sizeof folder, "../shared/data/%s", name);
    if (access(folder, R_OK) != 0) {
        printf("skipped: %s is not there\n", folder);
        skip();
    }
    read_scan(folder, &p, &r, &frames);
    triangulate(&p, &lines);
    score before = score_of(&lines);
    assert_int_equal(record_adjust(&r, &lines, &params, &a), 0);
    score after = score_of(&lines);
    const double *sigma = a.q.sigma, *lens = a.state;
    printf("%s: %u of %u pictures; ends %.3f -> %.3f mm, %.3f -> %.3f without scale; square %.3f "
           "-> %.3f mm, sigma %.3f; lens %.2f %.2f %.2f %.2f px; poses %.2f %.2f %.2f mm %.2f %.2f "
           "%.2f mrad\n",
           name, p.n_frames, frames, before.ends, after.ends, before.scaled, after.scaled,
           before.square, after.square, a.q.scale_sigma * SQUARE, lens[0], lens[1], lens[2],
           lens[3], sigma[0], sigma[1], sigma[2], sigma[3] * 1e3, sigma[4] * 1e3, sigma[5] * 1e3);
    assert_int_equal(a.common, ADJ_LENS);
    record_adjusted_free(&a);
    record_free(&r);
    adj_free(&p);
    assert_true(after.ends < 0.8 && after.ends < before.ends);
    assert_true(after.scaled < 0.4);
    assert_true(fabs(after.square / SQUARE - 1) < 1.5e-3);
}

static void board_a(void **unused) {
    (void)unused;
    measure("ur_robot_chessboard_a");
}

static void board_c(void **unused) {
    (void)unused;
    measure("ur_robot_chessboard_c");
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(board_a), cmocka_unit_test(board_c)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
