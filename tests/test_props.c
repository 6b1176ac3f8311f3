/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_props.c: properties of every type from text into a struct, their ranges, words and defaults,
 * what is said about bad ones, and the nearest name.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "internal.h"

struct self {
    char before[8];
    int32_t number, count;
    double real, sigma;
    bool flag;
    char between[7];
    int32_t mode;
    const char *text, *file;
    char after[8];
};

static const arris_prop table[] = {
    ARRIS_P_INT(struct self, number, "number", "-3", -10, 1e4, "px", "how many"),
    {"count", ARRIS_INT, offsetof(struct self, count), "all", 0, INT32_MAX, NULL, "all", "of them"},
    ARRIS_P_DOUBLE(struct self, real, "real", "0.25", -1.5, 2.5, "mm", "how far"),
    ARRIS_P_DOUBLE_OR(struct self, sigma, "sigma", "auto", "auto", 0.3, 5, "px", "how blurred"),
    ARRIS_P_BOOL(struct self, flag, "flag", "true", "whether"),
    ARRIS_P_ENUM(struct self, mode, "mode", "pass", "drop|pass|error", "what then"),
    ARRIS_P_STRING(struct self, text, "text", NULL, "what it says"),
    ARRIS_P_INFILE(struct self, file, "file-name", "a.json", "what to read"),
};
static const arris_stage_desc stage = {
    .size = sizeof(arris_stage_desc),
    .name = "stage",
    .self_size = sizeof(struct self),
    .props = table,
    .n_props = COUNT(table),
};

static struct self self;
static strings *own;
static arris_error err;

static int begin(void **state) {
    (void)state;
    memset(&self, 0x5a, sizeof self);
    self.text = self.file = NULL;
    return props_default(&stage, &self, &own, &err);
}

static int end(void **state) {
    (void)state;
    for (strings *next; own; own = next) {
        next = own->next;
        free(own);
    }
    for (size_t i = 0; i < sizeof self.before; i++) /* nothing beside the fields was written to */
        if (self.before[i] != 0x5a || self.after[i] != 0x5a)
            return -1;
    return 0;
}

/* Sets `key=value` as it stands at column 0 of a line of its own. */
static int set_in(const char *path, const char *word) {
    source src = {.path = (char *)path, .text = (char *)word};
    token t = {&src, word, 0};
    memset(&err, 0, sizeof err);
    return props_set(&stage, &self, &own, &t, &err);
}

static int set(const char *word) {
    return set_in(NULL, word);
}

static void defaults(void **state) {
    (void)state;
    assert_int_equal(self.number, -3);
    assert_int_equal(self.count, -1);
    assert_true(self.real == 0.25 && self.sigma == -1 && self.flag);
    assert_int_equal(self.mode, 1);
    assert_null(self.text);
    assert_string_equal(self.file, "a.json");
}

static void whole_numbers(void **state) {
    (void)state;
    static const char *const good[] = {"number=-10", "number=10000", "number=7",
                                       "number=1e3", "number=+4",    "number=0"};
    static const int32_t value[] = {-10, 10000, 7, 1000, 4, 0};
    for (size_t i = 0; i < COUNT(good); i++) {
        assert_int_equal(set(good[i]), 0);
        assert_int_equal(self.number, value[i]);
    }
    static const char *const bad[] = {
        "number=-11",  "number=10001", "number=2.5",  "number=",    "number=two", "number=3px",
        "number=0x10", "number=nan",   "number=1e99", "number=inf", "number=1,5", "number=3 4"};
    for (size_t i = 0; i < COUNT(bad); i++) {
        assert_int_equal(set(bad[i]), ARRIS_E_USAGE);
        assert_int_equal(self.number, 0);
    }
    assert_int_equal(set("count=2147483647"), 0);
    assert_int_equal(self.count, INT32_MAX);
    assert_int_equal(set("count=2147483648"), ARRIS_E_USAGE);
    assert_int_equal(set("count=-1"), ARRIS_E_USAGE);
    assert_int_equal(set("count=all"), 0);
    assert_int_equal(self.count, -1);
}

static void real_numbers(void **state) {
    (void)state;
    assert_int_equal(set("real=-1.5"), 0);
    assert_true(self.real == -1.5);
    assert_int_equal(set("real=2.5"), 0);
    assert_int_equal(set("real=1e-3"), 0);
    assert_true(self.real == 1e-3);
    static const char *const bad[] = {"real=2.5000001", "real=-1.6",  "real=nan", "real=-inf",
                                      "real=1e999",     "real=0x1p1", "real=1mm", "real=auto"};
    for (size_t i = 0; i < COUNT(bad); i++)
        assert_int_equal(set(bad[i]), ARRIS_E_USAGE);
    assert_true(self.real == 1e-3);
    assert_int_equal(set("sigma=0.3"), 0);
    assert_true(self.sigma == 0.3);
    assert_int_equal(set("sigma=auto"), 0);
    assert_true(self.sigma == -1);
    assert_int_equal(set("sigma=-1"), ARRIS_E_USAGE); /* the word only */
}

static void words(void **state) {
    (void)state;
    static const char *const yes[] = {"flag=true", "flag=1", "flag=yes"};
    static const char *const no[] = {"flag=false", "flag=0", "flag=no"};
    for (size_t i = 0; i < COUNT(yes); i++) {
        assert_int_equal(set(no[i]), 0);
        assert_false(self.flag);
        assert_int_equal(set(yes[i]), 0);
        assert_true(self.flag);
    }
    assert_int_equal(set("flag=True"), ARRIS_E_USAGE);
    assert_int_equal(set("flag="), ARRIS_E_USAGE);
    assert_int_equal(set("mode=drop"), 0);
    assert_int_equal(self.mode, 0);
    assert_int_equal(set("mode=error"), 0);
    assert_int_equal(self.mode, 2);
    static const char *const bad[] = {"mode=", "mode=dro", "mode=drop|pass", "mode=|", "mode=0"};
    for (size_t i = 0; i < COUNT(bad); i++)
        assert_int_equal(set(bad[i]), ARRIS_E_USAGE);
}

static void texts(void **state) {
    (void)state;
    assert_int_equal(set("text=a = b ! c"), 0);
    assert_string_equal(self.text, "a = b ! c");
    assert_int_equal(set("text="), 0);
    assert_string_equal(self.text, "");
}

static void a_star_takes_what_no_other_row_names(void **state) {
    (void)state;
    static const arris_prop rows[] = {
        ARRIS_P_STRING(struct self, text, "*", NULL, "whatever else"),
        ARRIS_P_INT(struct self, number, "number", "1", 0, 9, NULL, "how many"),
    };
    static const arris_stage_desc open = {.name = "stage", .props = rows, .n_props = COUNT(rows)};
    static const char *const line[] = {"gain=3", "number=7", "number=70", "white-balance=a=b"};
    for (size_t i = 0; i < COUNT(line); i++) {
        source src = {.text = (char *)line[i]};
        assert_int_equal(props_set(&open, &self, &own, &(token){&src, line[i], 0}, &err),
                         i == 2 ? ARRIS_E_USAGE : 0);
    }
    assert_string_equal(self.text, "gain=3\nwhite-balance=a=b\n");
    assert_int_equal(self.number, 7);
}

static void paths_are_relative_to_the_recipe(void **state) {
    (void)state;
    assert_int_equal(set_in("lab/scans/box.arris", "file-name=data/frames.csv"), 0);
    assert_string_equal(self.file, "lab/scans/data/frames.csv");
    assert_int_equal(set_in("lab/scans/box.arris", "file-name=/data/frames.csv"), 0);
    assert_string_equal(self.file, "/data/frames.csv");
    assert_int_equal(set_in("box.arris", "file-name=frames.csv"), 0);
    assert_string_equal(self.file, "frames.csv");
    assert_int_equal(set("file-name=frames.csv"), 0);
    assert_string_equal(self.file, "frames.csv");
    assert_int_equal(set_in("lab/box.arris", "text=frames.csv"), 0); /* what is no path to read */
    assert_string_equal(self.text, "frames.csv");
}

static void errors_say_what_is_expected(void **state) {
    (void)state;
    set("number=2.5");
    assert_string_equal(err.text,
                        "stage: number cannot be '2.5': it is a whole number from -10 to 10000 px");
    assert_string_equal(err.hint, "how many");
    assert_string_equal(err.line, "number=2.5");
    assert_int_equal(err.column, 7);
    set("sigma=9");
    assert_string_equal(err.text, "stage: sigma cannot be '9': it is 0.3 to 5 px or auto");
    set("flag=maybe");
    assert_string_equal(err.text, "stage: flag cannot be 'maybe': it is true or false");
    set("mode=fly");
    assert_string_equal(err.text, "stage: mode cannot be 'fly': it is drop|pass|error");
    assert_int_equal(err.column, 5);
    set("nubmer=1");
    assert_string_equal(err.text, "stage has no property 'nubmer'; did you mean 'number'?");
    assert_non_null(strstr(err.hint, "number, count, real, sigma, flag, mode, text, file-name"));
    assert_int_equal(err.column, 0);
    set("transmogrification=1");
    assert_string_equal(err.text, "stage has no property 'transmogrification'");
    assert_int_equal(set("num=1"), ARRIS_E_USAGE); /* a beginning is not enough */
    assert_int_equal(set("number2=1"), ARRIS_E_USAGE);
}

static void overlong_words_are_cut(void **state) {
    (void)state;
    char word[5000];
    memset(word, 'x', sizeof word);
    word[sizeof word - 1] = '\0';
    word[4000] = '=';
    assert_int_equal(set(word), ARRIS_E_USAGE);
    memcpy(word, "number=", 7);
    assert_int_equal(set(word), ARRIS_E_USAGE);
    assert_true(strlen(err.text) < sizeof err.text);
    memcpy(word, "text=xx", 7);
    assert_int_equal(set(word), 0);
    assert_int_equal(strlen(self.text), sizeof word - 1 - 5);
}

static void a_bad_default_is_the_plugins_fault(void **state) {
    (void)state;
    static const arris_prop bad[] = {
        ARRIS_P_INT(struct self, number, "number", "11", 0, 10, NULL, "too large")};
    arris_stage_desc d = stage;
    d.props = bad;
    d.n_props = 1;
    assert_int_equal(props_default(&d, &self, &own, &err), ARRIS_E_PLUGIN);
    assert_non_null(strstr(err.text, "number"));
}

/* ---- the nearest name ------------------------------------------------------------------------ */

static const char *nearest_of(const char *word, const char *const *names) {
    nearest n = {.word = word};
    for (; *names; names++)
        nearest_offer(&n, *names);
    return nearest_result(&n);
}

static void nearest_names(void **state) {
    (void)state;
    static const char *const names[] = {"edges",    "segments",   "track", "reconstruct",
                                        "identity", "min-length", "tol",   NULL};
    static const char *const meant[][2] = {
        {"edgse", "edges"},          {"edge", "edges"}, {"Edges", "edges"},
        {"segment", "segments"},     {"trak", "track"}, {"reconstuct", "reconstruct"},
        {"minlength", "min-length"}, {"toll", "tol"},   {"xdentity", "identity"},
        {"edges", "edges"}};
    for (size_t i = 0; i < COUNT(meant); i++)
        assert_string_equal(nearest_of(meant[i][0], names), meant[i][1]);
    assert_null(nearest_of("webcam", names));
    assert_null(nearest_of("zzzzzzzzzzz", names));
    assert_null(nearest_of("a-word-that-is-longer-than-any-name-there-could-be", names));
    const char *none = NULL;
    assert_null(nearest_of("edges", &none));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(defaults, begin, end),
        cmocka_unit_test_setup_teardown(whole_numbers, begin, end),
        cmocka_unit_test_setup_teardown(real_numbers, begin, end),
        cmocka_unit_test_setup_teardown(words, begin, end),
        cmocka_unit_test_setup_teardown(texts, begin, end),
        cmocka_unit_test_setup_teardown(a_star_takes_what_no_other_row_names, begin, end),
        cmocka_unit_test_setup_teardown(paths_are_relative_to_the_recipe, begin, end),
        cmocka_unit_test_setup_teardown(errors_say_what_is_expected, begin, end),
        cmocka_unit_test_setup_teardown(overlong_words_are_cut, begin, end),
        cmocka_unit_test_setup_teardown(a_bad_default_is_the_plugins_fault, begin, end),
        cmocka_unit_test(nearest_names),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
