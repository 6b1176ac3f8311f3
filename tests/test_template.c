/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_template.c: a plugin from elsewhere. Arris is installed into an empty folder,
 * samples/template is copied out of the tree and built from what was installed, and the installed
 * program runs it.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <sys/wait.h>

#include <cmocka.h>

#include "scratch.h"

static char root[PATH_MAX],
    said[1 << 16]; /* where Arris is installed; what the last command said */

/* Runs a command line with sh and keeps what it says. Returns its exit code. */
__attribute__((format(printf, 1, 2))) static int shell(const char *format, ...) {
    char command[8192] = "exec 2>&1; ";
    size_t n = strlen(command);
    va_list ap;
    va_start(ap, format);
    vsnprintf(command + n, sizeof command - n, format, ap);
    va_end(ap);
    FILE *f = popen(command, "r");
    assert_non_null(f);
    said[fread(said, 1, sizeof said - 1, f)] = '\0';
    int status = pclose(f);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

/* The same for what must succeed: prints what it said when it doesn't. */
#define RUN(...) (shell(__VA_ARGS__) ? (print_error("%s\n", said), 1) : 0)

/* What a third party has: the installed tree, and no variables of this build's make. */
#define THIRD_PARTY                                                                                \
    "cd '%s/template' && unset MAKEFLAGS MAKELEVEL MFLAGS && "                                     \
    "export PKG_CONFIG_SYSROOT_DIR='%s' PKG_CONFIG_PATH='%s/usr/lib/pkgconfig' && "

static int arris(const char *arguments) {
    return shell("cd '%s' && ARRIS_PLUGIN_PATH=template usr/bin/arris %s", root, arguments);
}

/* Three pictures of 20x10; number i has 50 i bright pixels, the others are dark. */
static int write_pictures(const char *folder, int greatest, int bright, int dark) {
    scratch_mkdir(folder);
    for (int i = 1; i <= 3; i++) {
        char name[64];
        snprintf(name, sizeof name, "%s/%d.pgm", folder, i);
        FILE *f = fopen(scratch(name), "w");
        if (!f)
            return 1;
        fprintf(f, "P5\n20 10\n%d\n", greatest);
        for (int k = 0; k < 200; k++) {
            int grey = k < 50 * i ? bright : dark;
            if (greatest > 255)
                fputc(grey >> 8, f);
            fputc(grey & 255, f);
        }
        if (fclose(f))
            return 1;
    }
    return 0;
}

static const char *build_folder(void) {
    const char *b = getenv("B");
    return b ? b : "build";
}

static int install(void **state) {
    (void)state;
    snprintf(root, sizeof root, "%s", scratch("."));
    return RUN("make --no-print-directory B='%s' DESTDIR='%s' PREFIX=/usr install", build_folder(),
               root) ||
           RUN("mkdir '%s'/template && cp samples/template/*.c samples/template/Makefile "
               "'%s'/template",
               root, root) ||
           write_pictures("grey8", 255, 200, 50) || write_pictures("grey16", 65535, 60000, 1000);
}

/* The number behind `what` in the line of --stats that begins with `stage` and a blank. */
static long stat_of(const char *stage, const char *what) {
    size_t n = strlen(stage);
    for (const char *l = said; *l; l += strcspn(l, "\n") + 1) {
        const char *end = l + strcspn(l, "\n"), *at = strstr(l, what);
        if (strncmp(l, stage, n) == 0 && l[n] == ' ' && at && at < end)
            return strtol(at + strlen(what), NULL, 10);
        if (!*end)
            break;
    }
    return -1;
}

static void builds_from_what_is_installed(void **state) {
    (void)state;
    assert_int_equal(
        RUN(THIRD_PARTY "make CFLAGS='-Wall -Wextra -Wpedantic -Werror'", root, root, root), 0);
    assert_non_null(strstr(said, "-std=c11"));
}

static void headers_stand_alone(void **state) {
    (void)state;
    const char *const languages[] = {"cc -std=c11 -x c", "c++ -std=c++17 -x c++"};
    for (int i = 0; i < 2; i++)
        assert_int_equal(RUN(THIRD_PARTY "for h in arris.h arris_plugin.h; do "
                                         "echo \"#include <$h>\" | %s -Wall -Wextra -Wpedantic "
                                         "-Werror -fsyntax-only $(pkg-config --cflags arris) - "
                                         "|| exit 1; done",
                             root, root, root, languages[i]),
                         0);
}

/* udev would pass over a file that is elsewhere in silence. */
static void cameras_may_be_opened(void **state) {
    (void)state;
    assert_int_equal(RUN("grep -q 'ID_USB_INTERFACES.*0e01.*GROUP=\"video\"' "
                         "'%s'/usr/lib/udev/rules.d/60-arris-usb.rules",
                         root),
                     0);
}

static void null_passes_frames(void **state) {
    (void)state;
    assert_int_equal(arris("launch --stats fakesrc frames=9 ! null ! fakesink"), 0);
    assert_int_equal(stat_of("null", "null"), 9);
    assert_int_equal(stat_of("fakesink", "fakesink"), 9);
}

static void threshold_is_explained(void **state) {
    (void)state;
    assert_int_equal(arris("stages threshold"), 0);
    assert_non_null(strstr(said, "0 to 65535 levels; default 128"));
    assert_non_null(strstr(said, "gives  image, user0"));
}

/* The second sees white only because the first made it so. */
static void threshold_gives_a_picture(void **state) {
    (void)state;
    assert_int_equal(arris("launch --stats imagesrc location=grey8 ! threshold level=100 "
                           "! threshold level=255 name=second ! fakesink"),
                     0);
    assert_int_equal(stat_of("second", "white pixels"), 300);
    assert_int_equal(arris("launch --stats imagesrc location=grey16 ! threshold level=30000 "
                           "! threshold level=65535 name=second ! fakesink"),
                     0);
    assert_int_equal(stat_of("second", "white pixels"), 300);
}

static void threshold_gives_a_layer_of_its_own(void **state) {
    (void)state;
    assert_int_equal(arris("launch --check imagesrc location=grey8 ! threshold give=count "
                           "! fakesink"),
                     0);
    assert_non_null(strstr(said, "image -> user0"));
    assert_int_equal(arris("launch --stats imagesrc location=grey8 ! threshold give=count "
                           "! threshold level=255 name=second ! fakesink"),
                     0);
    assert_int_equal(stat_of("threshold", "white pixels"), 300);
    assert_int_equal(stat_of("second", "white pixels"), 0); /* the picture was left alone */
}

static void threshold_drops_dark_frames(void **state) {
    (void)state;
    assert_int_equal(arris("launch --stats imagesrc location=grey8 ! threshold least=0.4 "
                           "! fakesink"),
                     0);
    assert_int_equal(stat_of("threshold", "threshold"), 3);
    assert_int_equal(stat_of("fakesink", "fakesink"), 2);
}

static void threshold_says_what_is_wrong(void **state) {
    (void)state;
    assert_int_equal(arris("launch imagesrc location=grey8 ! threshold level=300 ! fakesink"), 2);
    assert_non_null(strstr(said, "threshold: level=300 is above 255"));
    assert_int_equal(arris("launch imagesrc location=grey8 ! threshold level=-1 ! fakesink"), 2);
    assert_int_equal(arris("launch fakesrc frames=9 ! threshold ! fakesink"), 2);
    assert_non_null(strstr(said, "threshold needs the layer 'image'"));
}

/* Lines of a file; those of code only leave out the blank ones and those that are comment. */
static int count_lines(const char *path, bool code_only) {
    char line[512];
    int n = 0;
    bool comment = false;
    FILE *f = fopen(path, "r");
    assert_non_null(f);
    while (fgets(line, sizeof line, f)) {
        const char *text = line + strspn(line, " \t");
        comment |= strncmp(text, "/*", 2) == 0;
        n += !code_only || (!comment && *text != '\n');
        comment &= !strstr(text, "*/");
    }
    fclose(f);
    return n;
}

static void stages_are_cheap(void **state) {
    (void)state;
    assert_in_range(count_lines("samples/template/null.c", false), 1, 20);
    assert_in_range(count_lines("plugins/edges/edges.c", true), 1, 60);
}

static void uninstall_leaves_nothing(void **state) {
    (void)state;
    assert_int_equal(RUN("make --no-print-directory B='%s' DESTDIR='%s' PREFIX=/usr uninstall",
                         build_folder(), root),
                     0);
    assert_int_equal(RUN("find '%s/usr' ! -type d -o -name '*arris*'", root), 0);
    assert_string_equal(said, "");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(builds_from_what_is_installed),
        cmocka_unit_test(headers_stand_alone),
        cmocka_unit_test(cameras_may_be_opened),
        cmocka_unit_test(null_passes_frames),
        cmocka_unit_test(threshold_is_explained),
        cmocka_unit_test(threshold_gives_a_picture),
        cmocka_unit_test(threshold_gives_a_layer_of_its_own),
        cmocka_unit_test(threshold_drops_dark_frames),
        cmocka_unit_test(threshold_says_what_is_wrong),
        cmocka_unit_test(stages_are_cheap),
        cmocka_unit_test(uninstall_leaves_nothing),
    };
    return cmocka_run_group_tests(tests, install, NULL);
}
