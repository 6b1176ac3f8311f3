/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_box.c: the whole chain on recorded frames. The recipe of the box runs in the program as a
 * user would run it, and its lines are scored against the truth.
 *
 * With tau the distance (mm) within which a point of one line lies on another one that is parallel
 * to 8 degrees: recall is the share of the observable true length that measured lines cover,
 * precision the share of the measured length that lies on a true edge, rms the RMS distance from
 * the true edges to the measured lines where these cover them.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>
#include <jansson.h>

#include "process.h"
#include "scratch.h"

#define EXACT "../shared/data/exact_x"

/* ---- the scorer ----------------------------------------------------------------------------- */

enum { MAX_LINES = 4096 };

typedef struct line {
    double p[3], q[3];
    bool counts; /* measured, or observable */
    bool in_cad;
} line;

typedef struct score {
    double recall, precision, rms;
} score;

typedef struct sums {
    double length, covered, squares;
    long points;
} sums;

static double length(const line *l) {
    return hypot(hypot(l->q[0] - l->p[0], l->q[1] - l->p[1]), l->q[2] - l->p[2]);
}

/* The true edges, or the lines that were measured. */
static size_t load(const char *path, bool truth, line l[MAX_LINES]) {
    json_error_t e;
    json_t *root = json_load_file(path, 0, &e), *lines = json_object_get(root, "lines"), *o;
    size_t i;
    if (!root)
        fail_msg("%s: %s", path, e.text);
    assert_in_range(json_array_size(lines), 1, MAX_LINES);
    json_array_foreach(lines, i, o) {
        const char *state = "";
        int observable = 1, in_cad = 0;
        l[i] = (line){0};
        assert_int_equal(json_unpack(o, "{s:[FFF!], s:[FFF!], s?s, s?b, s?b}", "p", &l[i].p[0],
                                     &l[i].p[1], &l[i].p[2], "q", &l[i].q[0], &l[i].q[1],
                                     &l[i].q[2], "state", &state, "observable", &observable,
                                     "in_cad", &in_cad),
                         0);
        l[i].counts = truth ? observable && length(&l[i]) >= 15 : strcmp(state, "measured") == 0;
        l[i].in_cad = in_cad;
    }
    json_decref(root);
    return i;
}

static bool parallel(const line *a, const line *b) {
    double dot = 0;
    for (int i = 0; i < 3; i++)
        dot += (a->q[i] - a->p[i]) * (b->q[i] - b->p[i]);
    return fabs(dot) > cos(8 * M_PI / 180) * length(a) * length(b);
}

/* The distance of X from the line through `l`; INFINITY when X is beside its ends by more than 3
 * mm.
 */
static double distance(const double X[3], const line *l) {
    double n = length(l), t = 0, d = 0;
    for (int i = 0; i < 3; i++)
        t += (X[i] - l->p[i]) * (l->q[i] - l->p[i]) / n;
    for (int i = 0; i < 3; i++) {
        double e = X[i] - l->p[i] - t * (l->q[i] - l->p[i]) / n;
        d += e * e;
    }
    return t > -3 && t < n + 3 ? sqrt(d) : INFINITY;
}

/* Adds how the lines `by` cover `l`, in steps of about 1 mm. */
static void cover(const line *l, const line *by, size_t n, bool all, double tau, sums *s) {
    int steps = (int)fmax(1, ceil(length(l)));
    for (int k = 0; k <= steps; k++) {
        double X[3], t = (double)k / steps;
        bool hit = false;
        for (int i = 0; i < 3; i++)
            X[i] = l->p[i] + t * (l->q[i] - l->p[i]);
        for (size_t i = 0; i < n; i++) {
            double d = (all || by[i].counts) && parallel(l, &by[i]) ? distance(X, &by[i]) : tau;
            if (d < tau) {
                hit = true;
                s->squares += d * d;
                s->points++;
            }
        }
        s->covered += hit ? length(l) / (steps + 1) : 0;
    }
    s->length += length(l);
}

static score score_of(const char *lines_path, const char *truth_path, double tau) {
    static line measured[MAX_LINES], edge[MAX_LINES];
    size_t n = load(lines_path, false, measured), m = load(truth_path, true, edge);
    sums found = {0}, right = {0};
    for (size_t i = 0; i < m; i++)
        if (edge[i].counts)
            cover(&edge[i], measured, n, false, tau, &found);
    for (size_t i = 0; i < n; i++)
        if (measured[i].counts)
            cover(&measured[i], edge, m, true, tau, &right);
    score s = {found.covered / found.length, right.length > 0 ? right.covered / right.length : 0,
               sqrt(found.squares / (double)found.points)};
    print_message("recall %.3f  precision %.3f  rms_mm %.3f\n", s.recall, s.precision, s.rms);
    return s;
}

/* ---- the box -------------------------------------------------------------------------------- */

static const char *absolute(const char *path) {
    static char whole[PATH_MAX];
    if (!realpath(path, whole))
        fail_msg("%s is missing", path);
    return whole;
}

/* Runs `arris launch` in a new folder of the scratch folder. */
static void launch(const char *name, const char *pipeline) {
    process p = arris_launch(scratch_mkdir(name), pipeline);
    if (p.code)
        fail_msg("exit code %d: %s", p.code, p.err);
    process_free(&p);
}

static int run_recipe(void **state) {
    (void)state;
    launch("box", absolute("samples/box/box.arris"));
    return 0;
}

static void lines_are_those_of_the_box(void **state) {
    (void)state;
    score s = score_of(scratch("box/lines.json"), "samples/box/truth.json", 3);
    assert_true(s.recall >= 0.80);
    assert_true(s.precision >= 0.80);
    assert_true(s.rms <= 1.5);
}

/* The longest line on an edge. What lies on it is judged from above, so that its depth is free
 * within 5 %. */
static const line *longest_on(const line *edge, const line *by, size_t n) {
    const line *best = NULL;
    for (size_t i = 0; i < n; i++) {
        const double *p = by[i].p, *q = by[i].q;
        double X[3] = {(p[0] + q[0]) / 2, (p[1] + q[1]) / 2, edge->p[2]};
        bool near = fabs((p[2] + q[2]) / 2 - edge->p[2]) < 0.05 * edge->p[2];
        if (by[i].counts && near && parallel(&by[i], edge) && distance(X, edge) < 4 &&
            (!best || length(&by[i]) > length(best)))
            best = &by[i];
    }
    return best;
}

static void top_edges_are_at_their_depth(void **state) {
    (void)state;
    static line measured[MAX_LINES], edge[MAX_LINES];
    size_t n = load(scratch("box/lines.json"), false, measured);
    size_t m = load("samples/box/truth.json", true, edge);
    int edges = 0;
    for (size_t i = 0; i < m; i++) {
        if (!edge[i].counts || !edge[i].in_cad)
            continue;
        const line *l = longest_on(&edge[i], measured, n);
        assert_non_null(l);
        double off = (l->p[2] + l->q[2]) / 2 - edge[i].p[2];
        print_message("depth %.2f mm, %+.2f mm off\n", edge[i].p[2], off);
        assert_true(fabs(off) <= 0.005 * edge[i].p[2]);
        edges++;
    }
    assert_int_equal(edges, 2);
}

/* Every file that the recipe writes is the same, byte for byte. */
static void assert_same_files(const char *name) {
    static const char *const files[] = {"lines.json", "lines.svg", "lines.ply", "tracks.csv"};
    for (int i = 0; i < 4; i++) {
        char path[2][64];
        snprintf(path[0], sizeof path[0], "box/%s", files[i]);
        snprintf(path[1], sizeof path[1], "%s/%s", name, files[i]);
        char *a = file_text(scratch(path[0])), *b = file_text(scratch(path[1]));
        assert_true(*a);
        assert_string_equal(a, b);
        free(a);
        free(b);
    }
}

static void again_is_the_same(void **state) {
    (void)state;
    launch("again", absolute("samples/box/box.arris"));
    assert_same_files("again");
}

/* The same recipe with a queue at every '!'. It stands in a folder of its own, and with it links to
 * what it reads. */
static void with_queues_is_the_same(void **state) {
    (void)state;
    static const char *const inputs[] = {"frames.csv", "camera.json", "frames"};
    char *recipe = file_text("samples/box/box.arris"), queued[8192] = "";
    scratch_mkdir("recipe");
    for (int i = 0; i < 3; i++) {
        char from[64], to[64];
        snprintf(from, sizeof from, "samples/box/%s", inputs[i]);
        snprintf(to, sizeof to, "recipe/%s", inputs[i]);
        assert_int_equal(symlink(absolute(from), scratch(to)), 0);
    }
    for (char *at = recipe, *end; *at; at = end) {
        size_t n = strlen(queued);
        end = strchr(at, '!') ? strchr(at, '!') + 1 : at + strlen(at);
        snprintf(queued + n, sizeof queued - n, "%.*s%s", (int)(end - at), at,
                 end[-1] == '!' ? " queue !" : "");
    }
    free(recipe);
    assert_non_null(strstr(queued, "! queue ! reconstruct"));
    launch("queues", scratch_write("recipe/queues.arris", "%s", queued));
    assert_same_files("queues");
}

/* ---- the report of the demo ----------------------------------------------------------------- */

static process report(const char *lines, const char *truth) {
    char path[PATH_MAX];
    const char *b = getenv("B");
    snprintf(path, sizeof path, "%s/report", b ? b : "build");
    process p = process_start(NULL, -1, (char *[]){path, (char *)lines, (char *)truth, NULL});
    process_wait(&p);
    return p;
}

static void report_shows_the_depth(void **state) {
    (void)state;
    process p = report(scratch("box/lines.json"), "samples/box/truth.json");
    assert_int_equal(p.code, 0);
    assert_non_null(strstr(p.out, "top-left"));
    assert_null(strstr(p.out, "not measured"));
    assert_null(strstr(p.out, "nan"));
    process_free(&p);
}

static void report_tells_when_nothing_was_measured(void **state) {
    (void)state;
    process p = report(scratch_write("none.json", "{\"lines\": []}"), "samples/box/truth.json");
    assert_int_equal(p.code, 1);
    assert_non_null(strstr(p.out, "not measured"));
    process_free(&p);
}

static void report_says_what_it_cannot_read(void **state) {
    (void)state;
    static const char *const bad[] = {"", "{}", "{\"lines\": [{\"state\": \"measured\"}]}"};
    for (int i = 0; i < 3; i++) {
        process p = report(scratch_write("bad.json", "%s", bad[i]), "samples/box/truth.json");
        assert_int_equal(p.code, 2);
        assert_non_null(strstr(p.err, "bad.json"));
        process_free(&p);
    }
}

/* ---- another scene --------------------------------------------------------------------------- */

static void standard_scan_is_exact(void **state) {
    (void)state;
    char pipeline[PATH_MAX + 256];
    if (access(EXACT "/frames.csv", R_OK)) {
        print_message("skipped: there is no " EXACT "\n");
        skip();
    }
    snprintf(pipeline, sizeof pipeline,
             "imagesrc location='%s' ! edges ! undistort ! segments ! track "
             "! reconstruct pose-sigma=0 rot-sigma=0 ! filesink location=lines.json",
             absolute(EXACT "/frames.csv"));
    launch("exact", pipeline);
    score s = score_of(scratch("exact/lines.json"), EXACT "/truth.json", 1);
    assert_true(s.recall >= 0.85);
    assert_true(s.rms <= 0.40);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lines_are_those_of_the_box),
        cmocka_unit_test(top_edges_are_at_their_depth),
        cmocka_unit_test(again_is_the_same),
        cmocka_unit_test(with_queues_is_the_same),
        cmocka_unit_test(report_shows_the_depth),
        cmocka_unit_test(report_tells_when_nothing_was_measured),
        cmocka_unit_test(report_says_what_it_cannot_read),
        cmocka_unit_test(standard_scan_is_exact),
    };
    return cmocka_run_group_tests(tests, run_recipe, NULL);
}
