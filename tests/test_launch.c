/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_launch.c: the program `arris` as its users meet it: what it says about bad input, with which
 * exit code, its options, its catalogue and their examples, Ctrl-C, and what a terminal shows.
 */
#include <pty.h>
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

#define COUNT(a) (sizeof(a) / sizeof *(a))

/* ---- bad input ----------------------------------------------------------------------------- */

static void refused(const char *line, int code, const char *text, const char *at,
                    const char *hint) {
    process p = arris_run(line);
    assert_one_error(&p, line, code, text, at, hint);
}

static void bad_lines(void **state) {
    (void)state;
    static const struct {
        const char *line, *text, *at, *hint;
    } bad[] = {
        {"launch fakesrc ! fakesnk", "did you mean 'fakesink'?", "fakesnk", "arris stages"},
        {"launch fakesrc ! webcam ! fakesink", "there is no stage 'webcam'", "webcam", NULL},
        {"launch fakesrc frams=3 ! fakesink", "did you mean 'frames'?", "frams=3", "it has frames"},
        {"launch fakesrc ! fakesink sync=1", "fakesink has no property 'sync'", "sync", NULL},
        {"launch fakesrc ! queue max-frames=0 ! fakesink",
         "max-frames cannot be '0': it is a whole number from 1 to 1000 frames", "0 !", "wait"},
        {"launch fakesrc ! queue leaky=newst ! fakesink", "it is no|oldest|newest", "newst", NULL},
        {"launch fakesrc ! identity sleep=fast ! fakesink", "it is 0 to 60000 ms", "fast", NULL},
        {"launch fakesrc ! edges ! fakesink", "edges needs the layer 'image'", "edges", "imagesrc"},
        {"launch fakesrc ! testmap ! fakesink", "testmap needs the layer 'user0'", "testmap",
         "testsrc"},
        {"launch fakesrc ! testsrc ! fakesink", "'testsrc' is a second source", "testsrc", NULL},
        {"launch identity ! fakesink", "the pipeline has no source", "identity", "imagesrc"},
        {"launch fakesrc", "nothing takes what 'fakesrc' gives", "fakesrc", "sink"},
        {"launch fakesrc name=a ! fakesink name=a", "another stage is named 'a'", "a\n", NULL},
        {"launch fakesrc name=a: ! fakesink", "'a:' is not a valid name", "a: ", "letters"},
        {"launch fakesrc fakesink", "'!' is missing before 'fakesink'", "fakesink", NULL},
        {"launch fakesrc ! ! fakesink", "a stage is expected here", "! fakesink", NULL},
        {"launch fakesrc ! identity !", "a stage is expected after this '!'", "!\n", NULL},
        {"launch fakesrc ! edges!undistort ! fakesink", "this '!' touches other words",
         "!undistort", "white space on both sides"},
        {"launch fakesrc !identity ! fakesink", "this '!' touches other words", "!identity",
         "white space"},
        {"launch fakesrc ! fakesink t. ! fakesink", "no stage before this is named 't'", "t. !",
         "tee name="},
        {"launch none.arris", "cannot read the recipe 'none.arris': No such file", "none", NULL},
        {"launch fakesrc ! none.arris", "No such file", "none.arris", NULL},
        {"launch fakesrc ! testfail when=setup ! fakesink", "testfail: it fails", "testfail",
         "as it was told"},
        {"launch --bogus fakesrc ! fakesink", "unrecognized option '--bogus'", NULL, "--help"},
        {"launch -x fakesrc ! fakesink", "invalid option -- 'x'", NULL, "--help"},
        {"launch --trace", "requires an argument", NULL, "--help"},
        {"launch --check", "give it a pipeline", NULL, NULL},
        {"launch", "give it a pipeline", NULL, NULL},
        {"lanch fakesrc ! fakesink", "did you mean 'launch'?", NULL, "arris --help"},
        {"testword a", "there is no command 'testword'; did you mean 'testwords'?", NULL, NULL},
        {"stages nosuch", "there is no stage 'nosuch'", NULL, NULL},
        {"stages identitty", "did you mean 'identity'?", NULL, NULL},
        {"stages --bogus", "'--bogus' is not expected", NULL, NULL},
        {"stages tee queue", "'queue' is not expected", NULL, NULL},
    };
    for (size_t i = 0; i < COUNT(bad); i++) {
        int code = strstr(bad[i].line, "when=setup") ? 4 : 2;
        refused(bad[i].line, code, bad[i].text, bad[i].at, bad[i].hint);
    }
}

static void bad_lines_in_one_string(void **state) {
    (void)state;
    process p = arris_launch(NULL, "fakesrc ! identity sleep='1 ! fakesink");
    assert_one_error(&p, "a quote", 2, "a quote is opened here and not closed", "'1 !", NULL);
    p = arris_launch(NULL, "");
    assert_one_error(&p, "nothing", 2, "the pipeline is empty", NULL, "imagesrc");
    p = arris_launch(NULL, " fakesrc   !\t fakesnk");
    assert_one_error(&p, "blanks", 2, "there is no stage 'fakesnk'", "fakesnk", NULL);
    p = arris_launch(NULL, "fakesrc ! \033[31m\a ! fakesink"); /* plays no tricks on a terminal */
    assert_null(strchr(p.err, '\a'));
    process_free(&p);
}

static void bad_recipes(void **state) {
    (void)state;
    char text[8192];
    scratch_write("self.arris", "fakesrc\n ! self.arris\n");
    process p = arris_launch(NULL, scratch("self.arris"));
    snprintf(text, sizeof text, "%s:2: the recipe 'self.arris' includes itself",
             scratch("self.arris"));
    assert_one_error(&p, "itself", 2, text, "self.arris", "take this line out");
    scratch_write("a.arris", "# the first\nb.arris ! fakesink");
    scratch_write("b.arris", "fakesrc frames=3 !\n\n  a.arris");
    p = arris_launch(NULL, scratch("a.arris"));
    snprintf(text, sizeof text, "%s:3: the recipe 'a.arris' includes itself", scratch("b.arris"));
    assert_one_error(&p, "a ring", 2, text, "a.arris", NULL);
    scratch_write("bad.arris", "fakesrc frames=3\n  ! identity slep=1 # typo\n  ! fakesink");
    p = arris_launch(NULL, scratch("bad.arris"));
    snprintf(text, sizeof text, "%s:2: identity has no property 'slep'; did you mean 'sleep'?",
             scratch("bad.arris"));
    assert_one_error(&p, "a typo", 2, text, "slep=1", NULL);
}

/* ---- plugins that cannot be loaded ----------------------------------------------------------- */

/* A folder with X.so and, when `list` is not NULL, X.stages. */
static void plugin_folder(const char *list) {
    scratch_mkdir("broken");
    if (list)
        scratch_write("broken/x.stages", "%s", list);
    setenv("ARRIS_PLUGIN_PATH", scratch("broken"), 1);
}

static void broken_plugin(const char *stage, const char *list, const char *why) {
    char line[200], text[4200];
    snprintf(line, sizeof line, "launch fakesrc ! %s ! fakesink", stage);
    snprintf(text, sizeof text,
             list ? "the plugin of '%s' cannot be loaded: " : "there is no stage '%s'", stage);
    refused(line, 2, text, stage, why);
    if (!list) /* says which file it is */
        refused(line, 2, text, stage, "/broken/x.so");
}

static void plugins_that_cannot_be_loaded(void **state) {
    (void)state;
    static const struct {
        const char *made, *stage, *why;
    } bad[] = {
        {"tests/plugins/undefined.so", "testundefined",
         "undefined symbol: a_function_that_nothing_has"},
        {"tests/plugins/abi.so", "testabi", "it was built for ABI 2 of Arris, this is ABI 1"},
        {"tests/plugins/short.so", "testshort", "its descriptor is too short"},
        {"lib/libarris.so.1", "testnone", "undefined symbol: arris_plugin"},
    };
    for (size_t i = 0; i < COUNT(bad); i++)
        for (int with_list = 0; with_list < 2; with_list++) {
            char list[100];
            snprintf(list, sizeof list, "stage other\nstage %s\n", bad[i].stage);
            plugin_folder(with_list ? list : NULL);
            scratch_link("broken/x.so", bad[i].made);
            broken_plugin(bad[i].stage, with_list ? list : NULL, bad[i].why);
        }
    for (int with_list = 0; with_list < 2; with_list++) {
        const char *list = with_list ? "stage testjunk\n" : NULL;
        plugin_folder(list);
        scratch_write("broken/x.so", "%0200d", 7);
        broken_plugin("testjunk", list, "invalid ELF header");
        scratch_write("broken/x.so", "%s", "");
        broken_plugin("testjunk", list, "file too short");
    }
    plugin_folder("stage testold\n");
    scratch_link("broken/x.so", "tests/plugins/parts.so");
    broken_plugin("testold", "", "its list is stale");
}

/* What a line does not name does not disturb it. */
static void broken_plugins_disturb_nobody(void **state) {
    (void)state;
    plugin_folder(NULL);
    scratch_link("broken/x.so", "tests/plugins/undefined.so");
    scratch_write("broken/y.so", "no ELF at all, and longer than its header would have to be 0123");
    scratch_write("broken/README", "not a plugin");
    process p = arris_run("launch fakesrc frames=3 ! fakesink");
    assert_true(p.code == 0 && !*p.out && !*p.err);
    process_free(&p);
    p = arris_run("stages");
    assert_true(p.code == 0 && strstr(p.out, "fakesink") && !*p.err);
    process_free(&p);
    setenv("ARRIS_PLUGIN_PATH", "/no/such/folder::/dev/null:", 1);
    p = arris_run("launch fakesrc frames=3 ! fakesink");
    assert_int_equal(p.code, 0);
    process_free(&p);
}

/* ---- what it does when all is well ----------------------------------------------------------- */

static int with_parts(void **state) {
    (void)state;
    unlink(scratch("log"));
    return setenv("ARRIS_PLUGIN_PATH", scratch("plugins"), 1);
}

/* Runs `arris FORMAT`, which must succeed and write nothing to stderr. */
static process done(const char *format, ...) {
    char line[8192];
    va_list ap;
    va_start(ap, format);
    vsnprintf(line, sizeof line, format, ap);
    va_end(ap);
    process p = arris_run(line);
    if (p.code || *p.err)
        fail_msg("'%s' ends with %d and says:\n%s", line, p.code, p.err);
    return p;
}

static void assert_log(const char *begins, const char *ends) {
    char *log = file_text(scratch("log"));
    size_t n = strlen(log), m = strlen(ends);
    if (strncmp(log, begins, strlen(begins)) || n < m || strcmp(log + n - m, ends))
        fail_msg("not from '%s' to '%s':\n%s", begins, ends, log);
    free(log);
}

static void words_a_string_and_a_recipe_do_the_same(void **state) {
    (void)state;
    static const char line[] = "testsrc frames=40 ! testmap ! queue ! testnote label=a log=%s";
    char whole[8192], *first, *log;
    process p = done("launch testsrc frames=40 ! testmap ! queue ! testnote label=a log=%s",
                     scratch("log"));
    assert_string_equal(p.out, "");
    process_free(&p);
    first = file_text(scratch("log"));
    assert_log("a setup\na frame 0 100 0 value 22 ", "a finish 40\na close\n");
    snprintf(whole, sizeof whole, line, scratch("log"));
    unlink(scratch("log"));
    p = arris_launch(NULL, whole);
    assert_int_equal(p.code, 0);
    process_free(&p);
    log = file_text(scratch("log"));
    assert_string_equal(log, first);
    free(log);
    unlink(scratch("log"));
    scratch_write("good.arris", line, scratch("log"));
    p = done("launch %s", scratch("good.arris"));
    process_free(&p);
    log = file_text(scratch("log"));
    assert_string_equal(log, first);
    free(log);
    free(first);
}

static void check_runs_nothing(void **state) {
    (void)state;
    process p = done("launch --check testsrc ! testmap ! queue ! testnote log=%s", scratch("log"));
    assert_non_null(strstr(p.out, "testmap        lane 0   user0 -> user0"));
    assert_non_null(strstr(p.out, "queue          lane 1"));
    process_free(&p);
    assert_log("note setup\n", "note setup\nnote close\n");
    p = done("launch testsrc ! testnote --check"); /* an option may stand anywhere */
    process_free(&p);
    refused("launch --check fakesrc ! testmap ! fakesink", 2, "needs the layer", "testmap", NULL);
}

static void stats_are_printed(void **state) {
    (void)state;
    process p = done("launch --stats testsrc frames=30 ! testmap ! testdrop every=3 ! queue ! "
                     "testnote name=last");
    static const char *const words[] = {"p50",           "p99",          "testsrc",   "testdrop",
                                        "queue",         "last",         "fill",      "odd 15",
                                        "from exposure", "30 frames in", "frames/s\n"};
    for (size_t i = 0; i < COUNT(words); i++)
        assert_non_null(strstr(p.out, words[i]));
    process_free(&p);
}

/* Every frame is there at every stage, with its lane, and a lane does one thing at a time. */
static void the_trace_is_json(void **state) {
    (void)state;
    process p = done("launch --trace %s testsrc frames=50 ! testmap ! queue ! testnote name=a-b_9",
                     scratch("trace"));
    process_free(&p);
    json_error_t e;
    json_t *root = json_load_file(scratch("trace"), 0, &e), *event;
    size_t i;
    int seen[2][50] = {0};
    double until[2] = {0};
    if (!root)
        fail_msg("line %d: %s", e.line, e.text);
    json_array_foreach(root, i, event) {
        const char *kind, *name;
        int lane, frame;
        double at, took;
        assert_int_equal(json_unpack(event, "{s:s, s:s}", "ph", &kind, "name", &name), 0);
        if (strcmp(kind, "X"))
            continue;
        assert_int_equal(json_unpack(event, "{s:i, s:F, s:F, s:{s:i}}", "tid", &lane, "ts", &at,
                                     "dur", &took, "args", "frame", &frame),
                         0);
        assert_in_range(lane, 0, 1);
        assert_int_equal(lane, strcmp(name, "a-b_9") == 0);
        assert_true(took >= 0 && at >= until[lane] - 0.01);
        until[lane] = at + took;
        if (frame < 50) /* the last goes through finish */
            seen[lane][frame]++;
    }
    for (int k = 0; k < 50; k++)
        assert_true(seen[0][k] == 2 && seen[1][k] == 1);
    json_decref(root);
    refused("launch --trace /no/such/folder/t fakesrc frames=1 ! fakesink", 4,
            "cannot write the trace", NULL, NULL);
}

static void the_graph_is_written(void **state) {
    (void)state;
    static const char line[] = "testsrc frames=3 ! tee name=t t. ! queue ! fakesink t. ! fakesink";
    process p = done("launch --dot %s %s", scratch("graph"), line);
    char *dot = file_text(scratch("graph"));
    assert_memory_equal(dot, "digraph ", 8);
    assert_non_null(strstr(dot, "\"t\" -> \"queue\""));
    process_free(&p);
    p = done("launch --check --dot - %s", line);
    assert_memory_equal(p.out, dot, strlen(dot)); /* and then the same as text */
    process_free(&p);
    free(dot);
    refused("launch --dot /no/such/folder/g fakesrc ! fakesink", 4, "cannot write the graph", NULL,
            NULL);
}

static void messages_go_to_stderr(void **state) {
    (void)state;
    static const char line[] = "testsrc ! testfail at=2 warnings=2 ! fakesink";
    static const char warnings[] = "arris: warning: testfail: frame 2: warning 0\n"
                                   "arris: warning: testfail: frame 2: warning 1\n";
    static const char error[] = "arris: error: testfail: frame 2: it fails\n  as it was told\n";
    char text[200];
    process p = arris_launch(NULL, line);
    snprintf(text, sizeof text, "%s%s", warnings, error);
    assert_int_equal(p.code, 4);
    assert_string_equal(p.out, "");
    assert_string_equal(p.err, text);
    process_free(&p);
    snprintf(text, sizeof text, "launch -q %s", line);
    p = arris_run(text);
    assert_int_equal(p.code, 4);
    assert_string_equal(p.err, error);
    process_free(&p);
    p = arris_run("launch -v fakesrc frames=7 ! fakesink");
    assert_true(p.code == 0 && strstr(p.err, "7 frames"));
    process_free(&p);
}

static void version_and_help(void **state) {
    (void)state;
    process p = done("--version");
    int major, minor, patch, end = 0;
    assert_int_equal(sscanf(p.out, "arris %d.%d.%d%n", &major, &minor, &patch, &end), 3);
    assert_string_equal(p.out + end, "\n");
    process_free(&p);
    p = done("--help");
    static const char *const words[] = {"arris launch", "arris stages", "--check", "--stats",
                                        "--trace",      "--dot",        "-q",      "Exit codes"};
    for (size_t i = 0; i < COUNT(words); i++)
        assert_non_null(strstr(p.out, words[i]));
    process_free(&p);
    p = arris_run("");
    assert_true(p.code == 2 && !*p.out && strstr(p.err, "usage: arris"));
    process_free(&p);
}

/* A disk that is full is no success. */
static void plugins_give_commands(void **state) {
    (void)state;
    process p = arris_run("testwords one two");
    assert_int_equal(p.code, 3);
    assert_string_equal(p.out, "testwords\none\ntwo\n");
    process_free(&p);
    p = arris_run("--help");
    assert_non_null(strstr(p.out, "testwords    prints its words"));
    process_free(&p);
}

static void what_cannot_be_printed_is_an_error(void **state) {
    (void)state;
    static const char *const line[] = {"--help", "stages --json",
                                       "launch --check 'fakesrc ! fakesink'",
                                       "launch --stats 'fakesrc frames=9 ! fakesink'"};
    for (size_t i = 0; i < COUNT(line); i++) {
        char command[8192];
        snprintf(command, sizeof command, "exec %s %s > /dev/full", arris_path(), line[i]);
        process p =
            process_start(NULL, -1, (char *[]){(char *)"/bin/sh", (char *)"-c", command, NULL});
        process_wait(&p);
        assert_one_error(&p, line[i], 4, "No space left on device", NULL, NULL);
    }
}

/* ---- the catalogue --------------------------------------------------------------------------- */

static json_t *catalogue(void) {
    process p = done("stages --json");
    json_error_t e;
    json_t *root = json_loads(p.out, 0, &e);
    if (!json_is_array(root))
        fail_msg("line %d: %s", e.line, e.text);
    process_free(&p);
    return root;
}

static const char *text_of(json_t *o, const char *key) {
    return json_string_value(json_object_get(o, key));
}

static void every_stage_is_described(void **state) {
    (void)state;
    unsetenv("ARRIS_PLUGIN_PATH");
    json_t *root = catalogue(), *stage, *property;
    process list = done("stages");
    size_t i, k;
    const char *last = "";
    json_array_foreach(root, i, stage) {
        const char *name = text_of(stage, "name");
        assert_non_null(name);
        if (strcmp(last, name) >= 0 || !text_of(stage, "summary") || !text_of(stage, "example"))
            fail_msg("'%s' is not in order, or has no summary or example", name);
        last = name;
        assert_non_null(strstr(list.out, name));
        process p = done("stages %s", name), j = done("stages %s --json", name);
        assert_non_null(strstr(p.out, text_of(stage, "summary")));
        assert_non_null(strstr(p.out, text_of(stage, "example")));
        json_t *alone = json_loads(j.out, 0, NULL);
        assert_true(json_equal(alone, stage));
        json_array_foreach(json_object_get(stage, "properties"), k, property) {
            if (!text_of(property, "name") || !text_of(property, "type") ||
                !text_of(property, "help"))
                fail_msg("property %zu of '%s' is not explained", k, name);
            assert_non_null(strstr(p.out, text_of(property, "name")));
            assert_non_null(strstr(p.out, text_of(property, "help")));
        }
        json_decref(alone);
        process_free(&p);
        process_free(&j);
    }
    assert_true(i >= 6);
    process_free(&list);
    json_decref(root);
}

/* A folder as the examples expect it: a short scan with its camera, and the samples. */
static const char *example_folder(void) {
    char here[PATH_MAX], to[2 * PATH_MAX];
    scratch_mkdir("examples");
    if (!getcwd(here, sizeof here))
        abort();
    static const char *const link[][2] = {{"samples", "samples"},
                                          {"samples/box/frames", "frames"},
                                          {"samples/box/camera.json", "camera.json"}};
    for (size_t i = 0; i < COUNT(link); i++) {
        char name[64];
        snprintf(to, sizeof to, "%s/%s", here, link[i][0]);
        snprintf(name, sizeof name, "examples/%s", link[i][1]);
        if (symlink(to, scratch(name)))
            abort();
    }
    char *csv = file_text("samples/box/frames.csv"), *end = csv;
    for (int i = 0; i < 13 && end && *end; i++)
        end = strchr(end, '\n') + 1;
    scratch_write("examples/frames.csv", "%.*s", (int)(end - csv), csv);
    free(csv);
    return scratch("examples");
}

static void every_example_runs(void **state) {
    (void)state;
    unsetenv("ARRIS_PLUGIN_PATH");
    const char *folder = example_folder();
    json_t *root = catalogue(), *stage;
    size_t i;
    int bad = 0;
    json_array_foreach(root, i, stage) {
        process p = arris_launch(folder, text_of(stage, "example"));
        if (p.code == 4 && strstr(p.err, "plug one in")) /* a camera, which this machine has not */
            p.code = 0;
        if (p.code)
            print_error("%s's example '%s' ends with %d and says\n%s", text_of(stage, "name"),
                        text_of(stage, "example"), p.code, p.err);
        bad += p.code != 0;
        process_free(&p);
    }
    json_decref(root);
    assert_int_equal(bad, 0);
}

/* ---- Ctrl-C ---------------------------------------------------------------------------------- */

static void wait_for_log(const char *text) {
    for (int ms = 0;; ms++) {
        char *log = file_text(scratch("log"));
        bool there = strstr(log, text);
        free(log);
        if (there)
            return;
        if (ms == 1000 * LIMIT_S)
            fail_msg("'%s' never comes", text);
        usleep(1000);
    }
}

/* Sends a signal and waits until the process has taken it, lest two become one. */
static void signal_once(const process *p, int number) {
    char path[64];
    unsigned long long pending = ~0ull;
    snprintf(path, sizeof path, "/proc/%d/status", (int)p->pid);
    kill(p->pid, number);
    while (pending >> (number - 1) & 1) {
        char *status = file_text(path), *line = strstr(status, "ShdPnd:");
        pending = line ? strtoull(line + 7, NULL, 16) : 0;
        free(status);
        usleep(1000);
    }
}

static process endless(const char *middle) {
    char line[8192];
    snprintf(line, sizeof line, "launch testsrc ! %s ! testnote log=%s", middle, scratch("log"));
    process p = arris_begin(NULL, -1, line);
    wait_for_log("frame 2 ");
    return p;
}

static void the_first_signal_drains(void **state) {
    (void)state;
    static const int number[] = {SIGINT, SIGTERM};
    for (size_t i = 0; i < COUNT(number); i++) {
        unlink(scratch("log"));
        process p = endless("queue max-frames=9 ! testhold ms=2 ! queue");
        signal_once(&p, number[i]);
        process_wait(&p);
        assert_int_equal(p.code, 0);
        assert_true(!*p.out && !*p.err);
        char *log = file_text(scratch("log")), *end = strstr(log, "note finish ");
        assert_non_null(end);
        int frames = 0, made = atoi(end + 12); /* all that were made came through */
        for (char *l = log; (l = strstr(l, " frame ")); l++)
            frames++;
        assert_int_equal(frames, made);
        free(log);
        process_free(&p);
    }
}

/* Draining a thousand frames would take ten seconds, and finish would be noted. */
static void the_second_signal_aborts(void **state) {
    (void)state;
    process p = endless("queue max-frames=1000 ! testhold ms=10");
    signal_once(&p, SIGINT);
    signal_once(&p, SIGINT);
    process_wait(&p);
    assert_one_error(&p, "aborted", 5, "aborted", NULL, NULL);
    char *log = file_text(scratch("log"));
    assert_null(strstr(log, "finish"));
    assert_non_null(strstr(log, "close"));
    free(log);
}

static void the_third_signal_kills(void **state) {
    (void)state;
    char line[8192];
    snprintf(line, sizeof line, "launch testsrc ! testnote log=%s ! testhold ms=10000 ! fakesink",
             scratch("log"));
    process p = arris_begin(NULL, -1, line);
    wait_for_log("frame 0 ");
    signal_once(&p, SIGINT);
    signal_once(&p, SIGINT);
    kill(p.pid, SIGINT);
    process_wait(&p);
    assert_int_equal(p.code, 128 + SIGINT);
    process_free(&p);
}

/* ---- the terminal ---------------------------------------------------------------------------- */

/* What a run shows on a terminal. */
static void on_terminal(const char *line, char *text, size_t size) {
    int master, slave;
    size_t n = 0;
    assert_int_equal(openpty(&master, &slave, NULL, NULL, NULL), 0);
    process p = arris_begin(NULL, slave, line);
    close(slave);
    for (ssize_t got; n + 1 < size && (got = read(master, text + n, size - 1 - n)) > 0;)
        n += (size_t)got; /* until the program has closed it */
    text[n] = '\0';
    process_wait(&p);
    assert_int_equal(p.code, 0);
    process_free(&p);
    close(master);
}

static void progress_is_for_terminals(void **state) {
    (void)state;
    static const char line[] = "launch fakesrc frames=40 ! identity sleep=10 ! fakesink";
    char text[20000];
    on_terminal(line, text, sizeof text);
    assert_memory_equal(text, "\r\033[K", 4); /* writes over the line before */
    assert_non_null(strstr(text, "40 frames"));
    assert_true(strstr(text + 1, "\r\033[K") != NULL); /* more than once on the way */
    on_terminal("launch -q fakesrc frames=40 ! identity sleep=10 ! fakesink", text, sizeof text);
    assert_string_equal(text, "");
    process p = done("%s", line); /* elsewhere nothing */
    assert_string_equal(p.out, "");
    process_free(&p);
}

int main(void) {
    scratch_mkdir("plugins");
    scratch_link("plugins/parts.so", "tests/plugins/parts.so");
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(bad_lines, with_parts),
        cmocka_unit_test_setup(bad_lines_in_one_string, with_parts),
        cmocka_unit_test_setup(bad_recipes, with_parts),
        cmocka_unit_test(plugins_that_cannot_be_loaded),
        cmocka_unit_test(broken_plugins_disturb_nobody),
        cmocka_unit_test_setup(words_a_string_and_a_recipe_do_the_same, with_parts),
        cmocka_unit_test_setup(check_runs_nothing, with_parts),
        cmocka_unit_test_setup(stats_are_printed, with_parts),
        cmocka_unit_test_setup(the_trace_is_json, with_parts),
        cmocka_unit_test_setup(the_graph_is_written, with_parts),
        cmocka_unit_test_setup(messages_go_to_stderr, with_parts),
        cmocka_unit_test_setup(version_and_help, with_parts),
        cmocka_unit_test_setup(plugins_give_commands, with_parts),
        cmocka_unit_test_setup(what_cannot_be_printed_is_an_error, with_parts),
        cmocka_unit_test(every_stage_is_described),
        cmocka_unit_test(every_example_runs),
        cmocka_unit_test_setup(the_first_signal_drains, with_parts),
        cmocka_unit_test_setup(the_second_signal_aborts, with_parts),
        cmocka_unit_test_setup(the_third_signal_kills, with_parts),
        cmocka_unit_test_setup(progress_is_for_terminals, with_parts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
