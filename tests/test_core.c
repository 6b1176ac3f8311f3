/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_core.c: whole pipelines: the graph's check, the life of stages, branches, drops, errors,
 * stop and abort, live sources, feedback, and that what comes out never depends on threads. The
 * stages are those of tests/plugins/parts.c, loaded as any plugin is; `testnote` writes down what
 * it sees.
 */
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "internal.h"
#include "scratch.h"

/* ---- a run and what is left of it ------------------------------------------------------------ */

static struct {
    arris_pipeline *p;
    arris_error err;
    arris_message error; /* the last one */
    int errors, warnings, others, result;
    arris_progress progress;
    char *log, *stats;
} run;

static void begin(const char *line) {
    free(run.log);
    free(run.stats);
    memset(&run, 0, sizeof run);
    unlink(scratch("log"));
    run.p = arris_parse(line, &run.err);
}

static bool checks(const char *line) {
    begin(line);
    return run.p && arris_check(run.p, &run.err) == 0;
}

static void start(const char *line) {
    if (!checks(line) || arris_start(run.p, &run.err))
        fail_msg("%s: %s", line, run.err.text);
}

static void listen(void) {
    arris_message m;
    enum arris_wait_result r;
    for (int turns = 0; (r = arris_wait(run.p, &m, 1000)) != ARRIS_WAIT_ENDED; turns++) {
        if (turns == 600)
            fail_msg("the stream does not end");
        if (r == ARRIS_WAIT_TIMEOUT)
            continue;
        run.errors += m.severity == ARRIS_ERROR;
        run.warnings += m.severity == ARRIS_WARNING && m.frame >= 0;
        if (m.severity == ARRIS_ERROR)
            run.error = m;
    }
}

static void end(void) {
    size_t size;
    FILE *f = open_memstream(&run.stats, &size);
    if (run.p && run.p->started) {
        run.result = arris_result(run.p);
        run.progress = arris_get_progress(run.p);
        arris_print_stats(run.p, f);
    }
    fclose(f);
    arris_free(run.p);
    run.log = file_text(scratch("log"));
}

static void play(const char *line) {
    start(line);
    listen();
    end();
}

/* The log's line that starts with these words, or NULL. */
static const char *find(const char *format, ...) {
    char what[200];
    va_list ap;
    va_start(ap, format);
    vsnprintf(what, sizeof what, format, ap);
    va_end(ap);
    for (const char *l = run.log; l && *l; l = strchr(l, '\n') ? strchr(l, '\n') + 1 : NULL)
        if (strncmp(l, what, strlen(what)) == 0)
            return l;
    return NULL;
}

static int count(const char *what) {
    int n = 0;
    for (const char *l = run.log; (l = strstr(l, what)); l++)
        n++;
    return n;
}

/* The value that `label` noted in frame `seq`; -1 when it never saw that frame. */
static long long value(const char *label, int seq) {
    const char *l = find("%s frame %d ", label, seq);
    return l ? atoll(strstr(l, "value ") + 6) : -1;
}

static const char *address(const char *label, int seq) {
    static char text[2][32];
    static int turn;
    const char *l = find("%s frame %d ", label, seq);
    turn = !turn;
    snprintf(text[turn], sizeof text[turn], "%.*s", l ? (int)strcspn(strstr(l, "at "), "\n") : 0,
             l ? strstr(l, "at ") : "");
    return text[turn];
}

static long long made(int seq) {
    return (long long)seq * seq + 7;
}

/* LOG in a line stands for the log's path. */
#define LOG "log=LOG"
static const char *with_log(const char *line) {
    static char text[8192];
    size_t at = 0;
    for (const char *next; (next = strstr(line, "LOG")); line = next + 3)
        at += (size_t)snprintf(text + at, sizeof text - at, "%.*s%s", (int)(next - line), line,
                               scratch("log"));
    snprintf(text + at, sizeof text - at, "%s", line);
    return text;
}

/* ---- the graph ------------------------------------------------------------------------------- */

static void a_missing_layer_names_its_givers(void **state) {
    (void)state;
    assert_false(checks("testsrc ! identity ! testnote need=user1"));
    assert_int_equal(run.err.code, ARRIS_E_RECIPE);
    assert_string_equal(run.err.text,
                        "testnote needs the layer 'user1', which nothing before it gives");
    assert_string_equal(run.err.hint, "put a stage that gives it before: testgive");
    assert_int_equal(run.err.column, 21);
    end();
    assert_false(checks("fakesrc ! testmap name=first ! fakesink"));
    assert_string_equal(run.err.text,
                        "first needs the layer 'user0', which nothing before it gives");
    assert_string_equal(run.err.hint,
                        "put a stage that gives it before: testahead, testask, testmap, testsrc");
    assert_int_equal(run.err.column, 10);
    end();
    assert_false(checks("testsrc ! tee name=t t. ! testgive ! fakesink t. ! testnote need=user1"));
    assert_int_equal(run.err.column, 51); /* the other branch's layer does not count */
    end();
    assert_true(checks("testsrc ! testgive ! tee name=t t. ! fakesink t. ! testnote need=user1"));
    end();
}

static void settling_narrows_what_is_needed(void **state) {
    (void)state;
    assert_true(checks("fakesrc ! testnote need=nothing"));
    end();
    assert_false(checks("fakesrc ! testnote need=user0"));
    end();
    assert_false(checks("fakesrc ! testfail when=settle ! fakesink"));
    assert_int_equal(run.err.code, ARRIS_E_INPUT);
    assert_string_equal(run.err.text, "testfail: it fails");
    assert_string_equal(run.err.hint, "as it was told");
    assert_int_equal(run.err.column, 10);
    end();
}

static void what_is_given_is_reserved(void **state) {
    (void)state;
    assert_false(checks("fakesrc ! testgive forget=yes ! fakesink"));
    assert_int_equal(run.err.code, ARRIS_E_INTERNAL);
    assert_non_null(strstr(run.err.text, "has not reserved"));
    end();
    assert_true(checks("fakesrc ! testgive ! fakesink"));
    assert_int_equal(arris_reserve(run.p->stage[2], ARRIS_USER0, 1, 0), ARRIS_E_INTERNAL);
    end();
}

static char *printed(void (*print)(const arris_pipeline *, FILE *)) {
    char *text;
    size_t size;
    FILE *f = open_memstream(&text, &size);
    print(run.p, f);
    fclose(f);
    return text;
}

static void the_graph_is_printed(void **state) {
    (void)state;
    assert_true(
        checks("testsrc live=yes ! tee name=t t. ! queue ! testmap ! fakesink t. ! testnote"));
    char *text = printed(arris_print), *dot = printed(arris_print_dot);
    assert_non_null(strstr(text, "testsrc        lane 0   nothing -> user0\n"));
    assert_non_null(
        strstr(text, "queue2         lane 1   nothing -> nothing   (put in by the host)"));
    assert_non_null(strstr(text, "queue          lane 2"));
    assert_non_null(strstr(text, "testmap        lane 2   user0 -> user0"));
    assert_non_null(strstr(text, "testnote       lane 1   user0 -> nothing"));
    assert_non_null(strstr(text, "to queue, testnote"));
    assert_memory_equal(dot, "digraph ", 8);
    assert_non_null(strstr(dot, "\"testsrc\" -> \"queue2\" [label=\"user0\"]"));
    assert_non_null(strstr(dot, "\"t\" -> \"testnote\""));
    assert_string_equal(dot + strlen(dot) - 2, "}\n");
    free(text);
    free(dot);
    end();
    assert_true(checks("testahead ! fakesink"));
    text = printed(arris_print);
    assert_non_null(strstr(text, "put in by the host"));
    free(text);
    end();
    assert_true(checks("testahead ! queue ! fakesink")); /* there is one */
    text = printed(arris_print);
    assert_null(strstr(text, "put in by the host"));
    free(text);
    end();
}

/* ---- the life of stages ---------------------------------------------------------------------- */

static void assert_order(const char *first, const char *second) {
    const char *a = find("%s", first), *b = find("%s", second);
    if (!a || !b || a > b)
        fail_msg("'%s' does not stand before '%s' in\n%s", first, second, run.log);
}

static void setup_and_finish_go_downstream(void **state) {
    (void)state;
    play(with_log("testsrc frames=30 ! testnote label=a " LOG " ! queue ! testnote label=b " LOG
                  " ! tee name=t t. ! queue ! testnote label=c " LOG
                  " t. ! testnote label=d " LOG));
    assert_order("a setup", "b setup");
    assert_order("b setup", "c setup");
    assert_order("c setup", "d setup");
    assert_order("d setup", "a frame 0");
    assert_order("a frame 29", "a finish 30");
    assert_order("a finish 30", "b finish 30");
    assert_order("b frame 29", "b finish 30");
    assert_order("b finish 30", "c finish 30");
    assert_order("b finish 30", "d finish 30");
    assert_order("c finish 30", "c close");
    assert_order("d finish 30", "a close");
    assert_int_equal(count("finish"), 4);
    assert_int_equal(count("close"), 4);
    for (int i = 0; i < 30; i++)
        assert_true(value("a", i) == made(i) && value("c", i) == made(i) &&
                    value("d", i) == made(i));
    assert_non_null(find("a frame 29 129 29000 ")); /* index and utime, as the source said */
    assert_int_equal(run.result, 0);
    assert_int_equal(run.progress.frames, 30);
    assert_int_equal(run.progress.done, 30);
    assert_int_equal(run.progress.dropped, 0);
}

static void no_frame_at_all(void **state) {
    (void)state;
    play(with_log("testsrc frames=0 ! queue ! testnote label=a " LOG));
    assert_order("a setup", "a finish 0");
    assert_int_equal(count("frame"), 0);
    assert_int_equal(run.result, 0);
}

static void a_failed_setup_closes_what_was_set_up(void **state) {
    (void)state;
    assert_false(checks(with_log("testsrc ! testnote label=a " LOG
                                 " ! testfail when=setup ! testnote label=b " LOG)));
    assert_int_equal(run.err.code, ARRIS_E_INPUT);
    assert_string_equal(run.err.text, "testfail: it fails");
    assert_memory_equal(run.err.line + run.err.column, "testfail when", 13);
    assert_int_equal(arris_start(run.p, &run.err), ARRIS_E_USAGE); /* it is refused */
    end();
    assert_non_null(find("a close"));
    assert_null(find("b"));
}

static void a_pipeline_starts_once_and_checked(void **state) {
    (void)state;
    begin("fakesrc frames=3 ! fakesink");
    assert_int_equal(arris_start(run.p, &run.err), ARRIS_E_USAGE);
    assert_int_equal(arris_check(run.p, NULL), 0);
    assert_int_equal(arris_start(run.p, NULL), 0);
    assert_int_equal(arris_start(run.p, NULL), ARRIS_E_USAGE);
    listen();
    end();
    begin("fakesrc ! fakesink"); /* and may be freed at any time */
    end();
    assert_true(checks("fakesrc ! queue ! fakesink"));
    end();
    start("fakesrc ! queue ! fakesink");
    end();
    arris_free(NULL);
}

/* ---- branches -------------------------------------------------------------------------------- */

static void branches_share_layers(void **state) {
    (void)state;
    static const char *const line[] = {
        "testsrc frames=50 ! tee name=t t. ! testnote label=a address=yes log=LOG "
        "t. ! testnote label=b address=yes log=LOG",
        "testsrc frames=50 ! tee name=t t. ! queue ! testnote label=a address=yes log=LOG "
        "t. ! queue ! identity ! testnote label=b address=yes log=LOG"};
    for (size_t k = 0; k < COUNT(line); k++) {
        play(with_log(line[k]));
        for (int i = 0; i < 50; i++) {
            assert_true(value("a", i) == made(i) && value("b", i) == made(i));
            assert_string_equal(address("a", i), address("b", i));
        }
    }
}

static void a_branch_replaces_its_own_only(void **state) {
    (void)state;
    static const char *const line[] = {
        "testsrc frames=200 ! tee name=t t. ! testmap ! testmap ! testnote label=a log=LOG "
        "t. ! testnote label=b log=LOG t. ! testmap ! testnote label=c log=LOG",
        "testsrc frames=200 ! tee name=t t. ! queue ! testmap ! queue ! testmap ! testnote label=a "
        "log=LOG t. ! queue ! testnote label=b log=LOG t. ! testmap ! queue ! testnote label=c "
        "log=LOG"};
    for (size_t k = 0; k < COUNT(line); k++) {
        play(with_log(line[k]));
        assert_int_equal(run.result, 0);
        for (int i = 0; i < 200; i++) {
            assert_true(value("a", i) == 3 * (3 * made(i) + 1) + 1);
            assert_true(value("b", i) == made(i));
            assert_true(value("c", i) == 3 * made(i) + 1);
        }
    }
}

static void tees_nest(void **state) {
    (void)state;
    play(
        with_log("testsrc frames=99 ! tee name=t t. ! tee name=u u. ! queue ! testnote label=a " LOG
                 " u. ! testmap ! tee name=v v. ! testnote label=b " LOG " v. ! queue ! testnote "
                 "label=c " LOG " t. ! queue max-frames=7 ! testmap ! testnote label=d " LOG));
    assert_int_equal(run.result, 0);
    for (int i = 0; i < 99; i++) {
        assert_true(value("a", i) == made(i) && value("b", i) == 3 * made(i) + 1);
        assert_true(value("c", i) == 3 * made(i) + 1 && value("d", i) == 3 * made(i) + 1);
    }
    assert_int_equal(count("finish"), 4);
}

/* ---- drops ----------------------------------------------------------------------------------- */

static void a_stage_drops_frames(void **state) {
    (void)state;
    play(with_log("testsrc frames=30 ! testdrop every=3 ! queue ! testnote label=a " LOG));
    for (int i = 0; i < 30; i++)
        assert_true(value("a", i) == (i % 3 ? made(i) : -1));
    assert_non_null(find("a finish 30"));
    assert_int_equal(run.progress.dropped, 10);
    assert_int_equal(run.progress.frames, 30);
    assert_int_equal(run.progress.done, 20);
}

static void a_drop_in_a_branch_is_its_own(void **state) {
    (void)state;
    play(with_log("testsrc frames=20 ! tee name=t t. ! testdrop every=1 ! testnote label=a " LOG
                  " t. ! testnote label=b " LOG));
    for (int i = 0; i < 20; i++)
        assert_true(value("a", i) == -1 && value("b", i) == made(i));
    assert_non_null(find("a finish 20"));
}

static void counters_are_shown(void **state) {
    (void)state;
    play("testsrc frames=30 ! testmap ! testdrop every=3 ! queue ! fakesink");
    assert_non_null(strstr(run.stats, "odd 15")); /* 3 (i² + 7) + 1 is odd for every odd i */
    unsigned long long frames, dropped;
    assert_int_equal(sscanf(strstr(run.stats, "testdrop"), "testdrop %llu %llu", &frames, &dropped),
                     2);
    assert_true(frames == 30 && dropped == 10);
    assert_int_equal(sscanf(strstr(run.stats, "fakesink"), "fakesink %llu %llu", &frames, &dropped),
                     2);
    assert_true(frames == 20 && dropped == 0);
    assert_non_null(strstr(run.stats, "of 2")); /* the queue's fill */
    assert_non_null(strstr(run.stats, "30 frames in"));
}

static void trouble_is_told_while_it_lasts(void **state) {
    (void)state;
    play("testsrc frames=30 ! testmap ! testtrouble from=10 to=20 ! fakesink");
    assert_int_equal(run.errors, 0);
    assert_null(run.progress.trouble);
    assert_null(strstr(run.stats, "all is lost"));
    play("testsrc frames=30 ! testmap ! testtrouble from=10 to=99 ! fakesink");
    assert_int_equal(run.errors, 0);
    assert_string_equal(run.progress.trouble, "all is lost");
    assert_non_null(strstr(run.stats, "all is lost"));
}

/* The frames of fakesrc are 40 ms apart, 25 in a second. */
static void rate_follows_the_frames_own_time(void **state) {
    (void)state;
    static const struct {
        const char *fps;
        int passed;
    } want[] = {{"25", 100}, {"12.5", 50}, {"10", 40}, {"5", 20}, {"1", 5}, {"1000", 100}};
    /* at 1 in a second the last comes 40 ms too early, which is less than an eighth */
    for (size_t k = 0; k < COUNT(want); k++) {
        char line[1000];
        snprintf(line, sizeof line, "fakesrc frames=100 ! rate fps=%s ! testnote log=LOG",
                 want[k].fps);
        play(with_log(line));
        assert_int_equal(count("frame"), want[k].passed);
        assert_int_equal(run.progress.dropped, 100 - want[k].passed);
        assert_non_null(find("note frame 0 "));
    }
    play(with_log("fakesrc frames=100 ! rate fps=10 ! testnote " LOG));
    for (int i = 1, last = 0; i < 100; i++) /* evenly: every second or third frame */
        if (find("note frame %d ", i)) {
            assert_in_range(i - last, 2, 3);
            last = i;
        }
}

/* A frame that comes 400 ms late never gets past the queue that takes none beyond 200. */
static void late_frames_are_dropped(void **state) {
    (void)state;
    play(
        with_log("testsrc frames=9 late-every=3 late=400 ! queue max-latency=200 ! testnote " LOG));
    for (int i = 2; i < 9; i += 3)
        assert_true(value("note", i) == -1);
    assert_true(run.progress.dropped >= 3 && run.progress.done == 9 - run.progress.dropped);
    assert_non_null(find("note finish 9"));
    play(with_log("testsrc frames=9 late-every=3 late=40 ! queue max-latency=0 ! testnote " LOG));
    assert_int_equal(run.progress.dropped, 0);
}

/* ---- errors ---------------------------------------------------------------------------------- */

static void an_error_ends_the_stream_and_all_finish(void **state) {
    (void)state;
    static const char *const line[] = {
        "testsrc ! testnote label=a log=LOG ! testfail at=5 ! testnote label=b log=LOG",
        "testsrc ! queue ! testnote label=a log=LOG ! queue ! testfail at=5 ! queue max-frames=9 ! "
        "testnote label=b log=LOG"};
    for (size_t k = 0; k < COUNT(line); k++) {
        play(with_log(line[k]));
        assert_int_equal(run.result, ARRIS_E_INPUT);
        assert_int_equal(run.errors, 1);
        assert_string_equal(run.error.stage, "testfail");
        assert_string_equal(run.error.text, "it fails");
        assert_string_equal(run.error.hint, "as it was told");
        assert_int_equal(run.error.frame, 5);
        assert_int_equal(run.error.code, ARRIS_E_INPUT);
        for (int i = 0; i < 20; i++)
            assert_true(value("b", i) == (i < 5 ? made(i) : -1));
        assert_true(value("a", 5) == made(5)); /* those before may have gone further */
        assert_order("a finish", "b finish");
    }
}

static void an_error_in_a_branch_leaves_the_others_whole(void **state) {
    (void)state;
    play(with_log("testsrc ! tee name=t t. ! testfail at=7 ! testnote label=a " LOG
                  " t. ! queue ! testmap ! testnote label=b " LOG));
    int frames = (int)run.progress.frames;
    assert_true(frames >= 8);
    for (int i = 0; i < frames; i++)
        assert_true(value("b", i) == 3 * made(i) + 1);
    assert_non_null(find("a finish"));
    assert_non_null(find("b finish %d", frames));
    assert_int_equal(run.result, ARRIS_E_INPUT);
}

static void an_error_in_finish_lets_the_rest_finish(void **state) {
    (void)state;
    play(
        with_log("testsrc frames=4 ! testfail when=finish name=x ! queue ! testnote label=b " LOG));
    assert_int_equal(run.result, ARRIS_E_INPUT);
    assert_int_equal(run.errors, 1);
    assert_string_equal(run.error.stage, "x");
    assert_int_equal(run.error.frame, -1); /* no frame's fault */
    assert_non_null(find("b finish 4"));
}

static void the_first_error_counts(void **state) {
    (void)state;
    play("testsrc ! testfail at=3 name=x ! testfail at=2 name=y ! testfail at=4 name=z ! fakesink");
    assert_string_equal(run.error.stage, "y");
    assert_int_equal(run.errors, 1);
    play("testsrc frames=9 ! testfail at=3 name=x ! testfail when=finish name=y ! fakesink");
    assert_int_equal(run.errors, 2);
}

static void warnings_end_nothing_and_hide_nothing(void **state) {
    (void)state;
    start("testsrc ! testfail at=5 warnings=500 ! fakesink");
    while (!arris_result(run.p)) /* nobody listens until it is over */
        usleep(1000);
    listen();
    end();
    assert_int_equal(run.errors, 1);
    assert_true(run.warnings > 0);
    assert_int_equal(run.error.frame, 5);
}

/* ---- stop and abort -------------------------------------------------------------------------- */

static void wait_for_frames(uint64_t n) {
    for (int i = 0; arris_get_progress(run.p).frames < n; i++) {
        if (i == 60000)
            fail_msg("the source does not go on");
        usleep(1000);
    }
}

static void *stopper(void *p) {
    arris_stop(p);
    return NULL;
}

static void *aborter(void *p) {
    arris_abort(p);
    return NULL;
}

static void interrupt(void *(*how)(void *)) {
    pthread_t t;
    wait_for_frames(3);
    assert_int_equal(pthread_create(&t, NULL, how, run.p), 0);
    listen();
    pthread_join(t, NULL);
    end();
}

static const char *const endless[] = {
    "testsrc ! identity sleep=0.1 ! testnote log=LOG",
    "testsrc ! queue max-frames=1 ! testhold ms=2 ! testnote log=LOG",
    "testsrc ! tee name=t t. ! queue ! testhold ms=1 ! fakesink t. ! testnote log=LOG",
    "testsrc live=yes ! identity sleep=30000 ! testnote log=LOG",
};

/* What was made when it was asked to stop arrives, and everything finishes. */
static void stop_drains(void **state) {
    (void)state;
    for (size_t k = 0; k < COUNT(endless); k++) {
        start(with_log(endless[k]));
        interrupt(stopper);
        assert_int_equal(run.result, 0);
        assert_non_null(find("note finish %llu", (unsigned long long)run.progress.frames));
        if (k < 3) /* the last one drops */
            assert_int_equal(count("frame"), (int)run.progress.frames);
        else
            assert_true((uint64_t)count("frame") + run.progress.dropped == run.progress.frames);
    }
}

static void abort_finishes_nothing(void **state) {
    (void)state;
    for (size_t k = 0; k < COUNT(endless); k++) {
        start(with_log(endless[k]));
        interrupt(aborter);
        assert_int_equal(run.result, ARRIS_E_ABORTED);
        assert_null(find("note finish"));
        assert_non_null(find("note close"));
    }
}

/* The queue is full and what follows it hangs until the pipeline is aborted. */
static void abort_with_a_blocked_queue(void **state) {
    (void)state;
    start(with_log("testsrc ! queue max-frames=3 ! testhold until=/no/such/file ! testnote " LOG));
    wait_for_frames(5);
    arris_abort(run.p);
    arris_abort(run.p);
    listen();
    end();
    assert_int_equal(run.result, ARRIS_E_ABORTED);
    assert_int_equal(run.progress.frames, 5); /* one held, three waiting, one before the door */
    assert_null(find("note finish"));
}

static void stop_before_the_start(void **state) {
    (void)state;
    assert_true(checks(with_log("testsrc ! testnote " LOG)));
    arris_stop(run.p);
    assert_int_equal(arris_start(run.p, NULL), 0);
    listen();
    end();
    assert_non_null(find("note finish 0"));
    assert_int_equal(run.result, 0);
}

/* ---- live sources ---------------------------------------------------------------------------- */

/* All 50 frames are made while the sink holds its first one; the newest two are there after it. */
static void a_live_source_is_never_blocked(void **state) {
    (void)state;
    static const char *const line[] = {
        "testsrc frames=50 live=yes ! testhold until=DOOR ! testnote log=LOG",
        "testsrc frames=50 live=yes ! tee name=t t. ! queue ! testhold until=DOOR ! testnote "
        "log=LOG t. ! fakesink",
        "testsrc frames=50 live=yes ! queue ! testhold until=DOOR ! testnote log=LOG"};
    for (size_t k = 0; k < COUNT(line); k++) {
        char whole[4096];
        const char *log = with_log(line[k]), *door = strstr(log, "DOOR");
        unlink(scratch("door"));
        snprintf(whole, sizeof whole, "%.*s%s%s", (int)(door - log), log, scratch("door"),
                 door + 4);
        start(whole);
        wait_for_frames(50);
        scratch_write("door", "open");
        listen();
        end();
        assert_int_equal(run.result, 0);
        assert_true(value("note", 48) == made(48) && value("note", 49) == made(49));
        assert_true(run.progress.dropped > 30);
        assert_non_null(find("note finish 50"));
    }
}

/* Behind a leaky queue a branch may hang: the other one gets every frame. */
static void a_leaky_branch_stalls_nobody(void **state) {
    (void)state;
    static const char *const leaky[] = {"oldest", "newest"};
    for (int k = 0; k < 2; k++) {
        char line[4096];
        unlink(scratch("door"));
        snprintf(line, sizeof line,
                 "testsrc frames=80 ! tee name=t t. ! queue leaky=%s ! testhold until=%s ! "
                 "testnote label=a log=LOG t. ! testnote label=b log=LOG",
                 leaky[k], scratch("door"));
        start(with_log(line));
        wait_for_frames(80);
        scratch_write("door", "open");
        listen();
        end();
        for (int i = 0; i < 80; i++)
            assert_true(value("b", i) == made(i));
        assert_true((uint64_t)count("a frame") + run.progress.dropped == 80);
        assert_true(count("a frame") <= 5 && value("a", 40) == -1);
        assert_true(k == 0 ? value("a", 79) == made(79) : value("a", 0) == made(0));
    }
}

/* ---- feedback -------------------------------------------------------------------------------- */

/* Frame i has in user0 what frame i - delay gave downstream, its number from 1. */
static void assert_feedback(const char *line, int delay, int every, int drops) {
    play(with_log(line));
    assert_int_equal(run.result, 0);
    for (int i = 0; i < 300; i++) {
        int from = i - delay;
        bool there = i % every == 0 && from >= 0 && !(drops && from % drops == 0);
        if (!drops || i % drops)
            assert_int_equal(value("note", i), there ? from + 1 : 0);
    }
}

static void a_layer_comes_back(void **state) {
    (void)state;
    assert_feedback("fakesrc frames=300 ! testask ! testgive ! testnote " LOG, 1, 1, 0);
    assert_feedback("fakesrc frames=300 ! testask delay=3 ! testgive ! testnote " LOG, 3, 1, 0);
    assert_feedback("fakesrc frames=300 ! testask ! queue ! testgive ! testnote " LOG, 1, 1, 0);
    assert_feedback("fakesrc frames=300 ! queue ! testask delay=16 ! queue ! identity ! queue ! "
                    "testgive ! queue ! testnote " LOG,
                    16, 1, 0);
}

/* A dropped frame leaves a mark, also when those before it are still further down. */
static void a_drop_in_a_loop_leaves_a_mark(void **state) {
    (void)state;
    assert_feedback("fakesrc frames=300 ! testask ! testdrop every=3 ! testgive ! testnote " LOG, 1,
                    1, 3);
    assert_feedback("fakesrc frames=300 ! testask delay=4 ! queue ! testdrop every=3 ! queue ! "
                    "testhold ms=0.3 ! testgive ! testnote " LOG,
                    4, 1, 3);
}

/* An asker that does not ask every time may be far ahead. */
static void an_asker_may_pass(void **state) {
    (void)state;
    assert_feedback("fakesrc frames=300 ! testask delay=2 every=7 ! queue max-frames=9 ! testdrop "
                    "every=5 ! queue max-frames=9 ! testhold ms=0.2 ! testgive ! testnote " LOG,
                    2, 7, 5);
}

static void a_leaky_loop_is_refused(void **state) {
    (void)state;
    assert_false(checks("fakesrc ! testask ! queue leaky=oldest ! testgive ! fakesink"));
    assert_int_equal(run.err.code, ARRIS_E_RECIPE);
    assert_int_equal(run.err.column, 20);
    end();
    assert_true(checks(
        "fakesrc ! queue leaky=oldest ! testask ! testgive ! queue leaky=newest ! fakesink"));
    end();
    assert_true(checks("fakesrc ! testask ! fakesink")); /* nobody gives it: no loop */
    end();
}

static void a_loop_is_aborted(void **state) {
    (void)state;
    start(with_log(
        "fakesrc ! testask ! queue ! testhold until=/no/such/file ! testgive ! testnote " LOG));
    wait_for_frames(1);
    arris_abort(run.p);
    listen();
    end();
    assert_int_equal(run.result, ARRIS_E_ABORTED);
}

/* ---- determinism ----------------------------------------------------------------------------- */

static void queues_change_nothing(void **state) {
    (void)state;
    static const char *const line[] = {
        "testsrc frames=500 ! testmap ! testdrop every=7 ! testmap ! testnote log=LOG",
        "testsrc frames=500 ! queue ! testmap ! queue ! testdrop every=7 ! queue max-frames=1 ! "
        "testmap ! queue max-frames=50 ! testnote log=LOG",
        "testahead frames=500 ! testmap ! testdrop every=7 ! queue ! testmap ! testnote log=LOG"};
    char *first = NULL;
    for (size_t k = 0; k < 2 * COUNT(line); k++) {
        play(with_log(line[k / 2]));
        if (!first)
            first = strdup(run.log);
        assert_string_equal(run.log, first);
    }
    free(first);
}

int main(void) {
    scratch_mkdir("plugins");
    scratch_link("plugins/parts.so", "tests/plugins/parts.so");
    setenv("ARRIS_PLUGIN_PATH", scratch("plugins"), 1);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_missing_layer_names_its_givers),
        cmocka_unit_test(settling_narrows_what_is_needed),
        cmocka_unit_test(what_is_given_is_reserved),
        cmocka_unit_test(the_graph_is_printed),
        cmocka_unit_test(setup_and_finish_go_downstream),
        cmocka_unit_test(no_frame_at_all),
        cmocka_unit_test(a_failed_setup_closes_what_was_set_up),
        cmocka_unit_test(a_pipeline_starts_once_and_checked),
        cmocka_unit_test(branches_share_layers),
        cmocka_unit_test(a_branch_replaces_its_own_only),
        cmocka_unit_test(tees_nest),
        cmocka_unit_test(a_stage_drops_frames),
        cmocka_unit_test(a_drop_in_a_branch_is_its_own),
        cmocka_unit_test(counters_are_shown),
        cmocka_unit_test(trouble_is_told_while_it_lasts),
        cmocka_unit_test(rate_follows_the_frames_own_time),
        cmocka_unit_test(late_frames_are_dropped),
        cmocka_unit_test(an_error_ends_the_stream_and_all_finish),
        cmocka_unit_test(an_error_in_a_branch_leaves_the_others_whole),
        cmocka_unit_test(an_error_in_finish_lets_the_rest_finish),
        cmocka_unit_test(the_first_error_counts),
        cmocka_unit_test(warnings_end_nothing_and_hide_nothing),
        cmocka_unit_test(stop_drains),
        cmocka_unit_test(abort_finishes_nothing),
        cmocka_unit_test(abort_with_a_blocked_queue),
        cmocka_unit_test(stop_before_the_start),
        cmocka_unit_test(a_live_source_is_never_blocked),
        cmocka_unit_test(a_leaky_branch_stalls_nobody),
        cmocka_unit_test(a_layer_comes_back),
        cmocka_unit_test(a_drop_in_a_loop_leaves_a_mark),
        cmocka_unit_test(an_asker_may_pass),
        cmocka_unit_test(a_leaky_loop_is_refused),
        cmocka_unit_test(a_loop_is_aborted),
        cmocka_unit_test(queues_change_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
