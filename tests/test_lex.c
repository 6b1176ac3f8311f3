/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_lex.c: launch lines to words and to stages: quotes, comments, recipes in recipes, branches;
 * and that every error points at the line and the column where it is.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "internal.h"
#include "scratch.h"

static arris_error err;

/* ---- words ----------------------------------------------------------------------------------- */

/* The words of a line with '|' between them; "error" when it cannot be split. */
static const char *words_of(const char *line) {
    static char text[4096];
    token_list list = {0};
    size_t at = 0;
    memset(&err, 0, sizeof err);
    *text = '\0';
    if (lex(&list, line, &err))
        strcpy(text, "error");
    else
        for (size_t i = 0; i < list.n; i++)
            at += (size_t)snprintf(text + at, sizeof text - at, "%s%s", i ? "|" : "",
                                   list.item[i].text);
    lex_free(&list);
    return text;
}

static void white_space_separates(void **state) {
    (void)state;
    assert_string_equal(words_of("a ! b"), "a|!|b");
    assert_string_equal(words_of("  a\t!\n\r\v\fb  "), "a|!|b");
    assert_string_equal(words_of("'a!b'"), "a!b");
    assert_string_equal(words_of(""), "");
    assert_string_equal(words_of(" \n "), "");
    assert_string_equal(words_of("Kürbis größe=3"), "Kürbis|größe=3");
}

static void quotes_keep(void **state) {
    (void)state;
    assert_string_equal(words_of("x='a b' y=\"c  d\""), "x=a b|y=c  d");
    assert_string_equal(words_of("'a'\"b\"c"), "abc");
    assert_string_equal(words_of("a '' b"), "a||b");
    assert_string_equal(words_of("\"it's\" 'say \"no\"'"), "it's|say \"no\"");
    assert_string_equal(words_of("a\\ b \"\\\"\" '\\' \\\\"), "a b|\"|\\|\\");
    assert_string_equal(words_of("a\\"), "a\\");
    assert_string_equal(words_of("x='#' # y"), "x=#|#|y"); /* no comments on a command line */
}

static void an_open_quote_is_an_error(void **state) {
    (void)state;
    static const char *const line[] = {"a x=\"b c", "a 'b", "a 'b'\"c'", "ab \"\\\"", "größe 'x"};
    static const int column[] = {4, 2, 5, 3, 6}; /* characters, not bytes */
    for (size_t i = 0; i < COUNT(line); i++) {
        assert_string_equal(words_of(line[i]), "error");
        assert_int_equal(err.code, ARRIS_E_RECIPE);
        assert_string_equal(err.line, line[i]);
        assert_int_equal(err.column, column[i]);
    }
}

/* ---- recipes --------------------------------------------------------------------------------- */

static void a_recipe_stands_for_its_words(void **state) {
    (void)state;
    scratch_write("one.arris", "# a comment\n  fakesrc frames=3 # and another\n! x='#1' a#b\n");
    char line[8192];
    snprintf(line, sizeof line, "before %s after", scratch("one.arris"));
    assert_string_equal(words_of(line), "before|fakesrc|frames=3|!|x=#1|a#b|after");
    snprintf(line, sizeof line, "location=%s", scratch("one.arris")); /* a property is none */
    assert_string_equal(words_of(line), line);
    assert_string_equal(words_of(".arris"), ".arris");
}

static void recipes_nest_relative_to_themselves(void **state) {
    (void)state;
    scratch_mkdir("deep");
    scratch_write("outer.arris", "a deep/middle.arris e");
    scratch_write("deep/middle.arris", "b inner.arris ../last.arris");
    scratch_write("deep/inner.arris", "c");
    scratch_write("last.arris", "d");
    assert_string_equal(words_of(scratch("outer.arris")), "a|b|c|d|e");
    char line[8192]; /* the same one twice, side by side, is no ring */
    snprintf(line, sizeof line, "%s %s", scratch("last.arris"), scratch("last.arris"));
    assert_string_equal(words_of(line), "d|d");
}

/* The words fail with this text, in this file, line and column. */
static void assert_fails(const char *line, const char *text, const char *file, int number,
                         int column) {
    assert_string_equal(words_of(line), "error");
    assert_int_equal(err.code, ARRIS_E_RECIPE);
    if (!strstr(err.text, text))
        fail_msg("'%s' is not in '%s'", text, err.text);
    assert_string_equal(err.file, file);
    assert_int_equal(err.line_number, number);
    assert_int_equal(err.column, column);
}

static void rings_of_recipes(void **state) {
    (void)state;
    scratch_write("self.arris", "a\nb  self.arris\n");
    assert_fails(scratch("self.arris"), "includes itself", scratch("self.arris"), 2, 3);
    assert_string_equal(err.line, "b  self.arris");
    scratch_write("r1.arris", "r2.arris");
    scratch_write("r2.arris", "\n\n r3.arris");
    scratch_write("r3.arris", "x ./r1.arris");
    assert_fails(scratch("r1.arris"), "includes itself", scratch("r3.arris"), 1, 2);
    unlink(scratch("alias.arris"));
    assert_int_equal(symlink("self2.arris", scratch("alias.arris")), 0);
    scratch_write("self2.arris", "alias.arris"); /* by another name */
    assert_fails(scratch("self2.arris"), "includes itself", scratch("self2.arris"), 1, 0);
}

static void deep_recipes_end(void **state) {
    (void)state;
    char name[32];
    for (int i = 0; i < 40; i++) {
        snprintf(name, sizeof name, "n%d.arris", i);
        scratch_write(name, "n%d.arris", i + 1);
    }
    assert_string_equal(words_of(scratch("n0.arris")), "error");
    assert_non_null(strstr(err.text, "nested more than 16 deep"));
}

static void recipes_that_cannot_be_read(void **state) {
    (void)state;
    char line[8192];
    snprintf(line, sizeof line, "a %s", scratch("none.arris"));
    assert_fails(line, "No such file", "", 0, 2);
    scratch_mkdir("folder.arris");
    snprintf(line, sizeof line, "a b %s", scratch("folder.arris"));
    assert_fails(line, "Is a directory", "", 0, 4);
    scratch_write("empty.arris", "# nothing\n");
    assert_fails(scratch("empty.arris"), "is empty", "", 0, 0);
    FILE *f = fopen(scratch("zero.arris"), "w");
    assert_int_equal(fwrite("fakesrc\0x", 1, 9, f), 9);
    fclose(f);
    assert_fails(scratch("zero.arris"), "no text file", "", 0, 0);
    f = fopen(scratch("large.arris"), "w");
    for (int i = 0; i < (1 << 20) / 8 + 1; i++)
        fputs("fakesrc ", f);
    fclose(f);
    assert_fails(scratch("large.arris"), "longer than 1 MiB", "", 0, 0);
    scratch_write("outer2.arris", "a\n  b none.arris");
    assert_fails(scratch("outer2.arris"), "No such file", scratch("outer2.arris"), 2, 4);
    scratch_write("quote.arris", "a\n\tx=\"b\nc\n");
    assert_fails(scratch("quote.arris"), "a quote is opened here", scratch("quote.arris"), 2, 3);
    assert_string_equal(err.line, " x=\"b");
    scratch_write("lines.arris", "a\nx='b\nc'\"d\n");
    assert_fails(scratch("lines.arris"), "a quote is opened here", scratch("lines.arris"), 3, 2);
}

static void words_are_limited(void **state) {
    (void)state;
    static char line[2 * MAX_TOKENS + 8];
    for (int i = 0; i <= MAX_TOKENS; i++)
        memcpy(line + 2 * i, "! ", 3);
    assert_string_equal(words_of(line), "error");
    assert_int_equal(err.code, ARRIS_E_RECIPE);
}

/* ---- stages ---------------------------------------------------------------------------------- */

/* The stages of a line as "name<upstream", in order. */
static const char *graph_of(const char *line) {
    static char text[4096];
    memset(&err, 0, sizeof err);
    arris_pipeline *p = arris_parse(line, &err);
    size_t at = 0;
    snprintf(text, sizeof text, "%s", p ? "" : err.text);
    for (size_t i = 0; p && i < p->n_stages; i++)
        at += (size_t)snprintf(text + at, sizeof text - at, "%s%s%s%s", i ? " " : "",
                               p->stage[i]->name, i ? "<" : "",
                               p->stage[i]->in ? p->stage[i]->in->name : "");
    arris_free(p);
    return text;
}

static void chains_and_branches(void **state) {
    (void)state;
    assert_string_equal(graph_of("fakesrc ! fakesink"), "fakesrc fakesink<fakesrc");
    assert_string_equal(graph_of("fakesrc ! identity ! identity ! fakesink name=end"),
                        "fakesrc identity<fakesrc identity2<identity end<identity2");
    assert_string_equal(graph_of("fakesrc ! tee name=t  t. ! queue ! fakesink  t. ! fakesink"),
                        "fakesrc t<fakesrc queue<t fakesink<queue fakesink2<t");
    assert_string_equal(graph_of("fakesrc ! tee name=t ! fakesink t. ! fakesink"),
                        "fakesrc t<fakesrc fakesink<t fakesink2<t");
    assert_string_equal(
        graph_of("fakesrc ! tee name=t t. ! tee name=u u. ! fakesink t. ! fakesink u. ! fakesink"),
        "fakesrc t<fakesrc u<t fakesink<u fakesink2<t fakesink3<u");
    assert_string_equal(graph_of("fakesrc ! identity name=fakesink ! fakesink"),
                        "fakesrc fakesink<fakesrc fakesink2<fakesink");
}

static void words_and_one_line_are_the_same(void **state) {
    (void)state;
    static char *const words[] = {"fakesrc", "frames=3", "!", "identity", "!", "fakesink"};
    arris_pipeline *p = arris_parse_words(COUNT(words), words, &err);
    assert_non_null(p);
    assert_int_equal(p->n_stages, 3);
    assert_string_equal(p->tokens.sources->text, "fakesrc frames=3 ! identity ! fakesink");
    arris_free(p);
    static char *const hard[] = {"a b", "", "it's", "\"x\"\\", "p=q r"};
    assert_null(arris_parse_words(COUNT(hard), hard, &err));
    char line[sizeof err.line];
    memcpy(line, err.line, sizeof line);
    assert_string_equal(words_of(line), "a b||it's|\"x\"\\|p=q r");
}

/* Every error: what it says, and the text that its caret stands at the beginning of. */
static const struct {
    const char *line, *text, *at;
    int code;
} wrong[] = {
    {"", "the pipeline is empty", NULL, ARRIS_E_USAGE},
    {"fakesrc ! fakesnk", "there is no stage 'fakesnk'; did you mean 'fakesink'?", "fakesnk",
     ARRIS_E_RECIPE},
    {"fakesrc ! ! fakesink", "a stage is expected here, not '!'", "! fakesink", ARRIS_E_RECIPE},
    {"! fakesrc ! fakesink", "a stage is expected here, not '!'", "! fakesrc", ARRIS_E_RECIPE},
    {"frames=3 ! fakesink", "a stage is expected here", "frames", ARRIS_E_RECIPE},
    {"fakesrc ! identity !", "a stage is expected after this '!'", "!END", ARRIS_E_RECIPE},
    {"fakesrc ! identity", "nothing takes what 'identity' gives", "identity", ARRIS_E_RECIPE},
    {"fakesrc", "nothing takes what 'fakesrc' gives", "fakesrc", ARRIS_E_RECIPE},
    {"fakesrc ! tee name=t", "nothing takes what 't' gives", "tee", ARRIS_E_RECIPE},
    {"identity ! fakesink", "the pipeline has no source", "identity", ARRIS_E_RECIPE},
    {"fakesrc ! fakesrc ! fakesink", "'fakesrc' is a second source", "fakesrc ! fakesink",
     ARRIS_E_RECIPE},
    {"fakesrc ! fakesink fakesrc ! fakesink", "'fakesrc' is a second source",
     "fakesrc ! fakesinkEND", ARRIS_E_RECIPE},
    {"fakesrc fakesink", "'!' is missing before 'fakesink'", "fakesink", ARRIS_E_RECIPE},
    {"fakesrc ! identity fakesink", "'!' is missing before 'fakesink'", "fakesink", ARRIS_E_RECIPE},
    {"fakesrc ! identity!fakesink", "this '!' touches other words", "!fakesink", ARRIS_E_RECIPE},
    {"fakesrc !identity ! fakesink", "this '!' touches other words", "!identity", ARRIS_E_RECIPE},
    {"fakesrc frames=3! fakesink", "this '!' touches other words", "! fakesink", ARRIS_E_RECIPE},
    {"fakesrc frames=-3 ! fakesink", "frames cannot be '-3'", "-3", ARRIS_E_USAGE},
    {"fakesrc frams=3 ! fakesink", "did you mean 'frames'?", "frams", ARRIS_E_USAGE},
    {"fakesrc ! fakesink sync=no", "fakesink has no property 'sync'", "sync", ARRIS_E_USAGE},
    {"fakesrc name=a ! fakesink name=a", "another stage is named 'a'", "aEND", ARRIS_E_RECIPE},
    {"fakesrc name=a.b ! fakesink", "'a.b' is not a valid name", "a.b", ARRIS_E_USAGE},
    {"fakesrc name= ! fakesink", "'' is not a valid name", " ! fakesink", ARRIS_E_USAGE},
    {"fakesrc ! fakesink t. ! fakesink", "no stage before this is named 't'", "t. !",
     ARRIS_E_RECIPE},
    {"fakesrc name=t ! fakesink t. ! fakesink", "'t' is not a tee", "t. !", ARRIS_E_RECIPE},
    {"fakesrc ! tee name=t ! fakesink t. fakesink", "'!' is expected after 't.'", " fakesinkEND",
     ARRIS_E_RECIPE},
    {"fakesrc ! tee name=t ! fakesink t.", "'!' is expected after 't.'", "END", ARRIS_E_RECIPE},
    {"fakesrc ! identity sleep='1 ! fakesink", "a quote is opened here and not closed", "'1",
     ARRIS_E_RECIPE},
};

static void every_error_has_its_place(void **state) {
    (void)state;
    for (size_t i = 0; i < COUNT(wrong); i++) {
        char line[1100];
        assert_null(arris_parse(wrong[i].line, &err));
        if (err.code != wrong[i].code || !strstr(err.text, wrong[i].text))
            fail_msg("'%s' says %d '%s'", wrong[i].line, err.code, err.text);
        snprintf(line, sizeof line, "%sEND", err.line);
        const char *at = wrong[i].at ? strstr(line, wrong[i].at) : NULL;
        if (err.column != (at ? (int)(at - line) : -1))
            fail_msg("'%s': the caret is at %d", wrong[i].line, err.column);
        assert_string_equal(err.line, wrong[i].line);
    }
}

static void errors_in_recipes_have_their_line(void **state) {
    (void)state;
    scratch_write("bad.arris",
                  "fakesrc frames=9   # nine\n  ! identity\n\t! identitty ! fakesink\n");
    assert_null(arris_parse(scratch("bad.arris"), &err));
    assert_string_equal(err.text, "there is no stage 'identitty'; did you mean 'identity'?");
    assert_string_equal(err.file, scratch("bad.arris"));
    assert_int_equal(err.line_number, 3);
    assert_string_equal(err.line, " ! identitty ! fakesink");
    assert_int_equal(err.column, 3);
    scratch_write("worse.arris", "fakesrc ! identity sleep=\\\n-1 ! fakesink");
    assert_null(arris_parse(scratch("worse.arris"), &err));
    assert_int_equal(err.code, ARRIS_E_USAGE);
}

/* A long line is cut around the place. */
static void long_lines_are_cut(void **state) {
    (void)state;
    char line[4000] = "fakesrc";
    for (int i = 0; i < 100; i++)
        strcat(line, " ! identity");
    strcat(line, " ! idéntity");
    for (int i = 0; i < 100; i++)
        strcat(line, " ! identity");
    strcat(line, " ! fakesink");
    assert_null(arris_parse(line, &err));
    assert_true(strlen(err.line) <= 101);
    assert_memory_equal(err.line + err.column, "idéntity ! ", 11);
}

static void stages_are_limited(void **state) {
    (void)state;
    static char line[16 * MAX_STAGES] = "fakesrc";
    for (int i = 0; i < MAX_STAGES; i++)
        strcat(line, " ! identity");
    assert_null(arris_parse(line, &err));
    assert_int_equal(err.code, ARRIS_E_RECIPE);
    assert_non_null(strstr(err.text, "more than 256 stages"));
}

static void errors_may_be_ignored(void **state) {
    (void)state;
    for (size_t i = 0; i < COUNT(wrong); i++)
        assert_null(arris_parse(wrong[i].line, NULL));
}

int main(void) {
    setenv("ARRIS_PLUGIN_PATH", "", 1);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(white_space_separates),
        cmocka_unit_test(quotes_keep),
        cmocka_unit_test(an_open_quote_is_an_error),
        cmocka_unit_test(a_recipe_stands_for_its_words),
        cmocka_unit_test(recipes_nest_relative_to_themselves),
        cmocka_unit_test(rings_of_recipes),
        cmocka_unit_test(deep_recipes_end),
        cmocka_unit_test(recipes_that_cannot_be_read),
        cmocka_unit_test(words_are_limited),
        cmocka_unit_test(chains_and_branches),
        cmocka_unit_test(words_and_one_line_are_the_same),
        cmocka_unit_test(every_error_has_its_place),
        cmocka_unit_test(errors_in_recipes_have_their_line),
        cmocka_unit_test(long_lines_are_cut),
        cmocka_unit_test(stages_are_limited),
        cmocka_unit_test(errors_may_be_ignored),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
