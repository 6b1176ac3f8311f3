/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_inspect.c: `arris inspect` as a user runs it, on the recorded box: verdicts, files, exit
 * codes, and what it says of bad recipes and models. The box's paint ends 8 mm inside each of its
 * edges.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>
#include <jansson.h>

#include "one_error.h"
#include "scratch.h"

/* A recipe of the box's scan that ends in `compare` with these words; its model is a path. */
static const char *recipe(const char *words) {
    static char here[4096];
    if (!getcwd(here, sizeof here))
        abort();
    return scratch_write("part.arris",
                         "imagesrc location=%s/samples/box/frames.csv ! edges ! undistort "
                         "! segments ! track ! reconstruct ! compare %s\n",
                         here, words);
}

static process inspect(const char *words) {
    char line[8192];
    const char *path = recipe(words);
    snprintf(line, sizeof line, "inspect -o %s %s", scratch_mkdir("results"), path);
    return arris_run(line);
}

/* The box with every corner of z = 670 whose x is above 0 moved by dz: its edge e6. */
static const char *box_model(double dz) {
    char *text = file_text("samples/box/box.obj"), *at = text, *end;
    FILE *f = fopen(scratch("model.obj"), "w");
    assert_non_null(f);
    for (char *l = strtok(text, "\n"); l; l = strtok(NULL, "\n")) {
        double x = l[0] == 'v' ? strtod(l + 2, &at) : 0, y = x != 0 ? strtod(at, &end) : 0;
        double z = x != 0 ? strtod(end, NULL) : 0;
        if (x != 0)
            fprintf(f, "v %f %f %f\n", x, y, x > 0 && z < 700 ? z + dz : z);
        else
            fprintf(f, "%s\n", l);
    }
    fclose(f);
    free(text);
    return scratch("model.obj");
}

static json_t *verdict_file(void) {
    json_error_t e;
    json_t *root = json_load_file(scratch("results/verdict.json"), 0, &e);
    if (!root)
        fail_msg("verdict.json: %s", e.text);
    assert_string_equal(json_string_value(json_object_get(root, "format")), "arris-verdict/1");
    return root;
}

static const char *verdict_of(const json_t *root, const char *id) {
    json_t *features = json_object_get(root, "features"), *f;
    size_t i;
    json_array_foreach(features, i,
                       f) if (!strcmp(json_string_value(json_object_get(f, "id")),
                                      id)) return json_string_value(json_object_get(f, "verdict"));
    return "missing";
}

static process inspect_box(double dz, const char *words) {
    char all[4200];
    snprintf(all, sizeof all, "model=%s %s", box_model(dz), words);
    return inspect(all);
}

static void a_good_box_passes(void **state) {
    (void)state;
    process p = inspect_box(0, "tolerance=3 features=e6,e8");
    json_t *root = verdict_file(), *hashes = json_object_get(root, "sha256");
    if (p.code != 0)
        fail_msg("exit code %d:\n%s%s", p.code, p.out, p.err);
    assert_non_null(strstr(p.out, "verdict: PASS"));
    assert_string_equal(verdict_of(root, "e6"), "PASS");
    assert_string_equal(verdict_of(root, "e8"), "PASS");
    assert_int_equal(json_array_size(json_object_get(root, "features")), 2);
    assert_int_equal(strlen(json_string_value(json_object_get(hashes, "model"))), 64);
    assert_int_equal(strlen(json_string_value(json_object_get(hashes, "recipe"))), 64);
    assert_int_equal(strlen(json_string_value(json_object_get(hashes, "calibration"))), 64);
    char *html = file_text(scratch("results/report.html"));
    assert_non_null(strstr(html, "<span class=\"PASS\">PASS</span>"));
    assert_non_null(strstr(html, "data:image/png;base64,"));
    assert_non_null(strstr(html, json_string_value(json_object_get(hashes, "model"))));
    assert_null(strstr(html, "http://") && !strstr(html, "http://www.w3.org/2000/svg"));
    char *lines = file_text(scratch("results/lines.json"));
    assert_non_null(strstr(lines, "arris-lines/1"));
    free(html);
    free(lines);
    json_decref(root);
    process_free(&p);
}

/* Each verdict is what ISO 14253-1 makes of its own numbers. */
static void the_lowered_edge_fails_alone(void **state) {
    (void)state;
    process p = inspect_box(12, "tolerance=3 features=e6,e8");
    json_t *root = verdict_file();
    assert_int_equal(p.code, 1);
    assert_string_equal(verdict_of(root, "e6"), "FAIL");
    assert_string_equal(verdict_of(root, "e8"), "PASS");
    json_decref(root);
    process_free(&p);
}

static void near_its_uncertainty_nothing_is_said(void **state) {
    (void)state;
    process p = inspect_box(0, "tolerance=0.4 features=e6");
    assert_int_equal(p.code, 3);
    assert_non_null(strstr(p.out, "its uncertainty is above the tolerance"));
    process_free(&p);
}

/* The edges along the motion cannot be measured, and the upright ones' paint is not their edge. */
static void all_edges_are_indeterminate(void **state) {
    (void)state;
    process p = inspect_box(0, "tolerance=3");
    json_t *root = verdict_file();
    assert_int_equal(p.code, 3);
    assert_non_null(strstr(p.out, "it runs along the camera's motion"));
    assert_string_equal(verdict_of(root, "e6"), "PASS");
    assert_string_equal(verdict_of(root, "e1"), "missing"); /* the box hides it */
    json_decref(root);
    process_free(&p);
}

/* A model in inches, one that lies elsewhere, an alignment that finds nothing: never a PASS. */
static void what_does_not_fit_is_indeterminate(void **state) {
    (void)state;
    static const char *const words[] = {"tolerance=3", "tolerance=4 align=best-fit",
                                        "tolerance=3 align=datum datum=e6,e8"};
    FILE *f = fopen(scratch("inch.obj"), "w");
    assert_non_null(f);
    fprintf(f, "v -4.7 -4.6 39\nv 5.5 -4.5 39\nv 5.5 4.1 26\nv -4.8 4 26\nf 1 2 3\nf 1 3 4\n");
    fclose(f);
    for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
        char all[8300];
        snprintf(all, sizeof all, "model=%s min-length=1 %s", scratch("inch.obj"),
                 i == 2 ? "tolerance=3 align=datum datum=e1,e2" : words[i]);
        process p = inspect(all);
        if (p.code != 3)
            fail_msg("'%s' ends with %d:\n%s%s", all, p.code, p.out, p.err);
        process_free(&p);
        process q = inspect_box(200, words[i]);
        assert_int_equal(q.code, 3);
        process_free(&q);
    }
}

static void json_is_the_file(void **state) {
    (void)state;
    char line[8192], words[4200];
    snprintf(words, sizeof words,
             "model=%s tolerance=3 features=e6 derived='distance(e6,e8) "
             "angle(e6,e8):0.5 corner(e5,e6)'",
             box_model(0));
    const char *path = recipe(words);
    snprintf(line, sizeof line, "inspect --json -o %s %s", scratch_mkdir("results"), path);
    process p = arris_run(line);
    char *file = file_text(scratch("results/verdict.json"));
    json_t *root = verdict_file();
    assert_string_equal(p.out, file);
    assert_string_equal(verdict_of(root, "distance(e6,e8)"), "PASS");
    assert_string_equal(verdict_of(root, "corner(e5,e6)"), "INDETERMINATE");
    assert_string_not_equal(verdict_of(root, "angle(e6,e8)"), "FAIL");
    assert_int_equal(p.code, 3);
    json_decref(root);
    free(file);
    process_free(&p);
}

static void edges_are_listed(void **state) {
    (void)state;
    process p = arris_run("inspect --edges samples/box/box.obj");
    assert_int_equal(p.code, 0);
    assert_non_null(strstr(p.out, "e12 "));
    assert_null(strstr(p.out, "e13 "));
    process_free(&p);
    p = arris_run("inspect --edges none.obj");
    assert_one_error(&p, "--edges", 4, "cannot open none.obj", NULL, NULL);
}

static void bad_words_are_one_error(void **state) {
    (void)state;
    static const struct {
        const char *words, *says;
        int code;
    } bad[] = {
        {"model=samples/box/box.obj", "the tolerance is missing", 2},
        {"tolerance=1", "the model is missing", 2},
        {"model=%s tolerance=0", "tolerance", 2},
        {"model=%s tolerance=1 features=e99", "the model has no edge 'e99'", 2},
        {"model=%s tolerance=1 align=datum", "go together", 2},
        {"model=%s tolerance=1 datum=e1", "go together", 2},
        {"model=%s tolerance=1 align=datum datum=e6,e6", "the edge 'e6' is named twice", 2},
        {"model=%s tolerance=1 derived=distance(e6,e5)", "are turned by", 2},
        {"model=none.obj tolerance=1", "cannot open", 4},
    };
    char model[4096];
    snprintf(model, sizeof model, "%s", box_model(0));
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        char words[4500];
        const char *at = strstr(bad[i].words, "%s");
        snprintf(words, sizeof words, "%.*s%s%s", at ? (int)(at - bad[i].words) : 0, bad[i].words,
                 at ? model : "", at ? at + 2 : bad[i].words);
        process p = inspect(words);
        if (p.code != bad[i].code || !strstr(p.err, bad[i].says) || *p.out)
            fail_msg("'%s' ends with %d and says '%s'", words, p.code, p.err);
        process_free(&p);
    }
    process p = arris_run("inspect");
    assert_one_error(&p, "nothing", 2, "give it a recipe", NULL, NULL);
    p = arris_run("inspect -o /nowhere/at/all x.arris");
    assert_one_error(&p, "no folder", 2, "there is no folder", NULL, NULL);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_good_box_passes),
        cmocka_unit_test(the_lowered_edge_fails_alone),
        cmocka_unit_test(near_its_uncertainty_nothing_is_said),
        cmocka_unit_test(all_edges_are_indeterminate),
        cmocka_unit_test(what_does_not_fit_is_indeterminate),
        cmocka_unit_test(json_is_the_file),
        cmocka_unit_test(edges_are_listed),
        cmocka_unit_test(bad_words_are_one_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
