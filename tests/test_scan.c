/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_scan.c: recorded scans that are not as they should be, through the real chain: each ends
 * with one clear error and the right exit code, and what was measured before it is written.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <jansson.h>

#include "one_error.h"
#include "process.h"
#include "scratch.h"

#define BOX "samples/box"
#define MEASURE                                                                                    \
    "! edges ! undistort ! segments ! track ! reconstruct ! filesink location=lines.json"
#define CHAIN "imagesrc location=frames.csv " MEASURE

enum { FRAMES = 12 };

/* ---- a scan to spoil ------------------------------------------------------------------------- */

static char row[FRAMES + 1][200]; /* of frames.csv, the header first */

static void write_rows(void) {
    char text[sizeof row + FRAMES + 2] = "";
    for (int i = 0; i <= FRAMES; i++)
        strcat(strcat(text, row[i]), "\n");
    scratch_write("scan/frames.csv", "%s", text);
}

static void copy(const char *from, const char *name, size_t most) {
    FILE *in = fopen(from, "r"), *out = fopen(scratch(name), "w");
    for (int c; most-- > 0 && in && out && (c = getc(in)) != EOF;)
        putc(c, out);
    if (!in || !out || fclose(in) || fclose(out))
        fail_msg("%s cannot be copied", from);
}

static void picture_path(int i, char from[300]) {
    const char *file = strchr(row[i + 1], ',') + 1;
    snprintf(from, 300, BOX "/%.*s", (int)strcspn(file, ","), file);
}

/* The first frames of the box in a folder of their own: frames.csv, camera.json, 0.png, 1.png ...
 */
static int make_scan(void **state) {
    (void)state;
    char from[300], name[64], rest[150];
    FILE *f = fopen(BOX "/frames.csv", "r");
    scratch_mkdir("scan");
    for (int i = 0; i <= FRAMES; i++) {
        if (!f || !fgets(row[i], sizeof row[i], f))
            return -1;
        row[i][strcspn(row[i], "\r\n")] = '\0';
    }
    fclose(f);
    copy(BOX "/camera.json", "scan/camera.json", SIZE_MAX);
    for (int i = 0; i < FRAMES; i++) {
        picture_path(i, from);
        snprintf(name, sizeof name, "scan/%d.png", i);
        copy(from, name, SIZE_MAX);
        snprintf(rest, sizeof rest, "%s", strchr(strchr(row[i + 1], ',') + 1, ','));
        snprintf(row[i + 1], sizeof row[i + 1], "%d,%d.png%s", i, i, rest);
    }
    write_rows();
    return 0;
}

static process run(const char *line) {
    return arris_launch(scratch("scan"), line);
}

static void fails(const char *line, int code, const char *text, const char *hint) {
    process p = run(line);
    assert_one_error(&p, line, code, text, NULL, hint);
}

/* How many frames went into the result; -1 when there is none. */
static int frames_measured(void) {
    json_t *root = json_load_file(scratch("scan/lines.json"), 0, NULL);
    int frames = root ? (int)json_integer_value(json_object_get(root, "frames")) : -1;
    assert_true(!root || json_is_array(json_object_get(root, "lines")));
    json_decref(root);
    return frames;
}

static void a_good_scan(void **state) {
    (void)state;
    process p = run(CHAIN);
    if (p.code || *p.err || *p.out)
        fail_msg("%d: %s", p.code, p.err);
    assert_int_equal(frames_measured(), FRAMES);
    process_free(&p);
}

/* ---- pictures -------------------------------------------------------------------------------- */

static void a_truncated_picture(void **state) {
    (void)state;
    char from[300];
    snprintf(from, sizeof from, "%s", scratch("scan/8.png"));
    copy(from, "scan/7.png", 3000);
    fails(CHAIN, 4, "arris: error: imagesrc: frame 7: 7.png: ", NULL);
    assert_int_equal(frames_measured(), 7);
    copy(from, "scan/7.png", 20); /* in its header */
    fails(CHAIN, 4, "frame 7: 7.png: ", NULL);
    scratch_write("scan/7.png", "%s", "");
    fails(CHAIN, 4, "frame 7: 7.png: ", NULL);
    scratch_write("scan/7.png", "this is no picture but a text that somebody has put here\n");
    fails(CHAIN, 4, "frame 7: 7.png: ", NULL);
    unlink(scratch("scan/7.png"));
    fails(CHAIN, 4, "7.png: No such file", NULL);
    assert_int_equal(frames_measured(), 7);
}

static void pictures_of_different_sizes(void **state) {
    (void)state;
    FILE *f = fopen(scratch("scan/5.pgm"), "w");
    fprintf(f, "P5 64 48 255\n%03072d", 0);
    fclose(f);
    char rest[150];
    snprintf(rest, sizeof rest, "%s", strstr(row[6], ".png") + 4);
    snprintf(row[6], sizeof row[6], "5,5.pgm%s", rest);
    write_rows();
    fails(CHAIN, 4, "frame 5: 5.pgm is 64x48 with 8 bits; the first picture is 320x240 with 8",
          NULL);
    assert_int_equal(frames_measured(), 5);
    fails("imagesrc location=. ! edges ! fakesink", 4, "64x48", NULL); /* as a folder */
}

static void the_first_picture(void **state) {
    (void)state;
    unlink(scratch("scan/0.png"));
    fails(CHAIN, 4, "imagesrc: ", NULL);
    assert_int_equal(frames_measured(), -1);
    scratch_write("scan/0.png", "nonsense");
    process p = run(CHAIN);
    assert_one_error(&p, CHAIN, 4, "0.png", "imagesrc", NULL);
    assert_int_equal(frames_measured(), -1);
}

static void odd_pictures_are_measured(void **state) {
    (void)state;
    scratch_mkdir("scan/odd");
    for (int i = 0; i < 3; i++) {
        char name[64];
        snprintf(name, sizeof name, "scan/odd/%d.pgm", i);
        scratch_write(name, "P5 1 1 255\n%c", '0' + i);
    }
    static const char one[] = "imagesrc location=odd ! edges ! segments ! track ! filesink "
                              "location=tracks.csv";
    process p = run(one);
    if (p.code)
        fail_msg("%s", p.err);
    process_free(&p);
    for (int i = 0; i < 3; i++) { /* blank ones */
        char name[64];
        snprintf(name, sizeof name, "scan/odd/%d.pgm", i);
        scratch_write(name, "P5 100 80 255\n%08000d", 0);
    }
    p = run(one);
    if (p.code)
        fail_msg("%s", p.err);
    process_free(&p);
}

/* ---- where frames are ------------------------------------------------------------------------ */

static void places_without_frames(void **state) {
    (void)state;
    scratch_mkdir("scan/empty");
    fails("imagesrc location=empty " MEASURE, 4, "the folder empty has no pictures", "frames.csv");
    fails("imagesrc location=none.csv " MEASURE, 4, "cannot open none.csv: No such file",
          "location=");
    fails("imagesrc location=none/ " MEASURE, 4, "No such file", NULL);
    fails("imagesrc location=camera.json " MEASURE, 4, "camera.json", NULL);
    fails("imagesrc " MEASURE, 2, "no location= is given", "location=");
    fails("imagesrc location=frames.csv start=100 " MEASURE, 2, "there is no frame", NULL);
    scratch_write("scan/frames.csv", "%s\n", row[0]);
    fails(CHAIN, 4, "frames.csv has no frames", NULL);
    scratch_write("scan/frames.csv", "%s", "");
    fails(CHAIN, 4, "frames.csv", NULL);
    assert_int_equal(frames_measured(), -1);
}

/* ---- the camera ------------------------------------------------------------------------------ */

static void cameras(void **state) {
    (void)state;
    static const char camera[] = "{\"width\": %s, \"height\": 240, \"fx\": %s, \"fy\": 380, "
                                 "\"skew\": 0, \"cx\": 160, \"cy\": 120, \"k1\": 0, \"k2\": 0, "
                                 "\"p1\": 0, \"p2\": 0, \"k3\": 0}";
#define CAMERA(width, fx) scratch_write("scan/camera.json", camera, width, fx)
    CAMERA("640", "380");
    process p = run(CHAIN);
    assert_one_error(&p, CHAIN, 4, "camera of 640x240, and the pictures are 320x240", "imagesrc",
                     "camera=");
    CAMERA("320", "NaN");
    fails(CHAIN, 4, "camera.json", NULL);
    CAMERA("320", "-380");
    fails(CHAIN, 4, "camera.json", NULL);
    CAMERA("320", "1e999");
    fails(CHAIN, 4, "camera.json", NULL);
    scratch_write("scan/camera.json", "{\"width\": 320, ");
    fails(CHAIN, 4, "camera.json", NULL);
    fails("imagesrc location=frames.csv camera=none.json " MEASURE, 4, "none.json", NULL);
    unlink(scratch("scan/camera.json"));
    process without = run(CHAIN);
    assert_one_error(&without, CHAIN, 4, "undistort: the camera's lens is not known", "undistort",
                     "camera.json");
    assert_int_equal(frames_measured(), -1);
}

/* ---- poses ----------------------------------------------------------------------------------- */

/* Frame i's pose as text. */
static void set_pose(int i, const char *pose) {
    char *at = row[i + 1];
    for (int commas = 0; commas < 3; commas++)
        at = strchr(at, ',') + 1;
    strcpy(at, pose);
    write_rows();
}

static void poses_that_are_none(void **state) {
    (void)state;
    static const char *const bad[] = {"nan,0,0,0,0,0", "1,2,inf,0,0,0",  "1,2,3,0,0,1e999",
                                      "1,2,3,0,0,",    "1,2,3,0,0,zero", "1,2,3,0,0"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        set_pose(4, bad[i]);
        fails(CHAIN, 4, "frames.csv:6: ", "frames.csv has the columns"); /* the header is line 1 */
    }
    assert_int_equal(frames_measured(), -1);
}

static void no_poses_at_all(void **state) {
    (void)state;
    process p = run("imagesrc location=. camera=camera.json " MEASURE);
    assert_one_error(&p, "a folder", 2,
                     "reconstruct needs the layer 'pose', which nothing before it gives",
                     "reconstruct", NULL);
    for (int i = 0; i < FRAMES; i++)
        set_pose(i, ",,,,,");
    p = run(CHAIN);
    assert_one_error(&p, "empty poses", 2, "reconstruct needs the layer 'pose'", "reconstruct",
                     NULL);
    p = run("imagesrc location=frames.csv ! edges ! undistort ! segments ! track ! filesink "
            "location=tracks.csv"); /* which needs none */
    assert_int_equal(p.code, 0);
    process_free(&p);
}

/* A frame whose pose is missing is left out, and the user is told. */
static void some_poses_are_missing(void **state) {
    (void)state;
    set_pose(3, ",,,,,");
    set_pose(8, ",,,,,");
    process p = arris_begin(scratch("scan"), -1, "launch --stats " CHAIN);
    process_wait(&p);
    assert_int_equal(p.code, 0);
    assert_non_null(strstr(p.err, "arris: warning: reconstruct: frame 3: "));
    assert_non_null(strstr(p.out, "without pose 2"));
    assert_int_equal(frames_measured(), FRAMES - 2);
    process_free(&p);
}

/* ---- where results go ------------------------------------------------------------------------ */

static void a_folder_that_is_not_there(void **state) {
    (void)state;
    static const char *const files[] = {"lines.json", "lines.svg", "lines.ply", "segments.csv",
                                        "tracks.csv"};
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        char line[400], text[100];
        snprintf(line, sizeof line,
                 "imagesrc location=frames.csv ! edges ! undistort ! segments ! track "
                 "! reconstruct ! filesink location=none/%s",
                 files[i]);
        snprintf(text, sizeof text, "cannot write none/%s: No such file", files[i]);
        process p = run(line); /* before the first frame */
        assert_one_error(&p, line, 4, text, "filesink", "create the folder first");
    }
}

/* A file system of its own with no room left. Nothing of the file stays behind. */
static void a_full_disk(void **state) {
    (void)state;
    static const char mounted[] =
        "mount -t tmpfs -o size=64k none full && { cat /dev/zero > full/fill 2>/dev/null; "
        "\"$0\" launch \"$1\"; rc=$?; ls -A full; exit $rc; }";
    static const char line[] =
        "imagesrc location=frames.csv ! edges ! undistort ! segments ! track "
        "! reconstruct ! filesink location=full/lines.json";
    char arris[PATH_MAX],
        *unshare = access("/usr/bin/unshare", X_OK) ? NULL : (char *)"/usr/bin/unshare";
    if (!realpath(arris_path(), arris))
        fail_msg("no %s", arris_path());
    scratch_mkdir("scan/full");
    char *probe[] = {unshare,         (char *)"-rm",  (char *)"mount", (char *)"-t",
                     (char *)"tmpfs", (char *)"none", (char *)"/tmp",  NULL};
    process p = {.code = 1};
    if (unshare) {
        p = process_start(NULL, -1, probe);
        process_wait(&p);
        process_free(&p);
    }
    if (p.code != 0) {
        print_message("no file system of its own may be mounted here: skipped; test_files fills a "
                      "disk by a limit\n");
        skip();
    }
    p = process_start(scratch("scan"), -1,
                      (char *[]){unshare, (char *)"-rm", (char *)"/bin/sh", (char *)"-c",
                                 (char *)mounted, arris, (char *)line, NULL});
    process_wait(&p);
    assert_string_equal(p.out, "fill\n");
    *p.out = '\0';
    assert_one_error(&p, line, 4, "cannot write full/lines.json: ", NULL, "free some space");
}

/* ---- and all the same ------------------------------------------------------------------------ */

static void queues_change_no_byte(void **state) {
    (void)state;
    static const char *const line[] = {
        CHAIN, CHAIN,
        "imagesrc location=frames.csv ! queue ! edges ! queue ! undistort ! queue max-frames=1 ! "
        "segments ! queue ! track ! queue max-frames=5 ! reconstruct ! queue ! filesink "
        "location=lines.json"};
    char *first = NULL;
    for (size_t i = 0; i < sizeof line / sizeof *line; i++) {
        process p = run(line[i]);
        assert_int_equal(p.code, 0);
        process_free(&p);
        char *text = file_text(scratch("scan/lines.json"));
        if (first)
            assert_string_equal(text, first);
        else
            first = strdup(text);
        free(text);
    }
    assert_true(strlen(first) > 100);
    free(first);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_good_scan, make_scan),
        cmocka_unit_test_setup(a_truncated_picture, make_scan),
        cmocka_unit_test_setup(pictures_of_different_sizes, make_scan),
        cmocka_unit_test_setup(the_first_picture, make_scan),
        cmocka_unit_test_setup(odd_pictures_are_measured, make_scan),
        cmocka_unit_test_setup(places_without_frames, make_scan),
        cmocka_unit_test_setup(cameras, make_scan),
        cmocka_unit_test_setup(poses_that_are_none, make_scan),
        cmocka_unit_test_setup(no_poses_at_all, make_scan),
        cmocka_unit_test_setup(some_poses_are_missing, make_scan),
        cmocka_unit_test_setup(a_folder_that_is_not_there, make_scan),
        cmocka_unit_test_setup(a_full_disk, make_scan),
        cmocka_unit_test_setup(queues_change_no_byte, make_scan),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
