/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_network.c: the programs as they run, on a network of the test's own, where the test is robot
 * and camera: what goes wrong is named in the pipeline's status, nothing that was measured is lost,
 * and it is over when it is over.
 */
#include <math.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <time.h>

#include <cmocka.h>
#include <lcm/lcm.h>

#include "arris_plugin.h"
#include "lcm/outbox.h"
#include "lcmtypes/arris_lines_t.h"
#include "lcmtypes/arris_status_t.h"
#include "link.h"
#include "netns.h"
#include "process.h"
#include "scratch.h"
#include "sent.h"

enum { PATIENCE_MS = 15000 };

static bool there; /* is a network */

static void nap(int ms) {
    nanosleep(&(struct timespec){ms / 1000, ms % 1000 * 1000000}, NULL);
}

/* ---- the test as robot and camera ------------------------------------------------------------ */

/* 200 states a second and 20 pictures, with what is wrong with them. */
typedef struct world {
    lcm_link *link;
    pthread_t thread;
    atomic_bool stop, no_states, no_pictures, second_robot, malformed;
    atomic_llong shift; /* µs, of the clock */
} world;

static void send_state(const world *w, int64_t utime, int32_t seq, int64_t session) {
    static message m;
    arris_robot_state_t s = a_state(utime, seq, 1);
    s.session = session;
    put_state(&m, &s);
    link_publish(w->link, "ROBOT_STATE", m.data, m.n);
}

static void *turn(void *arg) {
    static message picture;
    world *w = arg;
    for (int32_t i = 0; !atomic_load(&w->stop); i++, nap(5)) {
        int64_t utime = link_utime() + atomic_load(&w->shift);
        if (!atomic_load(&w->no_states))
            send_state(w, utime, i, 1);
        if (atomic_load(&w->second_robot))
            send_state(w, utime, i, 2);
        if (atomic_load(&w->malformed)) {
            link_publish(w->link, "ROBOT_STATE", "no state at all", 15);
            link_publish(w->link, "ARRIS_IMAGE", "no picture at all", 17);
        }
        if (i % 10 || atomic_load(&w->no_pictures))
            continue;
        put_image(&picture, 64, 48, utime - 10000, i / 10, (uint8_t)i);
        link_publish(w->link, "ARRIS_IMAGE", picture.data, picture.n);
    }
    return NULL;
}

/* ---- what the pipeline says of itself -------------------------------------------------------- */

typedef struct status {
    pthread_mutex_t mutex;
    int n; /* received */
    int8_t state;
    char trouble[200];
    int64_t frames, dropped, without_pose, malformed;
} status;

static int64_t counter(const arris_status_t *m, const char *name) {
    int64_t sum = 0;
    for (int i = 0; i < m->n; i++)
        sum += strcmp(m->counter[i].name, name) == 0 ? m->counter[i].value : 0;
    return sum;
}

static void on_status(void *user, const void *data, size_t n) {
    status *s = user;
    arris_status_t m;
    if (arris_status_t_decode(data, 0, (int)n, &m) < 0)
        return;
    pthread_mutex_lock(&s->mutex);
    s->n++;
    s->state = m.state;
    snprintf(s->trouble, sizeof s->trouble, "%s", m.trouble);
    s->frames = m.frames;
    s->dropped = m.dropped;
    s->without_pose = counter(&m, "without pose");
    s->malformed = counter(&m, "malformed") + counter(&m, "malformed states");
    pthread_mutex_unlock(&s->mutex);
    arris_status_t_decode_cleanup(&m);
}

static status now_of(status *s) {
    pthread_mutex_lock(&s->mutex);
    status copy = *s;
    pthread_mutex_unlock(&s->mutex);
    return copy;
}

/* Waits until the status tells of this trouble; of none when it is empty. */
static void await_trouble(status *s, const char *what) {
    int before = now_of(s).n;
    for (int ms = 0; ms < PATIENCE_MS; ms += 20, nap(20)) {
        status is = now_of(s);
        if (is.n > before && (*what ? strstr(is.trouble, what) != NULL : !*is.trouble))
            return;
    }
    fail_msg("the status tells of '%s' and not of '%s'", now_of(s).trouble, what);
}

static void await_frames(status *s, int64_t more) {
    int64_t from = now_of(s).frames;
    for (int ms = 0; ms < PATIENCE_MS && now_of(s).frames < from + more; ms += 20)
        nap(20);
    assert_true(now_of(s).frames >= from + more);
}

/* ---- faults ---------------------------------------------------------------------------------- */

typedef struct stand {
    world w;
    status s;
    process p;
} stand;

/* One pipeline bears all faults, one after the other. */
static stand *running(void) {
    static stand t = {.s.mutex = PTHREAD_MUTEX_INITIALIZER};
    fault f;
    if (!there)
        skip();
    if (t.w.link)
        return &t;
    t.w.link = link_open(NULL, &f);
    assert_non_null(t.w.link);
    assert_int_equal(link_subscribe(t.w.link, "ARRIS_STATUS", 64, on_status, NULL, &t.s, &f), 0);
    pthread_create(&t.w.thread, NULL, turn, &t.w);
    t.p = arris_begin(NULL, -1,
                      "launch --stats lcmsrc ! queue leaky=oldest max-frames=64 ! pose max-gap=400 "
                      "wait=400 ! lcmsink status=10");
    await_trouble(&t.s, "");
    await_frames(&t.s, 5);
    return &t;
}

static void silent_states_are_named(void **state) {
    (void)state;
    stand *t = running();
    atomic_store(&t->w.no_states, true);
    await_trouble(&t->s, "pose: the robot's states have stopped");
    int64_t lost = now_of(&t->s).without_pose;
    for (int ms = 0; ms < PATIENCE_MS && now_of(&t->s).without_pose == lost; ms += 20)
        nap(20); /* a frame waits for its pose before it is given up */
    bool given_up = now_of(&t->s).without_pose > lost;
    atomic_store(&t->w.no_states, false);
    assert_true(given_up);
    await_trouble(&t->s, "");
    nap(500);
    lost = now_of(&t->s).without_pose;
    await_frames(&t->s, 20);
    assert_true(now_of(&t->s).without_pose - lost <= 2);
}

static void clock_steps_are_named(void **state) {
    (void)state;
    stand *t = running();
    atomic_store(&t->w.shift, -10000000);
    await_trouble(&t->s, "pose: the robot's states have jumped back");
    await_trouble(&t->s, "");
    atomic_store(&t->w.shift, 3600000000);
    await_trouble(&t->s, "pose: the clock of the robot's states was set ahead");
    await_trouble(&t->s, "");
    nap(500);
    int64_t lost = now_of(&t->s).without_pose;
    await_frames(&t->s, 20);
    assert_true(now_of(&t->s).without_pose - lost <= 2);
}

static void two_robots_are_named(void **state) {
    (void)state;
    stand *t = running();
    atomic_store(&t->w.second_robot, true);
    await_trouble(&t->s, "pose: two robots publish states");
    await_frames(&t->s, 10);
    atomic_store(&t->w.second_robot, false);
    await_trouble(&t->s, "");
}

static void malformed_messages_are_counted(void **state) {
    (void)state;
    stand *t = running();
    atomic_store(&t->w.malformed, true);
    await_trouble(&t->s, "pose: malformed robot states");
    await_frames(&t->s, 20);
    atomic_store(&t->w.malformed, false);
    await_trouble(&t->s, "");
    assert_true(now_of(&t->s).malformed > 100);
}

static void a_silent_camera_is_named(void **state) {
    (void)state;
    stand *t = running();
    atomic_store(&t->w.no_pictures, true);
    await_trouble(&t->s, "lcmsrc: no pictures come in");
    atomic_store(&t->w.no_pictures, false);
    await_trouble(&t->s, "");
    await_frames(&t->s, 5);
}

static void a_network_that_is_gone_is_survived(void **state) {
    (void)state;
    stand *t = running();
    assert_true(netns_set(false));
    nap(2500);
    assert_true(netns_set(true));
    await_trouble(&t->s, "");
    await_frames(&t->s, 20);
}

/* One that has joined and never reads, with its small buffer full, is nobody else's matter. */
static void a_subscriber_that_never_reads_does_no_harm(void **state) {
    (void)state;
    stand *t = running();
    lcm_t *deaf = lcm_create("udpm://239.255.76.67:7667?ttl=0");
    assert_non_null(deaf);
    assert_non_null(lcm_subscribe(deaf, ".*", NULL, NULL));
    int64_t dropped = now_of(&t->s).dropped, lost = now_of(&t->s).without_pose;
    await_frames(&t->s, 40);
    assert_int_equal(now_of(&t->s).dropped, dropped);
    assert_true(now_of(&t->s).without_pose - lost <= 2);
    lcm_destroy(deaf);
}

static void it_ends_well_and_has_said_all(void **state) {
    (void)state;
    static const char *const said[] = {"lcmsink: the LCM network does not take messages",
                                       "pose: the robot's states have stopped",
                                       "lcmsrc: no pictures come in"};
    stand *t = running();
    kill(t->p.pid, SIGINT);
    process_wait(&t->p);
    if (t->p.code)
        fail_msg("it ended with %d:\n%s", t->p.code, t->p.err);
    for (int i = 0; i < 3; i++)
        if (!strstr(t->p.err, said[i]))
            fail_msg("it has not said '%s' but:\n%s", said[i], t->p.err);
    atomic_store(&t->w.stop, true);
    pthread_join(t->w.thread, NULL);
    assert_int_equal(now_of(&t->s).state, ARRIS_STATUS_T_ENDED);
    link_unsubscribe(t->w.link, &t->s);
    link_close(t->w.link);
    process_free(&t->p);
}

/* ---- what was measured is told --------------------------------------------------------------- */

enum { KNOWN = 4000 };
typedef struct listener {
    pthread_mutex_t mutex;
    bool knows[KNOWN];
    int total;
    bool final;
} listener;

static void on_lines(void *user, const void *data, size_t n) {
    listener *l = user;
    arris_lines_t m;
    if (arris_lines_t_decode(data, 0, (int)n, &m) < 0)
        return;
    pthread_mutex_lock(&l->mutex);
    if (m.kind == ARRIS_LINES_T_WHOLE && m.part == 0)
        memset(l->knows, 0, sizeof l->knows);
    for (int i = 0; i < m.n && m.kind != ARRIS_LINES_T_FINAL; i++)
        if (m.id[i] >= 0 && m.id[i] < KNOWN)
            l->knows[m.id[i]] =
                m.change[i] != ARRIS_LINES_T_MERGED && m.change[i] != ARRIS_LINES_T_RETIRED;
    l->total = m.total;
    l->final |= m.kind == ARRIS_LINES_T_FINAL;
    pthread_mutex_unlock(&l->mutex);
    arris_lines_t_decode_cleanup(&m);
}

static int known(listener *l) {
    int n = 0;
    pthread_mutex_lock(&l->mutex);
    for (int i = 0; i < KNOWN; i++)
        n += l->knows[i];
    pthread_mutex_unlock(&l->mutex);
    return n;
}

/* The network goes while lines are measured, and comes back while nothing new is: the changes that
 * could not be sent are sent then. */
static void no_line_is_lost_with_the_network(void **state) {
    (void)state;
    static listener l = {.mutex = PTHREAD_MUTEX_INITIALIZER};
    fault f;
    if (!there)
        skip();
    lcm_link *link = link_open(NULL, &f);
    assert_int_equal(link_subscribe(link, "ARRIS_LINES", 64, on_lines, NULL, &l, &f), 0);
    process p =
        arris_begin(NULL, -1,
                    "launch --stats imagesrc location=samples/box/frames.csv stop=75 fps=15 ! "
                    "edges ! undistort ! segments ! track ! reconstruct ! lcmsink");
    for (int ms = 0; ms < PATIENCE_MS && !known(&l); ms += 10)
        nap(10);
    nap(1000);
    assert_true(netns_set(false));
    nap(1000);
    int before = known(&l);
    assert_true(netns_set(true));
    process_wait(&p);
    nap(200);
    link_unsubscribe(link, &l);
    link_close(link);
    print_message("%d lines known while the network was gone, %d of %d in the end\n", before,
                  known(&l), l.total);
    assert_int_equal(p.code, 0);
    assert_true(l.final);
    assert_true(abs(known(&l) - l.total) <= 3); /* the end of the scan completes and merges some */
    assert_true(l.total > 3);
    process_free(&p);
}

/* ---- another language ------------------------------------------------------------------------ */

static void send_verdict(lcm_link *link) {
    arris_feature feature[2] = {{.id = "top-left", .deviation = 0.25, .line = 3},
                                {.id = "top", .verdict = ARRIS_INDETERMINATE, .reason = "unseen"}};
    feature[0].at[1][2] = 670.5;
    int32_t extra[1] = {7};
    const arris_verdict v = {.n = 2,
                             .max = 2,
                             .n_extra = 1,
                             .verdict = ARRIS_INDETERMINATE,
                             .item = feature,
                             .extra = extra};
    const arris_caps none = {.format = 0};
    fault f;
    outbox *o = outbox_new(link, "ARRIS_", &none, 0, &f);
    assert_non_null(o);
    assert_int_equal(outbox_verdict(o, &(stamp){5, 6}, &v, true), 0);
    outbox_free(o);
}

/* Python's lcm, which knows our types from the same .lcm files by its own lcm-gen. */
static void python_decodes_every_type(void **state) {
    (void)state;
    static const char *const channels[] = {
        "ROBOT_STATE", "ROBOT_TRUTH",   "ROBOT_COMMAND", "ROBOT_ACK",     "ARRIS_SEGMENTS",
        "ARRIS_LINES", "ARRIS_VERDICT", "ARRIS_STATUS",  "ARRIS_PREVIEW", "ARRIS_IMAGE"};
    char python[PATH_MAX], installed[PATH_MAX], daemon[PATH_MAX], types[PATH_MAX];
    const char *b = getenv("B") ? getenv("B") : "build";
    fault f;
    int in[2];
    if (!there)
        skip();
    snprintf(python, sizeof python, "%s/venv/bin/python3", b);
    snprintf(installed, sizeof installed, "%s/venv/lcm", b);
    snprintf(daemon, sizeof daemon, "%s/arris-robot", b);
    snprintf(types, sizeof types, "%s/python", b);
    if (access(installed, F_OK) != 0) {
        print_message("skipped: %s is not there: Python's lcm is not installed\n", installed);
        skip();
    }
    setenv("PYTHONPATH", types, 1);
    assert_int_equal(pipe2(in, O_CLOEXEC), 0);
    process robot = process_start(NULL, -1, (char *[]){daemon, "--driver", "sim", NULL});
    /* process_start gives no input: the subscriber ends when this pipe does */
    int out = memfd_create("out", 0);
    pid_t pid = fork();
    if (pid == 0) {
        dup2(in[0], 0);
        dup2(out, 1);
        execl(python, python, "tests/lcm_types.py", (char *)NULL);
        _exit(127);
    }
    close(in[0]);
    for (int ms = 0; ms < PATIENCE_MS && lseek(out, 0, SEEK_END) < 6; ms += 20)
        nap(20);
    process home = process_start(NULL, -1, (char *[]){daemon, "home", NULL});
    process p = arris_run("launch imagesrc location=samples/box/frames.csv fps=60 ! edges ! "
                          "undistort ! segments ! track ! reconstruct ! lcmsink segments=every "
                          "images=every preview=10 status=10");
    process_wait(&home);
    assert_int_equal(p.code, 0);
    assert_int_equal(home.code, 0);
    lcm_link *link = link_open(NULL, &f);
    send_verdict(link);
    link_close(link);
    nap(300);
    close(in[1]);
    waitpid(pid, NULL, 0);
    kill(robot.pid, SIGTERM);
    process_wait(&robot);
    char *text = fd_text(out);
    print_message("%s", text);
    assert_null(strstr(text, "differs"));
    for (size_t i = 0; i < sizeof channels / sizeof *channels; i++) {
        const char *at = strstr(text, channels[i]);
        if (!at || atoi(at + strlen(channels[i])) < 1)
            fail_msg("Python has decoded no %s", channels[i]);
    }
    assert_non_null(strstr(text, "('top-left', 0.25, 670.5, '')"));
    assert_non_null(strstr(text, "'unseen'), 7]"));
    assert_non_null(strstr(text, "(320, 240, 76800, 'seq')"));
    free(text);
    process_free(&p);
    process_free(&home);
    process_free(&robot);
}

/* ---- all together ---------------------------------------------------------------------------- */

/* The sample, short and slow: how fast it is is not asked here. lcm-logger loses what comes while
 * it does not run for 30 messages: half a second. */
static void a_cell_measures_live_as_offline(void **state) {
    (void)state;
    if (!there)
        skip();
    setenv("CELL_FPS", "5", 1);
    setenv("CELL_RATE", "50", 1);
    process p = process_start(NULL, -1, (char *[]){"samples/cell/run.sh", "5", NULL});
    process_wait(&p);
    print_message("%s", p.out);
    if (!strstr(p.out, "0 dropped") || !strstr(p.out, " 0 without pose") ||
        !strstr(p.out, "the same lines, to the last digit"))
        fail_msg("the cell went wrong:\n%s\n%s", p.out, p.err);
    process_free(&p);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(silent_states_are_named),
        cmocka_unit_test(clock_steps_are_named),
        cmocka_unit_test(two_robots_are_named),
        cmocka_unit_test(malformed_messages_are_counted),
        cmocka_unit_test(a_silent_camera_is_named),
        cmocka_unit_test(a_subscriber_that_never_reads_does_no_harm),
        cmocka_unit_test(a_network_that_is_gone_is_survived),
        cmocka_unit_test(it_ends_well_and_has_said_all),
        cmocka_unit_test(no_line_is_lost_with_the_network),
        cmocka_unit_test(python_decodes_every_type),
        cmocka_unit_test(a_cell_measures_live_as_offline),
    };
    there = netns_enter();
    setenv("LCM_DEFAULT_URL", LINK_URL, 1);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
