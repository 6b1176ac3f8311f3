/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_files.c: what filesink writes, read back as its readers would: JSON by jansson, meshes and
 * tables by their formats' rules, the figure by its own axes; and what it does when it can't write.
 */
#include <dirent.h>
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/resource.h>

#include <cmocka.h>
#include <jansson.h>

#include "arris_geometry.h"
#include "files/html.h"
#include "files/output.h"
#include "files/writers.h"
#include "process.h"
#include "scratch.h"

/* ---- lines that are known ---------------------------------------------------------------------
 */

enum { N_LINES = 7 };
static arris_line line[N_LINES];
static const arris_lines lines = {.n = N_LINES,
                                  .max = N_LINES,
                                  .frames = 135,
                                  .scale_sigma = 2e-4,
                                  .pose_sigma = 0.28,
                                  .item = line};

/* Measured, measured, weak, unobservable, merged, one with a NaN end, one with an infinite cov. */
static int make_lines(void **state) {
    (void)state;
    for (int i = 0; i < N_LINES; i++) {
        line[i] = (arris_line){.id = 3 * i,
                               .views = 10u + (unsigned)i,
                               .into = -1,
                               .baseline = 553.125 + i / 3.,
                               .rms = 0.2 + i / 7.};
        for (int k = 0; k < 3; k++) {
            line[i].p[k] = 100 * sin(3.7 * i + k);
            line[i].q[k] = line[i].p[k] + (k == 1 ? 250 : 10 / 3.);
        }
        for (int k = 0; k < 21; k++)
            line[i].cov[k] = pow(10, -k) / 3;
    }
    line[2].state = ARRIS_WEAK;
    line[3].state = ARRIS_UNOBSERVABLE;
    line[3].p[0] = 1e300;
    line[4].change = ARRIS_MERGED;
    line[5].q[2] = NAN;
    line[6].cov[20] = INFINITY;
    return 0;
}

/* What a writer writes, for free(). */
static char *text_of(void (*write)(FILE *, const arris_lines *), const arris_lines *l) {
    char *text = NULL;
    size_t n;
    FILE *f = open_memstream(&text, &n);
    write(f, l);
    assert_int_equal(ferror(f), 0);
    assert_int_equal(fclose(f), 0);
    assert_null(strstr(text, "nan"));
    assert_null(strstr(text, "inf"));
    return text;
}

/* ---- json -------------------------------------------------------------------------------------
 */

static void same_numbers(json_t *array, const double *v, size_t n, double tolerance) {
    assert_int_equal(json_array_size(array), n);
    for (size_t i = 0; i < n; i++)
        assert_true(fabs(json_number_value(json_array_get(array, i)) - v[i]) <=
                    tolerance * fabs(v[i]));
}

static double number_of(json_t *o, const char *key) {
    assert_true(json_is_number(json_object_get(o, key)));
    return json_number_value(json_object_get(o, key));
}

static void json_holds_the_numbers(void **state) {
    (void)state;
    char *text = text_of(json_write, &lines);
    json_t *root = json_loads(text, JSON_REJECT_DUPLICATES, NULL);
    assert_string_equal(json_string_value(json_object_get(root, "format")), "arris-lines/1");
    assert_string_equal(json_string_value(json_object_get(root, "unit")), "mm");
    assert_true(number_of(root, "frames") == 135 && number_of(root, "scale_sigma") == 2e-4);
    assert_true(number_of(root, "pose_sigma") == 0.28);
    json_t *array = json_object_get(root, "lines");
    assert_int_equal(json_array_size(array), 5);
    const char *const states[] = {"measured", "measured", "weak", "unobservable", "weak"};
    for (size_t i = 0; i < 5; i++) {
        json_t *o = json_array_get(array, i);
        const arris_line *l = &line[i < 4 ? i : 6];
        assert_int_equal(json_integer_value(json_object_get(o, "id")), l->id);
        assert_int_equal(json_integer_value(json_object_get(o, "views")), l->views);
        assert_string_equal(json_string_value(json_object_get(o, "state")), states[i]);
        assert_true(fabs(number_of(o, "baseline") - l->baseline) < 1e-6);
        assert_true(fabs(number_of(o, "rms_px") - l->rms) < 1e-8);
        same_numbers(json_object_get(o, "p"), l->p, 3, 1e-8);
        same_numbers(json_object_get(o, "q"), l->q, 3, 1e-8);
        if (i < 4)
            same_numbers(json_object_get(o, "cov"), l->cov, 21, 1e-14);
        else
            assert_true(json_is_null(json_object_get(o, "cov")));
    }
    json_decref(root);
    free(text);
}

static void json_is_a_line_a_line(void **state) {
    (void)state;
    char *text = text_of(json_write, &lines), *again = text_of(json_write, &lines);
    int objects = 0;
    for (const char *at = text; (at = strstr(at, "\n{\"id\": ")); at++)
        objects++;
    assert_int_equal(objects, 5);
    assert_string_equal(text, again);
    free(text);
    free(again);
}

static void json_of_nothing(void **state) {
    (void)state;
    const arris_lines none = {.scale_sigma = NAN, .pose_sigma = INFINITY};
    char *text = text_of(json_write, &none);
    json_t *root = json_loads(text, 0, NULL);
    assert_non_null(root);
    assert_int_equal(json_array_size(json_object_get(root, "lines")), 0);
    assert_true(json_is_null(json_object_get(root, "scale_sigma")));
    json_decref(root);
    free(text);
}

/* ---- meshes: the two lines that are measured, and no other ------------------------------------
 */

static void same_point(const double *read, const double *p) {
    for (int k = 0; k < 3; k++)
        assert_true(fabs(read[k] - p[k]) < 1e-5);
}

static const double *end_of(int i) {
    return i % 2 ? line[i / 2].q : line[i / 2].p;
}

static void ply_holds_the_measured(void **state) {
    (void)state;
    char *text = text_of(ply_write, &lines), *body = strstr(text, "end_header\n");
    assert_memory_equal(text, "ply\nformat ascii 1.0\n", 21);
    assert_non_null(strstr(text, "\nelement vertex 4\nproperty double x\nproperty double y\n"
                                 "property double z\nelement edge 2\nproperty int vertex1\n"
                                 "property int vertex2\nend_header\n"));
    body += strlen("end_header\n");
    for (int i = 0; i < 4; i++) {
        double p[3];
        for (int k = 0; k < 3; k++)
            p[k] = strtod(body, &body);
        same_point(p, end_of(i));
    }
    assert_string_equal(body, "\n0 1\n2 3\n");
    free(text);
}

static void obj_holds_the_measured(void **state) {
    (void)state;
    char *text = text_of(obj_write, &lines), *save = NULL;
    int vertices = 0, edges = 0;
    for (char *l = strtok_r(text, "\n", &save); l; l = strtok_r(NULL, "\n", &save)) {
        double p[3];
        int a, b;
        if (sscanf(l, "v %lf %lf %lf", &p[0], &p[1], &p[2]) == 3) {
            same_point(p, end_of(vertices++));
        } else if (sscanf(l, "l %d %d", &a, &b) == 2) {
            assert_true(a == 2 * edges + 1 && b == a + 1);
            edges++;
        } else {
            assert_int_equal(*l, '#');
        }
    }
    assert_true(vertices == 4 && edges == 2);
    free(text);
}

/* DXF is pairs of lines, a group code and a value. */
static void dxf_holds_the_measured(void **state) {
    (void)state;
    char *text = text_of(dxf_write, &lines), *at = text, *value = NULL;
    int entities = 0, sections = 0;
    bool r12 = false;
    while (*at) {
        int code = (int)strtol(at, &at, 10);
        assert_int_equal(*at++, '\n');
        value = at;
        at = strchr(at, '\n');
        assert_non_null(at);
        *at++ = '\0';
        entities += code == 0 && strcmp(value, "LINE") == 0;
        sections += code == 0 ? !strcmp(value, "SECTION") - !strcmp(value, "ENDSEC") : 0;
        r12 |= code == 1 && strcmp(value, "AC1009") == 0;
        if (code >= 10 && code < 40) {
            const double *p = code % 10 ? line[entities - 1].q : line[entities - 1].p;
            assert_true(fabs(strtod(value, NULL) - p[code / 10 - 1]) < 1e-5);
        }
    }
    assert_true(entities == 2 && sections == 0 && r12);
    assert_string_equal(value, "EOF");
    free(text);
}

/* ---- a verdict --------------------------------------------------------------------------------
 */

static arris_feature features[] = {
    {.id = "top \"left\" <&>",
     .deviation = 0.12,
     .U = 0.08,
     .worst = -0.15,
     .worst_U = 0.09,
     .straightness = 0.01,
     .tolerance = 1,
     .verdict = ARRIS_PASS,
     .line = 3,
     .p = {0, 0, 0},
     .q = {100, 0, 0},
     .at = {{10, 0.1, 0}, {90, 0.15, 0}}},
    {.id = "b",
     .deviation = NAN,
     .U = NAN,
     .worst = NAN,
     .worst_U = NAN,
     .straightness = NAN,
     .tolerance = 1,
     .verdict = ARRIS_INDETERMINATE,
     .reason = "nothing was measured near it",
     .line = -1,
     .p = {NAN, NAN, NAN},
     .q = {NAN, NAN, NAN},
     .at = {{NAN, NAN, NAN}}},
};
static int32_t extra[] = {8, 9};
static const arris_verdict verdict = {.n = 2,
                                      .n_extra = 2,
                                      .verdict = ARRIS_INDETERMINATE,
                                      .tolerance = 1,
                                      .coverage_factor = 2,
                                      .model = "ab",
                                      .calibration = "cd",
                                      .item = features,
                                      .extra = extra};

static void write_verdict(FILE *out, const arris_lines *l) {
    (void)l;
    verdict_write(out, &verdict, "ef");
}

static void verdict_holds_the_numbers(void **state) {
    (void)state;
    char *text = text_of(write_verdict, &lines);
    json_t *root = json_loads(text, JSON_REJECT_DUPLICATES, NULL);
    json_t *list = json_object_get(root, "features"), *a = json_array_get(list, 0);
    json_t *b = json_array_get(list, 1), *hashes = json_object_get(root, "sha256");
    assert_string_equal(json_string_value(json_object_get(root, "format")), "arris-verdict/1");
    assert_string_equal(json_string_value(json_object_get(root, "verdict")), "INDETERMINATE");
    assert_true(number_of(root, "tolerance") == 1 && number_of(root, "coverage_factor") == 2);
    assert_string_equal(json_string_value(json_object_get(hashes, "recipe")), "ef");
    assert_int_equal(json_array_size(list), 2);
    assert_string_equal(json_string_value(json_object_get(a, "id")), features[0].id);
    assert_string_equal(json_string_value(json_object_get(a, "verdict")), "PASS");
    assert_true(number_of(a, "deviation") == 0.12 && number_of(a, "U") == 0.08);
    assert_true(number_of(a, "worst") == -0.15 && number_of(a, "line") == 3);
    assert_true(json_is_null(json_object_get(b, "deviation")) && !json_object_get(b, "line"));
    assert_string_equal(json_string_value(json_object_get(b, "reason")), features[1].reason);
    assert_int_equal(json_array_size(json_object_get(root, "extra_lines")), 2);
    json_decref(root);
    free(text);
}

static void svg_of_verdict(FILE *out, const arris_lines *l) {
    static const svg_cameras none;
    svg_write(out, l, &none, &verdict, SVG_ALL);
}

static void write_report(FILE *out, const arris_lines *l) {
    static const svg_cameras none;
    static uint8_t grey[6] = {0, 50, 100, 150, 200, 250};
    report r = {.width = 3,
                .height = 2,
                .grey = grey,
                .off = 1,
                .camera = {.width = 3, .height = 2, .fx = 1, .fy = 1},
                .pose = {.C = {0, 0, -100}, .R = {1, 0, 0, 0, 1, 0, 0, 0, 1}}};
    report_write(out, &r, &verdict, l, &none, "ef");
}

static void report_is_a_page_of_its_own(void **state) {
    (void)state;
    char *text = text_of(write_report, &lines);
    assert_non_null(strstr(text, "top &#34;left&#34; &#60;&#38;&#62;</td>"));
    assert_non_null(strstr(text, "<td>+0.120</td><td>0.080</td>"));
    assert_non_null(strstr(text, "nothing was measured near it"));
    assert_non_null(strstr(text, "data:image/png;base64,iVBORw0KGgo"));
    assert_null(strstr(text, "src=\"http"));
    free(text);
}

/* ---- the figure: read by its own axes ---------------------------------------------------------
 */

static svg_cameras cameras;

static void svg_all(FILE *out, const arris_lines *l) {
    svg_write(out, l, &cameras, NULL, SVG_ALL);
}
static void svg_zx(FILE *out, const arris_lines *l) {
    svg_write(out, l, &cameras, NULL, SVG_ZX);
}

static int occurrences(const char *text, const char *what) {
    int n = 0;
    for (; (text = strstr(text, what)); text++)
        n++;
    return n;
}

/* Every tag that opens closes again, in order. */
static void assert_well_formed(const char *text) {
    char open[32][16];
    int depth = 0;
    for (const char *at = text; (at = strchr(at, '<')); at++) {
        char name[16];
        const char *end = strchr(at, '>');
        assert_true(end && sscanf(at + 1 + (at[1] == '/'), "%15[a-z]", name) == 1);
        if (at[1] == '/')
            assert_string_equal(name, open[--depth]);
        else if (end[-1] != '/')
            strcpy(open[depth++], name);
        assert_in_range(depth, 0, 31);
    }
    assert_int_equal(depth, 0);
}

/* mm = a + b px, through the first and the last label of an axis. */
typedef struct axis {
    double a, b;
} axis;

static axis read_axis(const char *text, bool upright) {
    double px[2] = {0, 0}, mm[2] = {0, 0};
    int n = 0;
    for (const char *at = text; (at = strstr(at, "class=\"grid\" d=\"M")); at++) {
        double x, y, v;
        char direction;
        const char *label = strchr(at, '>') + 1;
        assert_int_equal(sscanf(at, "class=\"grid\" d=\"M%lf %lf%c", &x, &y, &direction), 3);
        assert_int_equal(sscanf(strchr(label, '>') + 1, "%lf", &v), 1);
        if ((direction == 'v') != upright)
            continue;
        px[n != 0] = upright ? x : y;
        mm[n != 0] = v;
        n++;
    }
    assert_in_range(n, 3, 12);
    double b = (mm[1] - mm[0]) / (px[1] - px[0]);
    return (axis){mm[0] - b * px[0], b};
}

static void figure_is_to_scale(void **state) {
    (void)state;
    for (int i = 0; i < 3; i++) {
        arris_pose pose = {
            .valid = true, .C = {100. * i, 5, -400}, .R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
        svg_add_camera(&cameras, &pose);
    }
    char *text = text_of(svg_zx, &lines), *at = text;
    axis x = read_axis(text, true), z = read_axis(text, false);
    assert_true(fabs(x.b + z.b) < 1e-3 * x.b); /* equal, and z upwards */
    for (int i = 0; i < 2; i++) {
        double e[4];
        at = strstr(at + 1, "class=\"measured\"");
        assert_int_equal(
            sscanf(at, "class=\"measured\" d=\"M%lf %lfL%lf %lf\"", &e[0], &e[1], &e[2], &e[3]), 4);
        assert_true(fabs(x.a + x.b * e[0] - line[i].p[0]) < 0.1);
        assert_true(fabs(z.a + z.b * e[1] - line[i].p[2]) < 0.1);
        assert_true(fabs(x.a + x.b * e[2] - line[i].q[0]) < 0.1);
        assert_true(fabs(z.a + z.b * e[3] - line[i].q[2]) < 0.1);
    }
    at = text;
    for (int i = 0; i < 3; i++) {
        double u, v;
        at = strstr(at + 1, "<circle");
        assert_int_equal(sscanf(at, "<circle cx=\"%lf\" cy=\"%lf\"", &u, &v), 2);
        assert_true(fabs(x.a + x.b * u - 100 * i) < 0.1 && fabs(z.a + z.b * v + 400) < 0.1);
    }
    free(text);
}

static void figure_has_three_views(void **state) {
    (void)state;
    char *text = text_of(svg_all, &lines);
    assert_well_formed(text);
    assert_int_equal(occurrences(text, "class=\"title\""), 3);
    assert_int_equal(occurrences(text, "class=\"measured\""), 3 * 2 + 1); /* one in the legend */
    assert_int_equal(occurrences(text, "class=\"weak\""), 3 * 2 + 1);
    assert_non_null(strstr(text, ">2 measured<"));
    assert_non_null(strstr(text, ">2 weak (1 unobservable hidden)<"));
    free(text);
}

/* A judged edge is drawn in each view, and what it is off at its ends. */
static void figure_has_the_verdict(void **state) {
    (void)state;
    char *text = text_of(svg_of_verdict, &lines);
    assert_well_formed(text);
    assert_int_equal(occurrences(text, "class=\"edge PASS\""), 3 * 3);
    assert_int_equal(occurrences(text, "class=\"edge INDETERMINATE\""), 0);
    assert_int_equal(occurrences(text, ">deviations &#215;"), 3);
    free(text);
}

static void figure_of_little(void **state) {
    (void)state;
    arris_line dot = {.p = {5, 5, 5}, .q = {5, 5, 5}},
               wild = {.p = {1e308, 0, 0}, .q = {-1e308, 0, 0}};
    arris_lines l[] = {{0}, {.n = 1, .item = &dot}, {.n = 1, .item = &wild}};
    cameras = (svg_cameras){0};
    for (int i = 0; i < 3; i++) {
        char *text = text_of(svg_zx, &l[i]);
        assert_well_formed(text);
        read_axis(text, true);
        free(text);
    }
}

static void cameras_are_thinned_out(void **state) {
    (void)state;
    svg_cameras c = {0};
    arris_pose none = {.valid = false}, bad = {.valid = true, .C = {NAN}};
    for (int i = 0; i < 1000; i++) {
        arris_pose p = {.valid = true, .C = {i}, .R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
        svg_add_camera(&c, &p);
        svg_add_camera(&c, &none);
        svg_add_camera(&c, &bad);
        assert_in_range(c.n, 1, SVG_CAMERAS);
    }
    assert_int_equal(c.seen, 1000);
    assert_in_range(c.n, SVG_CAMERAS / 2, SVG_CAMERAS);
    for (uint32_t i = 0; i < c.n; i++)
        assert_true(c.at[i].C[0] == (double)(i * c.every) && c.at[i].axis[2] == 1);
}

/* ---- tables -----------------------------------------------------------------------------------
 */

/* A row's cell is the segment's number in the image from 1, or 0: against a plain matrix. */
static void matrix_is_what_was_seen(void **state) {
    (void)state;
    enum { FRAMES = 300, TRACKS = 90 };
    static int32_t seen[FRAMES][TRACKS];
    arris_track item[TRACKS];
    FILE *spool = tmpfile();
    char *text = NULL, *at;
    size_t size;
    srand(1);
    for (int i = 0; i < FRAMES; i++) {
        arris_tracks t = {.max = TRACKS, .total = TRACKS, .item = item};
        for (int k = 0; k < TRACKS; k++)
            if (k * 3 < i && i < k * 3 + 60 && rand() % 4) { /* tracks come and go */
                int segment = rand() % 20 - 1;
                seen[i][k] = segment + 1;
                item[t.n++] = (arris_track){k, segment};
            }
        tracks_spool(spool, &t);
    }
    FILE *f = open_memstream(&text, &size);
    assert_int_equal(tracks_write(f, spool, TRACKS), 0);
    fclose(f);
    fclose(spool);
    at = text;
    for (int i = 0; i < FRAMES; i++)
        for (int k = 0; k < TRACKS; k++) {
            assert_int_equal(strtol(at, &at, 10), seen[i][k]);
            assert_int_equal(*at++, k == TRACKS - 1 ? '\n' : ',');
        }
    assert_int_equal(*at, '\0');
    free(text);
}

static void broken_spool_is_an_error(void **state) {
    (void)state;
    FILE *spool = tmpfile(), *out = tmpfile();
    const uint32_t n = 5; /* tracks that don't follow */
    assert_int_equal(fwrite(&n, sizeof n, 1, spool), 1);
    assert_int_equal(tracks_write(out, spool, 10), ARRIS_E_IO);
    fclose(spool);
    fclose(out);
}

static void segment_that_is_not_finite_leaves_blanks(void **state) {
    (void)state;
    arris_segment s = {.x1 = 1, .y1 = NAN, .x2 = 3, .y2 = 4, .cov = {-1, 0, INFINITY}, .hi = 9};
    const arris_segments segments = {.n = 1, .max = 1, .item = &s};
    int32_t track_of[1];
    char *text = NULL;
    size_t size;
    FILE *f = open_memstream(&text, &size);
    segments_write(f, 7, &segments, NULL, track_of);
    fclose(f);
    assert_string_equal(text, "7,1,-1,1.0000,,3.0000,4.0000,,,0.00,9.00,0\n");
    free(text);
}

/* ---- a file that appears complete or not at all -----------------------------------------------
 */

static int files_in(const char *folder) {
    DIR *d = opendir(folder);
    int n = -2; /* . and .. */
    while (readdir(d))
        n++;
    closedir(d);
    return n;
}

static void assert_text(const char *path, const char *expected) {
    char *text = file_text(path);
    assert_string_equal(text, expected);
    free(text);
}

static void output_appears_at_the_end(void **state) {
    (void)state;
    const char *folder = scratch_mkdir("output"), *path = scratch("output/a.json");
    output o;
    assert_int_equal(output_open(&o, path), 0);
    fprintf(o.file, "new");
    assert_int_equal(access(path, F_OK), -1);
    assert_int_equal(output_commit(&o), 0);
    assert_text(path, "new");
    assert_int_equal(output_open(&o, path), 0);
    fprintf(o.file, "newer");
    output_abandon(&o);
    assert_text(path, "new");
    assert_int_equal(files_in(folder), 1);
}

/* The limit of a file's size stands for a full disk. */
static void output_on_a_full_disk(void **state) {
    (void)state;
    const char *folder = scratch_mkdir("full"), *path = scratch_write("full/a.json", "old");
    struct rlimit none = {0, RLIM_INFINITY}, all = {RLIM_INFINITY, RLIM_INFINITY};
    output o;
    signal(SIGXFSZ, SIG_IGN);
    for (int big = 0; big < 2; big++) { /* it is found when flushing at the end, or while writing */
        assert_int_equal(output_open(&o, path), 0);
        assert_int_equal(setrlimit(RLIMIT_FSIZE, &none), 0);
        for (int i = 0; i < (big ? 100000 : 1); i++)
            fputs("line\n", o.file);
        errno = 0;
        int error = output_commit(&o);
        assert_int_equal(setrlimit(RLIMIT_FSIZE, &all), 0);
        assert_true(error == EFBIG || (big && error == EIO));
        assert_text(path, "old");
        assert_int_equal(files_in(folder), 1);
    }
}

static void output_where_there_is_no_file_to_be(void **state) {
    (void)state;
    output o;
    scratch_mkdir("folder");
    assert_int_equal(output_open(&o, scratch("no/such/a.json")), ENOENT);
    assert_int_equal(output_open(&o, scratch("folder")), EISDIR);
    assert_int_equal(output_open(&o, "/dev/full"), EINVAL);
    output_abandon(&o);
    assert_null(output_scratch(scratch("no/such/a.json")));
}

/* ---- the stage, in the program ----------------------------------------------------------------
 */

/* Runs `arris COMMAND` in the folder; the words of `before` are for the shell. The source `results`
 * is that of tests/plugins/results.c. */
static process arris(const char *folder, const char *before, const char *command) {
    static bool built;
    char path[PATH_MAX], line_of_shell[2 * PATH_MAX];
    if (!realpath(arris_path(), path))
        fail_msg("%s is not there", arris_path());
    if (!built) {
        snprintf(line_of_shell, sizeof line_of_shell,
                 "cc -shared -fPIC -Icore -o %s tests/plugins/results.c", scratch("results.so"));
        assert_int_equal(system(line_of_shell), 0);
        setenv("ARRIS_PLUGIN_PATH", scratch(""), 1);
        built = true;
    }
    snprintf(line_of_shell, sizeof line_of_shell, "%s exec '%s' %s", before, path, command);
    char *words[] = {(char *)"/bin/sh", (char *)"-c", line_of_shell, NULL};
    process p = process_start(folder, -1, words);
    process_wait(&p);
    return p;
}

/* Runs it, expects the exit code, and in the error these words. */
static void expect(const char *folder, const char *before, const char *command, int code,
                   const char *word) {
    process p = arris(folder, before, command);
    if (p.code != code || !strstr(p.err, word))
        fail_msg("arris %s: exit %d, said: %s", command, p.code, p.err);
    process_free(&p);
}

#define ALL                                                                                        \
    "launch 'results ! filesink location=a.json ! filesink location=a.ply ! filesink "             \
    "location=a.obj ! filesink location=a.dxf ! filesink location=a.svg ! filesink "               \
    "location=x.segments.csv ! filesink location=x.tracks.csv'"
static const char *const names[] = {"a.json", "a.ply",          "a.obj",       "a.dxf",
                                    "a.svg",  "x.segments.csv", "x.tracks.csv"};

static void every_kind_of_file(void **state) {
    (void)state;
    const char *a = scratch_mkdir("kinds"), *b = scratch_mkdir("again");
    expect(a, "", ALL, 0, "");
    expect(b, "", ALL, 0, "");
    assert_int_equal(files_in(a), 7);
    for (int i = 0; i < 7; i++) {
        char one[PATH_MAX], other[PATH_MAX];
        snprintf(one, sizeof one, "%s/%s", a, names[i]);
        snprintf(other, sizeof other, "%s/%s", b, names[i]);
        char *text = file_text(one);
        assert_true(strlen(text) > 20);
        assert_text(other, text);
        free(text);
    }
    assert_text(scratch("kinds/x.tracks.csv"),
                "1,0,0,0\n2,1,0,0\n0,3,1,0\n0,0,1,0\n0,0,0,0\n0,3,0,2\n");
    char *rows = file_text(scratch("kinds/x.segments.csv"));
    assert_non_null(strstr(rows, "frame,id,track,x1,y1,x2,y2,offset_sigma,angle_sigma,lo,hi,chi2\n"
                                 "10,1,0,0.0000,0.0000,30.0000,40.0000,0.25,0.001,20.00,220.50,"
                                 "1.25\n11,1,1,1.0000,"));
    assert_non_null(strstr(rows, "\n12,2,-1,2.0000,1.0000,"));
    assert_int_equal(occurrences(rows, "\n"), 13);
    free(rows);
}

/* How many bytes both files have alike; 0 when they differ, or there is none. */
static size_t same_bytes(const char *a, const char *b) {
    static char text[2][1 << 16];
    const char *const path[2] = {a, b};
    size_t n[2] = {0};
    for (int i = 0; i < 2; i++) {
        FILE *f = fopen(path[i], "rb");
        n[i] = f ? fread(text[i], 1, sizeof *text, f) : 0;
        if (f)
            fclose(f);
    }
    return n[0] == n[1] && memcmp(text[0], text[1], n[0]) == 0 ? n[0] : 0;
}

/* Records the frames of `from` in the folder `name`. */
static void record(const char *from, const char *name) {
    char command[3 * PATH_MAX];
    snprintf(command, sizeof command,
             "launch 'imagesrc location=%s ! filesink location=frames.csv'", from);
    expect(scratch_mkdir(name), "", command, 0, "");
}

/* A recording played and recorded again is the same: pictures of 8 and 16 bits, poses, frames
 * without one, the camera. */
static void recordings_are_played_and_recorded_again(void **state) {
    (void)state;
    static const char *const files[] = {"frames.csv", "camera.json", "frames/0000.png",
                                        "frames/0001.png", "frames/0002.png"};
    char here[PATH_MAX], from[2 * PATH_MAX], one[64], other[64];
    const char *const what[] = {"tests/data/image/scan/frames.csv", "deep"};
    if (!realpath(".", here))
        abort();
    scratch_mkdir("deep");
    char *deep = file_text("tests/data/image/text4095.pgm");
    for (int i = 0; i < 3; i++) {
        snprintf(one, sizeof one, "deep/%d.pgm", i);
        scratch_write(one, "%s", deep);
    }
    free(deep);
    for (int k = 0; k < 2; k++) {
        snprintf(from, sizeof from, "%s/%s", here, what[k]);
        record(k ? scratch("deep") : from, "first");
        record(scratch("first/frames.csv"), "second");
        for (int i = 0; i < 5; i++) {
            snprintf(one, sizeof one, "first/%s", files[i]);
            snprintf(other, sizeof other, "second/%s", files[i]);
            if (!same_bytes(scratch(one), scratch(other)) && !(k && i == 1)) /* has no camera */
                fail_msg("%s of %s is not recorded, or not the same again", files[i], what[k]);
        }
    }
}

/* Least of all the one that is being played. */
static void a_recording_is_not_written_over(void **state) {
    (void)state;
    char here[PATH_MAX], from[2 * PATH_MAX];
    if (!realpath(".", here))
        abort();
    snprintf(from, sizeof from, "%s/tests/data/image/scan/frames.csv", here);
    record(from, "kept");
    char *before = file_text(scratch("kept/frames.csv"));
    expect(scratch("kept"), "",
           "launch 'imagesrc location=frames.csv step=2 ! filesink location=frames.csv'", 4,
           "not written over");
    assert_text(scratch("kept/frames.csv"), before);
    free(before);
}

static void no_frames_at_all(void **state) {
    (void)state;
    const char *folder = scratch_mkdir("none");
    expect(folder, "",
           "launch 'results frames=0 ! filesink location=tracks.csv ! filesink location=a.json'", 0,
           "");
    assert_text(scratch("none/tracks.csv"), "");
    json_t *root = json_load_file(scratch("none/a.json"), 0, NULL);
    assert_true(number_of(root, "frames") == 0);
    json_decref(root);
}

static void check_leaves_nothing(void **state) {
    (void)state;
    const char *folder = scratch_mkdir("check");
    expect(folder, "", "launch --check 'results ! filesink location=a.json'", 0, "");
    assert_int_equal(files_in(folder), 0);
}

static void what_is_wrong_is_said(void **state) {
    (void)state;
    const char *folder = scratch_mkdir("wrong");
    scratch_mkdir("wrong/dir.json");
    expect(folder, "", "launch results ! filesink", 2, "location");
    expect(folder, "", "launch results ! filesink location=a.txt", 2, "segments.csv, tracks.csv");
    expect(folder, "", "launch results ! filesink location=a.csv", 2, ".json, .ply");
    expect(folder, "", "launch results ! filesink location=a.json view=xy", 2, "view");
    expect(folder, "", "launch fakesrc frames=1 ! filesink location=a.json", 2, "'lines'");
    expect(folder, "", "launch --check results ! filesink location=no/a.json", 4, "no/a.json");
    expect(folder, "", "launch results ! filesink location=no/a.json", 4, "create the folder");
    expect(folder, "", "launch results ! filesink location=dir.json", 4, "dir.json");
    expect(folder, "", "launch results ! filesink location=frames.csv", 2, "'image'");
    assert_int_equal(files_in(folder), 1);
}

/* 1024 bytes of disk: the figure is found too big at the end, the tables on the way. */
static void full_disk_is_said_and_nothing_changes(void **state) {
    (void)state;
    const char *folder = scratch_mkdir("disk");
    const char *const small = "trap '' XFSZ; ulimit -f 2;";
    scratch_write("disk/a.svg", "old");
    expect(folder, small, "launch results ! filesink location=a.svg", 4, "cannot write a.svg: ");
    expect(folder, small, "launch results frames=5000 ! filesink location=segments.csv", 4,
           "cannot write segments.csv: ");
    expect(folder, small, "launch results frames=5000 ! filesink location=tracks.csv", 4,
           "cannot write tracks.csv: ");
    assert_text(scratch("disk/a.svg"), "old");
    assert_int_equal(files_in(folder), 1);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(json_holds_the_numbers),
        cmocka_unit_test(json_is_a_line_a_line),
        cmocka_unit_test(json_of_nothing),
        cmocka_unit_test(ply_holds_the_measured),
        cmocka_unit_test(obj_holds_the_measured),
        cmocka_unit_test(dxf_holds_the_measured),
        cmocka_unit_test(figure_is_to_scale),
        cmocka_unit_test(figure_has_three_views),
        cmocka_unit_test(verdict_holds_the_numbers),
        cmocka_unit_test(report_is_a_page_of_its_own),
        cmocka_unit_test(figure_has_the_verdict),
        cmocka_unit_test(figure_of_little),
        cmocka_unit_test(cameras_are_thinned_out),
        cmocka_unit_test(matrix_is_what_was_seen),
        cmocka_unit_test(broken_spool_is_an_error),
        cmocka_unit_test(segment_that_is_not_finite_leaves_blanks),
        cmocka_unit_test(output_appears_at_the_end),
        cmocka_unit_test(output_on_a_full_disk),
        cmocka_unit_test(output_where_there_is_no_file_to_be),
        cmocka_unit_test(every_kind_of_file),
        cmocka_unit_test(recordings_are_played_and_recorded_again),
        cmocka_unit_test(a_recording_is_not_written_over),
        cmocka_unit_test(no_frames_at_all),
        cmocka_unit_test(check_leaves_nothing),
        cmocka_unit_test(what_is_wrong_is_said),
        cmocka_unit_test(full_disk_is_said_and_nothing_changes),
    };
    return cmocka_run_group_tests(tests, make_lines, NULL);
}
