/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_calibrate_run.c: `arris calibrate` as its users run it, on pictures that are rendered here,
 * and on real ones where they are.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "../plugins/calibrate/find.h"
#include "../plugins/calibrate/views.h"
#include "board.h"
#include "camera.h"
#include "one_error.h"
#include "scratch.h"

enum { PICTURES = 14 };

static const cal_board board = {9, 6, 30};
static const arris_camera eye = {320, 240, 335, 334, 0, 157, 121.5, -0.2, 0.08, 4e-4, -3e-4, 0};
static char folder[1024];

/* Valid until the next one is asked for. */
static const char *picture(int i) {
    static char path[2048];
    snprintf(path, sizeof path, "%s/%02d.pgm", folder, i);
    return path;
}

static int take_pictures(void **state) {
    (void)state;
    strcpy(folder, scratch_mkdir("pictures"));
    for (int i = 0; i < PICTURES; i++) {
        const cal_pose p = any_pose(&board);
        render(picture(i), &board, &eye, &p, 1.5);
    }
    return 0;
}

static process run(const char *format, ...) __attribute__((format(printf, 1, 2)));
static process run(const char *format, ...) {
    char line[8192];
    va_list args;
    va_start(args, format);
    vsnprintf(line, sizeof line, format, args);
    va_end(args);
    return arris_run(line);
}

static void refused(int code, const char *text, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
static void refused(int code, const char *text, const char *format, ...) {
    char line[8192];
    va_list args;
    va_start(args, format);
    vsnprintf(line, sizeof line, format, args);
    va_end(args);
    process p = arris_run(line);
    assert_one_error(&p, line, code, text, NULL, NULL);
}

/* ---- corners -------------------------------------------------------------------------------- */

static void corners_are_found_to_sub_pixel(void **state) {
    (void)state;
    double sum = 0;
    int n = 0;
    for (int i = 0; i < 6; i++) {
        const char *path = scratch("one.pgm");
        view_list l = {.board = board};
        fault f;
        double k[CAL_N], want[2 * BOARD_CORNERS];
        const cal_pose p = any_pose(&board);
        render(path, &board, &lens, &p, 1);
        see(&board, NULL, &lens, &p, 0, want);
        cal_from_camera(&lens, k);
        assert_int_equal(views_load_picture(&l, path, &f), 0);
        assert_string_equal(l.item[0].left_out, "");
        for (int c = 0; c < cal_corners(&board); c++) {
            const double x = l.item[0].corner[2 * c] - want[2 * c],
                         y = l.item[0].corner[2 * c + 1] - want[2 * c + 1];
            if (isnan(x))
                continue;
            assert_true(hypot(x, y) < 0.5);
            sum += x * x + y * y;
            n++;
        }
        views_free(&l);
    }
    print_message("corners: rms %.4f px\n", sqrt(sum / n));
    assert_true(n > 0.98 * 6 * cal_corners(&board) && sqrt(sum / n) < 0.08);
}

static void half_a_board_is_none(void **state) {
    (void)state;
    const cal_pose p = board_at(&board, -180, 0, 500, 0.2, 0.2, 0);
    view_list l = {.board = board};
    fault f;
    render(scratch("half.pgm"), &board, &eye, &p, 1);
    assert_int_equal(views_load_picture(&l, scratch("half.pgm"), &f), 0);
    assert_non_null(strstr(l.item[0].left_out, "not the whole of it"));
    assert_int_equal(views_check(&l, &f), ARRIS_E_INPUT);
    views_free(&l);
}

static void no_picture_is_too_strange(void **state) {
    (void)state;
    static const int sizes[][2] = {{1, 1}, {8, 8}, {3000, 9}, {320, 240}};
    double corner[2 * BOARD_CORNERS];
    for (int i = 0; i < 4; i++)
        for (int format = 1; format <= 2; format++) {
            const int stride = sizes[i][0] * format;
            arris_image im = {.format = (enum arris_format)format,
                              .width = sizes[i][0],
                              .height = sizes[i][1],
                              .stride = stride,
                              .data = calloc(1, (size_t)(stride * sizes[i][1]) + 64)};
            assert_int_equal(find_board(&im, &board, false, corner), FIND_NONE);
            for (int k = 0; k < stride * sizes[i][1]; k++)
                im.data[k] = (uint8_t)(256 * uniform());
            assert_int_equal(find_board(&im, &board, false, corner), FIND_NONE);
            free(im.data);
        }
}

/* ---- the command ---------------------------------------------------------------------------- */

static void camera_is_calibrated_and_written(void **state) {
    (void)state;
    arris_camera c;
    fault f;
    scratch_write("camera.json", "{\"serial\": \"A7\", \"fx\": 1, \"calibration\": 0}");
    scratch_write("pictures/15.txt", "no picture, and a folder's are told by their names");
    process p = run("calibrate --board 9x6 --square 30 %s -o %s --report %s --distance 500", folder,
                    scratch("camera.json"), scratch("report.html"));
    if (p.code || *p.err)
        fail_msg("%d: %s", p.code, p.err);
    assert_non_null(strstr(p.out, "rms of the residuals"));
    assert_non_null(strstr(p.out, "on the part at 500 mm"));
    assert_int_equal(camera_load(scratch("camera.json"), &c, &f), 0);
    print_message("fx %.3f, truth %.3f\n", c.fx, eye.fx);
    assert_true(fabs(c.fx - eye.fx) < 0.5 && fabs(c.cx - eye.cx) < 1 && c.width == 320);
    char *text = file_text(scratch("camera.json")), *html = file_text(scratch("report.html"));
    assert_true(strstr(text, "\"serial\": \"A7\"") && strstr(text, "\"rms_px\"") &&
                strstr(text, "\"utc\"") && strstr(text, "\"board\""));
    assert_true(strstr(html, "<svg") && strstr(html, "What to do next") && strstr(html, "µm"));
    assert_true(!strstr(html, "http") && !strstr(html, "src=") && !strstr(html, "nan"));
    free(text);
    free(html);
    process_free(&p);
}

static void bad_views_are_named(void **state) {
    (void)state;
    const cal_pose p = board_at(&board, -180, 0, 500, 0.2, 0.2, 0);
    render(scratch("half.pgm"), &board, &eye, &p, 1);
    process r =
        run("calibrate --board 9x6 --square 30 --fix skew,k3 %s %s", folder, scratch("half.pgm"));
    assert_int_equal(r.code, 0);
    assert_non_null(strstr(r.out, "half.pgm: the board was not found"));
    assert_non_null(strstr(r.out, "fixed"));
    process_free(&r);
}

static void bad_input_is_one_error(void **state) {
    (void)state;
    const char *small = scratch("small.pgm"), *text = scratch_write("text.png", "no picture");
    const arris_camera other = {160, 120, 167, 167, 0, 80, 60, 0, 0, 0, 0, 0};
    const cal_pose front = board_at(&board, 0, 0, 500, 0, 0, 0);
    render(small, &board, &other, &front, 1);
    const char *all = "calibrate --board 9x6 --square 30";
    refused(4, "1 of 1 views", "%s %s", all, picture(0));
    refused(4, "1 of 3 views", "%s %s %s %s", all, picture(0), picture(0), picture(0));
    refused(4, "text.png: this is no PNG", "%s %s %s", all, picture(0), text);
    refused(4, "small.pgm is 160x120", "%s %s %s", all, picture(0), small);
    refused(4, "cannot open", "%s %s/none.png", all, folder);
    refused(4, "9x6 inner corners, not 10x7", "calibrate --board 10x7 --square 30 %s", picture(0));
    refused(4, "found in none of 1", "calibrate --board 12x11 --square 30 %s", picture(0));
    refused(2, "--square 0", "calibrate --board 9x6 --square 0 %s", folder);
    refused(2, "--square -3", "calibrate --board 9x6 --square -3 %s", folder);
    refused(2, "--square nan", "calibrate --board 9x6 --square nan %s", folder);
    refused(2, "--board 9", "calibrate --board 9 --square 30 %s", folder);
    refused(2, "--board 2x1", "calibrate --board 2x1 --square 30 %s", folder);
    refused(2, "--fix k9", "%s --fix k9 %s", all, folder);
    refused(2, "--fix fx", "%s --fix fx %s", all, folder);
    refused(2, "no option", "%s --bord %s", all, folder);
    refused(2, "--square MM", "calibrate --board 9x6 %s", folder);
    refused(2, "one of", "%s", all);
    refused(2, "--target is for", "%s --target 3 %s", all, folder);
    scratch_write("other.json", "this is dear to someone");
    refused(4, "other.json is there", "%s %s -o %s", all, folder, scratch("other.json"));
    process p = run("%s %s -o %s", all, folder, scratch("none/camera.json"));
    assert_int_equal(p.code, 4); /* but what was found is told */
    assert_true(strstr(p.err, "cannot write") && strstr(p.out, "fx "));
    process_free(&p);
    char *kept = file_text(scratch("other.json"));
    assert_string_equal(kept, "this is dear to someone");
    free(kept);
}

static void parallel_views_are_refused(void **state) {
    (void)state;
    const char *flat = scratch_mkdir("flat");
    char path[2048];
    for (int i = 0; i < 6; i++) {
        const cal_pose p =
            board_at(&board, 30 * normal(), 20 * normal(), 420 + 30 * i, 0, 0, 0.1 * normal());
        snprintf(path, sizeof path, "%s/%d.pgm", flat, i);
        render(path, &board, &eye, &p, 1);
    }
    refused(4, "focal length is unobservable", "calibrate --board 9x6 --square 30 %s", flat);
}

static void pipeline_is_watched(void **state) {
    (void)state;
    char *words[] = {(char *)arris_path(),
                     (char *)"calibrate",
                     (char *)"--board",
                     (char *)"9x6",
                     (char *)"--square",
                     (char *)"30",
                     (char *)"--from",
                     NULL,
                     (char *)"--target",
                     (char *)"1e5",
                     NULL};
    char from[8192];
    snprintf(from, sizeof from, "imagesrc location=%s", folder);
    words[7] = from;
    process p = process_start(NULL, -1, words);
    process_wait(&p);
    assert_int_equal(p.code, 0);
    assert_non_null(strstr(p.err, "5 views: ")); /* and there the target is reached */
    assert_non_null(strstr(p.out, "5 of 5 views"));
    process_free(&p);
    snprintf(from, sizeof from, "imagesrc location=%s fps=200", folder); /* never still */
    p = process_start(NULL, -1, words);
    process_wait(&p);
    assert_one_error(&p, from, 4, "no view was taken", NULL, "still");
    snprintf(from, sizeof from, "imagesrc location=%s ! fakesnk", folder);
    p = process_start(NULL, -1, words);
    process_wait(&p);
    assert_one_error(&p, from, 2, "fakesnk", NULL, NULL);
}

static void board_is_true_to_scale(void **state) {
    (void)state;
    process p = run("calibrate --print-board 9x6 --square 25 -o %s", scratch("board.svg"));
    assert_int_equal(p.code, 0);
    process_free(&p);
    char *svg = file_text(scratch("board.svg"));
    double width, height, w, h;
    int dark = 0;
    assert_int_equal(sscanf(strstr(svg, "width="),
                            "width=\"%lfmm\" height=\"%lfmm\" viewBox=\"0 0 %lf %lf", &width,
                            &height, &w, &h),
                     4);
    assert_true(width == w && height == h && width == 10 * 25 + 2 * 25);
    for (char *at = svg; (at = strstr(at, "width=\"25.0000\" height=\"25.0000\"")); at++)
        dark++;
    assert_int_equal(dark, 35); /* of 10 x 7 squares */
    free(svg);
    p = run("calibrate --print-board 9x6 --square 25 -o %s", scratch("board.pdf"));
    assert_int_equal(p.code, 0);
    process_free(&p);
    char *pdf = file_text(scratch("board.pdf")), *xref = strstr(pdf, "startxref\n");
    assert_true(strncmp(pdf, "%PDF-1.4\n", 9) == 0 && xref);
    assert_int_equal(strncmp(pdf + atol(xref + 10), "xref\n0 6\n", 9), 0);
    assert_int_equal(strncmp(pdf + atol(strstr(pdf, "65535 f") + 8), "1 0 obj", 7), 0);
    assert_int_equal(sscanf(strstr(pdf, "MediaBox"), "MediaBox[0 0 %lf %lf]", &w, &h), 2);
    assert_true(fabs(w - width * 72 / 25.4) < 1e-3 && fabs(h - height * 72 / 25.4) < 1e-3);
    free(pdf);
    refused(2, "ends in .svg or .pdf", "calibrate --print-board 9x6 --square 25 -o %s",
            scratch("board.png"));
    refused(2, "the limit is", "calibrate --print-board 90x60 --square 250 -o %s",
            scratch("big.pdf"));
}

/* ---- the robot ------------------------------------------------------------------------------ */

static void handeye_is_written(void **state) {
    (void)state;
    const cal_pose X = {.R = {0, -1, 0, 1, 0, 0, 0, 0, 1}, .t = {10, -60, 40}};
    const cal_pose Xi = cal_inverse(&X);
    strcpy(folder, scratch_mkdir("pictures"));
    FILE *csv = fopen(scratch("pictures/flange.csv"), "w");
    fputs("index,file,utime,x,y,z,qw,qx,qy,qz\n", csv);
    for (int i = 0; i < PICTURES; i++) {
        const cal_pose P = any_pose(&board), Pi = cal_inverse(&P), F = cal_compose(&Pi, &Xi);
        double w[3], n;
        render(picture(i), &board, &eye, &P, 1);
        cal_rotation_vector(F.R, w);
        n = arris_unit(w) / 2;
        fprintf(csv, "%d,%02d.pgm,%d,%.4f,%.4f,%.4f,%.8f,%.8f,%.8f,%.8f\n", i, i, 40000 * i, F.t[0],
                F.t[1], F.t[2], cos(n), sin(n) * w[0], sin(n) * w[1], sin(n) * w[2]);
    }
    fclose(csv);
    scratch_write(
        "pictures/camera.json",
        "{\"width\":320,\"height\":240,\"fx\":335,\"fy\":334,\"skew\":0,\"cx\":157,\"cy\":"
        "121.5,\"k1\":-0.2,\"k2\":0.08,\"p1\":4e-4,\"p2\":-3e-4,\"k3\":0}");
    process p = run("calibrate --hand-eye %s/flange.csv --board 9x6 --square 30 -o %s", folder,
                    scratch("handeye.json"));
    if (p.code)
        fail_msg("%s", p.err);
    assert_non_null(strstr(p.out, "The robot is off by"));
    char *text = file_text(scratch("handeye.json"));
    double x, y, z, qw;
    assert_int_equal(sscanf(strstr(text, "\"x\""),
                            "\"x\": %lf, \"y\": %lf, \"z\": %lf, \"qw\": %lf", &x, &y, &z, &qw),
                     4);
    assert_true(fabs(x - 10) < 0.5 && fabs(y + 60) < 0.5 && fabs(z - 40) < 0.5);
    assert_true(fabs(qw - sqrt(0.5)) < 1e-3 && strstr(text, "\"cov\""));
    free(text);
    process_free(&p);
    scratch_write("pictures/bad.csv",
                  "index,file,utime,x,y,z,qw,qx,qy,qz\n0,00.pgm,0,1,2,3,1,1,0,0\n");
    refused(4, "bad.csv:2", "calibrate --hand-eye %s/bad.csv --board 9x6 --square 30", folder);
    refused(4, "cannot open", "calibrate --hand-eye %s/no.csv --board 9x6 --square 30", folder);
}

/* ---- real pictures, where they are ---------------------------------------------------------- */

static double value_of(const char *json, const char *key) {
    char quoted[32];
    snprintf(quoted, sizeof quoted, "\n \"%s\": ", key); /* of the object itself */
    const char *at = strstr(json, quoted);
    return at ? atof(at + strlen(quoted)) : NAN;
}

static double sigma_of(const char *json, const char *key) {
    char quoted[32];
    snprintf(quoted, sizeof quoted, "   \"%s\": ", key); /* within "sigma" */
    const char *at = strstr(json, quoted);
    return at ? atof(at + strlen(quoted)) : NAN;
}

/* camera.json's text by the pictures of a set; NULL when it is not there. */
static char *calibrate_set(const char *set, const char *options) {
    char path[256];
    snprintf(path, sizeof path, "../shared/data/%s/frames", set);
    if (access(path, R_OK)) {
        print_message("%s is not here: not tested\n", path);
        return NULL;
    }
    unlink(scratch("set.json"));
    process p = run("calibrate %s %s -o %s", options, path, scratch("set.json"));
    if (p.code)
        fail_msg("%s", p.err);
    process_free(&p);
    return file_text(scratch("set.json"));
}

static void real_cameras_are_as_published(void **state) {
    (void)state;
    static const struct {
        const char *set, *options, *key;
        double value, within;
    } known[] = {{"bouguet_example1", "--board 12x13 --square 30", "fx", 657.463, 0.318},
                 {"bouguet_example1", "--board 12x13 --square 30", "fy", 657.947, 0.340},
                 {"bouguet_example1", "--board 12x13 --square 30", "cx", 303.137, 0.647},
                 {"bouguet_example1", "--board 12x13 --square 30", "cy", 242.569, 0.592},
                 {"opencv_left_right", "--board 9x6 --square 30", "fx", 533.09, 1.24}};
    char *text = NULL;
    for (size_t i = 0; i < sizeof known / sizeof *known; i++) {
        if (i == 0 || strcmp(known[i].set, known[i - 1].set)) {
            free(text);
            text = calibrate_set(known[i].set, known[i].options);
        }
        if (!text)
            continue;
        const double off = value_of(text, known[i].key) - known[i].value;
        print_message("%s: %s off by %.3f of %.3f\n", known[i].set, known[i].key, off,
                      known[i].within);
        assert_true(fabs(off) < known[i].within);
    }
    free(text);
}

static void rendered_camera_is_within_its_intervals(void **state) {
    (void)state;
    char *text = calibrate_set("calib", "--board 23x15 --square 16");
    char *truth = file_text("../shared/data/calib/truth_camera.json");
    int inside = 0;
    if (text) {
        for (int i = 0; i < CAL_N; i++) {
            char key[32];
            snprintf(key, sizeof key, "\"%s\": ", cal_names[i]);
            const double off =
                value_of(text, cal_names[i]) - atof(strstr(truth, key) + strlen(key));
            inside += fabs(off) < 1.96 * sigma_of(text, cal_names[i]);
            assert_true(i != CAL_FX || fabs(off) < 5e-4 * 380.6);
        }
        print_message("%d of 10 within 95 %%\n", inside);
        assert_true(inside >= 9);
    }
    free(text);
    free(truth);
}

/* The pose of the board from the corners of its one half, and those of the other half by where
 * their rays meet the board's plane: the grid lines through them, in the views' mean, against the
 * grid. */
static void half_board(const char *set, const cal_board *b, double limit) {
    char path[256], *paths[] = {path};
    view_list l = {.board = *b};
    cal_result r;
    fault f;
    snprintf(path, sizeof path, "../shared/data/%s/frames", set);
    if (access(path, R_OK)) {
        print_message("%s is not here: not tested\n", path);
        return;
    }
    assert_int_equal(views_load(&l, paths, 1, &f), 0);
    cal_options o = {.width = l.width, .height = l.height};
    assert_int_equal(cal_fit(b, l.item, l.n, &o, &r, &f), 0);
    const int half = b->cols / 2, n = b->cols - half;
    double sum = 0, each = 0;
    int ends = 0, views = 0;
    double(*mean)[2] = calloc((size_t)cal_corners(b), sizeof *mean);
    int *seen = calloc((size_t)cal_corners(b), sizeof *seen);
    uint8_t *use = calloc((size_t)cal_corners(b), 1);
    for (int i = 0; i < cal_corners(b); i++)
        use[i] = i % b->cols < half;
    for (int v = 0; v < l.n; v++) {
        cal_pose pose;
        if (*l.item[v].left_out ||
            cal_find_pose(b, &r.camera, NULL, l.item[v].corner, use, &pose, NULL))
            continue;
        views++;
        const cal_pose back = cal_inverse(&pose);
        for (int i = 0; i < cal_corners(b); i++) {
            double x, y, d[3];
            if (use[i] || isnan(l.item[v].corner[2 * i]))
                continue;
            arris_undistort(&r.camera, l.item[v].corner[2 * i], l.item[v].corner[2 * i + 1], &x,
                            &y);
            y = (y - r.camera.cy) / r.camera.fy;
            x = (x - r.camera.cx - r.camera.skew * y) / r.camera.fx;
            for (int k = 0; k < 3; k++)
                d[k] = arris_dot(back.R + 3 * k, (double[]){x, y, 1});
            const double s = -back.t[2] / d[2];
            const double at[2] = {back.t[0] + s * d[0] - i % b->cols * b->square,
                                  back.t[1] + s * d[1] - i / b->cols * b->square};
            mean[i][0] += at[0];
            mean[i][1] += at[1];
            each += at[0] * at[0] + at[1] * at[1];
            seen[i]++;
        }
    }
    for (int row = 0; row < b->rows; row++) { /* the lines along the rows: their heights' fit */
        double s0 = 0, s1 = 0, s2 = 0, t0 = 0, t1 = 0;
        for (int col = half; col < b->cols; col++) {
            const int i = row * b->cols + col;
            const double u = col - half, off = mean[i][1] / seen[i];
            s0++, s1 += u, s2 += u * u, t0 += off, t1 += u * off;
        }
        const double det = s0 * s2 - s1 * s1, a = (s2 * t0 - s1 * t1) / det,
                     slope = (s0 * t1 - s1 * t0) / det;
        sum += a * a + pow(a + slope * (n - 1), 2);
        ends += 2;
    }
    print_message("%s: ends of the other half's lines off by %.3f mm rms over %d views; single "
                  "corners of single views by %.3f\n",
                  set, sqrt(sum / ends), views, sqrt(each / (views * b->rows * n)));
    assert_true(sqrt(sum / ends) < limit);
    free(mean);
    free(seen);
    free(use);
    views_free(&l);
}

static void one_half_of_the_board_tells_the_other(void **state) {
    (void)state;
    half_board("bouguet_example1", &(cal_board){12, 13, 30}, 0.25);
    half_board("opencv_left_right", &(cal_board){9, 6, 30}, 0.6);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(corners_are_found_to_sub_pixel),
        cmocka_unit_test(half_a_board_is_none),
        cmocka_unit_test(no_picture_is_too_strange),
        cmocka_unit_test(camera_is_calibrated_and_written),
        cmocka_unit_test(bad_views_are_named),
        cmocka_unit_test(bad_input_is_one_error),
        cmocka_unit_test(parallel_views_are_refused),
        cmocka_unit_test(pipeline_is_watched),
        cmocka_unit_test(board_is_true_to_scale),
        cmocka_unit_test(handeye_is_written),
        cmocka_unit_test(real_cameras_are_as_published),
        cmocka_unit_test(rendered_camera_is_within_its_intervals),
        cmocka_unit_test(one_half_of_the_board_tells_the_other),
    };
    return cmocka_run_group_tests(tests, take_pictures, NULL);
}
