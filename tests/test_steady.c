/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_steady.c: once the first frames are through, nothing is allocated in core or in our stages,
 * and a pipeline that runs on and on holds no more memory than in the beginning.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "process.h"
#include "scratch.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define SANITIZED 1
#else
#define SANITIZED 0
#endif

#define SINKS                                                                                      \
    "tee name=t t. ! filesink location=lines.json t. ! filesink location=lines.svg t. ! filesink " \
    "location=segments.csv t. ! queue ! filesink location=tracks.csv t. ! lcmsink url=memq:// "    \
    "segments=every images=every preview=10 t. ! "

static void skip_when_sanitized(void) {
    if (!SANITIZED)
        return;
    print_message("skipped: under a sanitizer, which allocates for itself\n");
    skip();
}

/* ---- a small scan ---------------------------------------------------------------------------- */

enum { W = 64, H = 48, N = 25 };

/* A bright square on its corner, 500 mm away, the camera moving to the right by 4 mm a frame. */
static void write_picture(int i) {
    char name[64];
    uint8_t pixel[H][W];
    snprintf(name, sizeof name, "scan/%d.pgm", i);
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++) {
            bool in = abs(x - 43 + i) + abs(y - 24) < 18;
            pixel[y][x] = (uint8_t)((in ? 200 : 60) + (x * 7 + y * 13 + i * 5) % 5);
        }
    FILE *f = fopen(scratch(name), "w");
    if (!f || fprintf(f, "P5 %d %d 255\n", W, H) < 0 ||
        fwrite(pixel, 1, sizeof pixel, f) != sizeof pixel || fclose(f))
        fail_msg("cannot write %s", name);
}

static void make_scan(void) {
    char csv[100 * N] = "index,file,utime,x,y,z,omega,theta,kappa\n";
    scratch_mkdir("scan");
    for (int i = 0; i < N; i++) {
        write_picture(i);
        snprintf(csv + strlen(csv), 100, "%d,%d.pgm,%d,%d,0,0,0,0,0\n", i, i, 40000 * i, 4 * i);
    }
    scratch_write("scan/frames.csv", "%s", csv);
    scratch_write(
        "scan/camera.json",
        "{\"width\": %d, \"height\": %d, \"fx\": 125, \"fy\": 125, \"skew\": 0, \"cx\": 31.5, "
        "\"cy\": 23.5, \"k1\": -0.05, \"k2\": 0, \"p1\": 0, \"p2\": 0, \"k3\": 0}",
        W, H);
}

/* Runs a line in the folder of that name, with the interposer. */
static void run(const char *folder, const char *line) {
    char preload[PATH_MAX], path[PATH_MAX];
    const char *b = getenv("B");
    snprintf(path, sizeof path, "%s/tests/preload/count_alloc.so", b ? b : "build");
    if (!realpath(path, preload))
        fail_msg("%s is not there", path);
    setenv("LD_PRELOAD", preload, 1);
    process p = arris_launch(scratch(folder), line);
    unsetenv("LD_PRELOAD");
    if (p.code)
        fail_msg("'%s' ends with %d and says:\n%s", line, p.code, p.err);
    process_free(&p);
}

/* ---- allocations ----------------------------------------------------------------------------- */

static bool is_ours(const char *file) {
    return strstr(file, "/libarris") || strstr(file, "/lib/arris/") || strstr(file, "/plugins/") ||
           strstr(file, "/arris") == file + strlen(file) - 6;
}

/* Allocations by us from frame 30 to `to`; tells those by others. */
static unsigned long count_ours(const char *line) {
    unsigned long ours = 0, n;
    char file[PATH_MAX], place[1000];
    unlink(scratch("scan/allocations"));
    run("scan", line);
    FILE *f = fopen(scratch("scan/allocations"), "r");
    assert_non_null(f);
    while (fscanf(f, "%lu %4095s %999[^\n]", &n, file, place) == 3) {
        print_message("  %6lu by %s%s, %s\n", n, is_ours(file) ? "us: " : "", file, place);
        ours += is_ours(file) ? n : 0;
    }
    fclose(f);
    return ours;
}

/* On our own pictures and, since PNG and the lens are dealt with by others, on the box. */
static void nothing_is_allocated(void **state) {
    (void)state;
    static const char *const chain[] = {
        "edges ! undistort ! segments ! track ! reconstruct",
        "edges ! undistort ! segments ! track ! reconstruct ! adjust window=8",
        "undistort ! edges ! segments ! track ! reconstruct",
        "edges ! queue ! undistort ! tee name=u u. ! queue leaky=oldest ! fakesink u. ! queue ! "
        "segments ! track ! queue ! reconstruct ! rate fps=20 ! identity"};
    skip_when_sanitized();
    make_scan();
    char box[PATH_MAX], line[2 * PATH_MAX];
    if (!realpath("samples/box/frames.csv", box))
        fail_msg("samples/box is not there: run from the root of the checkout");
    const char *const scan[] = {"frames.csv", box};
    for (size_t k = 0; k < 2; k++)
        for (size_t i = 0; i < sizeof chain / sizeof *chain; i++) {
            snprintf(line, sizeof line,
                     "imagesrc location=%s loop=%d ! %s ! " SINKS
                     "testwatch to=200 allocations=allocations",
                     scan[k], k ? 2 : 10, chain[i]);
            print_message("%s of %s, from frame 30 to 200:\n", chain[i], k ? "the box" : "ours");
            assert_int_equal(count_ours(line), 0);
        }
}

/* Nor by the simulated camera, or where its frames are recorded; libpng and libc do for themselves.
 */
static void nothing_is_allocated_by_the_camera(void **state) {
    (void)state;
    skip_when_sanitized();
    char cell[PATH_MAX], line[2 * PATH_MAX];
    if (!realpath("samples/cell/box.obj", cell))
        fail_msg("samples/cell is not there: run from the root of the checkout");
    make_scan();
    scratch_mkdir("scan/out");
    snprintf(line, sizeof line,
             "scenesrc location=%s frames=210 jitter=0.1 ! tee name=t t. ! filesink "
             "location=out/frames.csv t. ! testwatch to=200 allocations=allocations",
             cell);
    assert_int_equal(count_ours(line), 0);
}

/* From a log of LCM messages, which liblcm reads into memory that it allocates. */
static void nothing_is_allocated_for_what_comes_in(void **state) {
    (void)state;
    skip_when_sanitized();
    make_scan();
    run("scan", "imagesrc location=frames.csv loop=10 ! lcmsink images=every "
                "url=file://run.lcmlog?mode=w");
    assert_int_equal(count_ours("lcmsrc url=file://run.lcmlog camera=camera.json ! pose "
                                "location=frames.csv ! edges ! undistort ! segments ! track ! "
                                "reconstruct ! testwatch to=200 allocations=allocations"),
                     0);
}

/* What does allocate is found: here testwatch itself, when it looks at the memory. */
static void the_counting_counts(void **state) {
    (void)state;
    skip_when_sanitized();
    make_scan();
    assert_true(count_ours("imagesrc location=frames.csv loop=20 ! testwatch to=200 every=10 "
                           "memory=memory allocations=allocations") >= 16);
}

/* ---- memory ---------------------------------------------------------------------------------- */

static void memory_is_flat(void **state) {
    (void)state;
    skip_when_sanitized();
    make_scan();
    char line[1000];
    snprintf(
        line, sizeof line,
        "imagesrc location=frames.csv loop=%d ! edges ! undistort ! segments ! track ! queue ! "
        "reconstruct ! tee name=t t. ! filesink location=lines.json t. ! testwatch every=1000 "
        "memory=memory",
        10000 / N + 1);
    run("scan", line);
    char *lines = file_text(scratch("scan/lines.json"));
    assert_non_null(strstr(lines, "\"measured\"")); /* there was something to do */
    free(lines);
    FILE *f = fopen(scratch("scan/memory"), "r");
    long frame, pages, at_1000 = 0, last = 0;
    while (f && fscanf(f, "%ld %ld", &frame, &pages) == 2) {
        print_message("  frame %5ld: %ld kB\n", frame, pages * sysconf(_SC_PAGESIZE) / 1024);
        at_1000 = frame == 1000 ? pages : at_1000;
        last = pages;
    }
    assert_non_null(f);
    fclose(f);
    assert_int_equal(frame, 10000);
    assert_true(at_1000 > 0 && last <= at_1000 + 16); /* 64 kB: 7 bytes a frame */
}

int main(void) {
    scratch_mkdir("plugins");
    scratch_link("plugins/watch.so", "tests/plugins/watch.so");
    setenv("ARRIS_PLUGIN_PATH", scratch("plugins"), 1);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nothing_is_allocated),
        cmocka_unit_test(nothing_is_allocated_by_the_camera),
        cmocka_unit_test(nothing_is_allocated_for_what_comes_in),
        cmocka_unit_test(the_counting_counts),
        cmocka_unit_test(memory_is_flat),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
