/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_lcm.c: the messages, what becomes of those that come in, and what is sent of the lines.
 */
#include <math.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "arris_geometry.h"
#include "handeye.h"
#include "lcm/book.h"
#include "lcm/pictures.h"
#include "lcm/states.h"
#include "lcmtypes/arris_lines_t.h"
#include "lcmtypes/arris_preview_t.h"
#include "lcmtypes/arris_segments_t.h"
#include "lcmtypes/arris_status_t.h"
#include "lcmtypes/arris_verdict_t.h"
#include "link.h"
#include "process.h"
#include "rigid.h"
#include "scratch.h"
#include "sent.h"
#include "timeline.h"

static const int64_t MS = 1000000; /* ns */

/* ---- the types ------------------------------------------------------------------------------- */

/* bot_core's image_t, whose viewers know it by this. */
static const uint64_t BOT_CORE_IMAGE = 0x14739ffe13d5f5f0;

static void fingerprints_never_change(void **state) {
    (void)state;
    static const struct {
        int64_t (*hash)(void);
        uint64_t published;
    } types[] = {
        {__arris_image_metadata_t_get_hash, 0x9a4b634d0577fb8e},
        {__arris_image_t_get_hash, BOT_CORE_IMAGE},
        {__arris_lines_t_get_hash, 0xcebb4c922cdba536},
        {__arris_preview_t_get_hash, BOT_CORE_IMAGE},
        {__arris_robot_ack_t_get_hash, 0xea01e3bf02e8d3e2},
        {__arris_robot_command_t_get_hash, 0x4fa20adb81615bab},
        {__arris_robot_state_t_get_hash, 0x66ae196721b20452},
        {__arris_segments_t_get_hash, 0x798cb77cf115ae07},
        {__arris_status_counter_t_get_hash, 0x85c306f9e4dfeb20},
        {__arris_status_t_get_hash, 0x47c7f84196ab891b},
        {__arris_verdict_feature_t_get_hash, 0x3ed60d24f712dde0},
        {__arris_verdict_t_get_hash, 0x718f3cd5de6fd648},
    };
    for (size_t i = 0; i < sizeof types / sizeof *types; i++)
        if ((uint64_t)types[i].hash() != types[i].published)
            fail_msg("type %zu is %llx now: a published type never changes, a new one gets _v2", i,
                     (unsigned long long)types[i].hash());
}

/* ---- poses between poses --------------------------------------------------------------------- */

static void quaternions_and_matrices_agree(void **state) {
    (void)state;
    uint64_t r = 1;
    for (int k = 0; k < 1000; k++) {
        double q[4], R[9], back[4], n = 0, sign;
        for (int i = 0; i < 4; i++)
            q[i] = chance(&r) % 2000 / 1000.0 - 1 + 1e-4;
        for (int i = 0; i < 4; i++)
            n += q[i] * q[i];
        for (int i = 0; i < 4; i++)
            q[i] /= sqrt(n);
        rigid_matrix(q, R);
        rigid_quaternion(R, back);
        sign = back[0] * q[0] + back[1] * q[1] + back[2] * q[2] + back[3] * q[3] < 0 ? -1 : 1;
        for (int i = 0; i < 4; i++)
            assert_true(fabs(sign * back[i] - q[i]) < 1e-12);
    }
}

/* A camera on a flange: what it sees of a point is the same by the two motions one after the other
 * as by the pose that rigid_move makes. */
static void a_pose_moves_along(void **state) {
    (void)state;
    const double t[3] = {-1.9, -91.7, -36.7}, X[3] = {120, -80, 900};
    double q[4] = {0.9, 0.2, -0.3, 0.1}, Q[9], d[3], flange[3], camera[3], direct[3];
    arris_pose pose = {.valid = true, .C = {400, 50, -20}, .cov = {0.01}};
    const double n = sqrt(0.9 * 0.9 + 0.2 * 0.2 + 0.3 * 0.3 + 0.1 * 0.1);
    for (int i = 0; i < 4; i++)
        q[i] /= n;
    arris_rotation(0.3, -0.2, 1.1, pose.R);
    rigid_matrix(q, Q);
    for (int i = 0; i < 3; i++)
        d[i] = X[i] - pose.C[i];
    for (int i = 0; i < 3; i++)
        flange[i] = arris_dot(pose.R + 3 * i, d) - t[i];
    for (int i = 0; i < 3; i++) /* Q turns the camera's axes to the flange's: its transpose back */
        camera[i] = Q[i] * flange[0] + Q[3 + i] * flange[1] + Q[6 + i] * flange[2];
    pose.cov[15] = pose.cov[18] = pose.cov[20] = 1e-6; /* rad² */
    rigid_move(&pose, t, q);
    for (int i = 0; i < 3; i++)
        d[i] = X[i] - pose.C[i];
    for (int i = 0; i < 3; i++)
        direct[i] = arris_dot(pose.R + 3 * i, d);
    for (int i = 0; i < 3; i++)
        assert_true(fabs(direct[i] - camera[i]) < 1e-9);
    /* a lever of |t| turned by 1 mrad about two axes across it */
    double across = pose.cov[0] + pose.cov[6] + pose.cov[11] - 0.01;
    assert_true(fabs(across - 2 * arris_dot(t, t) * 1e-6) < 1e-9);
}

static void nothing_is_extrapolated(void **state) {
    (void)state;
    timeline t;
    timed_pose p = {.quat = {1, 0, 0, 0}}, out;
    assert_true(timeline_new(&t, 8));
    assert_int_equal(timeline_at(&t, 5, 1000, &out), TIMELINE_TOO_NEW);
    for (int i = 0; i < 20; i++) { /* 120 to 190 µs stay, and a gap of 100 before the last */
        p.utime = 10 * i + (i == 19 ? 100 : 0);
        p.pos[0] = i;
        timeline_add(&t, &p);
    }
    assert_int_equal(timeline_at(&t, 119, 50, &out), TIMELINE_TOO_OLD);
    assert_int_equal(timeline_at(&t, 291, 50, &out), TIMELINE_TOO_NEW);
    assert_int_equal(timeline_at(&t, 185, 50, &out), TIMELINE_GAP);
    assert_int_equal(timeline_at(&t, 290, 50, &out), TIMELINE_FOUND);
    assert_int_equal(timeline_at(&t, 134, 50, &out), TIMELINE_FOUND);
    assert_true(fabs(out.pos[0] - 13.4) < 1e-12);
    timeline_free(&t);
}

/* Half of a turn by 80 degrees is one by 40. */
static void rotations_go_the_short_way(void **state) {
    (void)state;
    const double a = 20 * M_PI / 180, from[4] = {cos(a), 0, sin(a), 0};
    const double to[4] = {-cos(3 * a), 0, -sin(3 * a), 0}; /* the same rotation as its negative */
    double half[4];
    rigid_slerp(from, to, 0.5, half);
    assert_true(fabs(half[0] - cos(2 * a)) < 1e-12 && fabs(half[2] - sin(2 * a)) < 1e-12);
}

/* ---- the robot's states ---------------------------------------------------------------------- */

static void hear(states *s, int64_t utime, int32_t seq, int64_t session, int64_t now) {
    static message m;
    arris_robot_state_t is = a_state(utime, seq, (double)seq);
    is.session = session;
    put_state(&m, &is);
    states_receive(s, m.data, m.n, now);
}

/* Two hundred states a second from `from` on, until `n` more have come. */
static int64_t hear_many(states *s, int64_t utime, int32_t seq, int n, int64_t now) {
    for (int i = 0; i < n; i++, now += 5 * MS)
        hear(s, utime + 5000 * i, seq + i, 1, now);
    return now;
}

static void assert_trouble(const states *s, int64_t now, const char *what) {
    const char *trouble = states_trouble(s, now);
    if (!what != !trouble || (what && !strstr(trouble, what)))
        fail_msg("the trouble is '%s' and not '%s'", trouble ? trouble : "none",
                 what ? what : "none");
}

static void silence_is_named(void **state) {
    (void)state;
    states s;
    int64_t now = 1000 * MS;
    states_new(&s, now);
    assert_trouble(&s, now + 400 * MS, NULL);
    assert_trouble(&s, now + 600 * MS, "no robot states");
    now = hear_many(&s, 1000000, 0, 100, now);
    assert_trouble(&s, now, NULL);
    assert_trouble(&s, now + 600 * MS, "have stopped");
    now = hear_many(&s, 2500000, 100, 10, now + 1000 * MS);
    assert_trouble(&s, now, NULL);
    timed_pose p;
    assert_int_equal(timeline_at(&s.line, 2000000, 50000, &p), TIMELINE_GAP);
    assert_int_equal(timeline_at(&s.line, 1200000, 50000, &p), TIMELINE_FOUND);
    states_free(&s);
}

static void a_second_robot_is_not_mixed_in(void **state) {
    (void)state;
    states s;
    timed_pose p;
    int64_t now = MS;
    states_new(&s, now);
    for (int i = 0; i < 100; i++, now += 5 * MS) {
        hear(&s, 1000000 + 5000 * i, i, 1, now);
        hear(&s, 1000000 + 5000 * i + 2000, 777, 2, now + MS);
    }
    assert_trouble(&s, now, "two robots");
    assert_int_equal(s.count[STATES_FOREIGN], 100);
    assert_int_equal(timeline_at(&s.line, 1102500, 50000, &p), TIMELINE_FOUND);
    assert_true(fabs(p.pos[0] - 20.5) < 1e-9);
    now = hear_many(&s, 1500000, 100, 500, now);
    assert_trouble(&s, now, NULL);
    /* the first falls silent: the other is followed, since a driver may start again */
    for (int i = 0; i < 500; i++, now += 5 * MS)
        hear(&s, 9000000 + 5000 * i, i, 2, now);
    assert_int_equal(s.session, 2);
    assert_int_equal(timeline_at(&s.line, 9000000 + 5000 * 400, 50000, &p), TIMELINE_FOUND);
    states_free(&s);
}

static void time_that_jumps_is_named(void **state) {
    (void)state;
    states s;
    timed_pose p;
    int64_t now = MS;
    states_new(&s, now);
    now = hear_many(&s, 60000000, 0, 100, now);
    now = hear_many(&s, 50000000, 100, 100, now); /* the clock was set back by 10 s */
    assert_trouble(&s, now, "jumped back");
    assert_int_equal(s.count[STATES_JUMPED], 1);
    assert_int_equal(timeline_at(&s.line, 50250000, 50000, &p), TIMELINE_FOUND);
    assert_int_equal(timeline_at(&s.line, 60250000, 50000, &p), TIMELINE_TOO_NEW);
    now = hear_many(&s, 50500000, 200, 500, now);
    assert_trouble(&s, now, NULL);
    now = hear_many(&s, 90000000, 700, 100, now); /* and ahead */
    assert_trouble(&s, now, "set ahead");
    assert_int_equal(timeline_at(&s.line, 90100000, 50000, &p), TIMELINE_FOUND);
    assert_int_equal(timeline_at(&s.line, 70000000, 50000, &p), TIMELINE_GAP);
    hear(&s, 90400000, 750, 1, now); /* one that was overtaken */
    assert_int_equal(s.count[STATES_LATE], 1);
    assert_int_equal(s.count[STATES_JUMPED], 1);
    states_free(&s);
}

static void nonsense_is_counted(void **state) {
    (void)state;
    states s;
    static message m;
    const struct {
        size_t offset;
        double value;
    } bad[] = {{offsetof(arris_robot_state_t, pos), (double)NAN},
               {offsetof(arris_robot_state_t, pos), 2e6},
               {offsetof(arris_robot_state_t, quat), 0.5},
               {offsetof(arris_robot_state_t, quat), (double)INFINITY},
               {offsetof(arris_robot_state_t, pos_sigma), -1},
               {offsetof(arris_robot_state_t, rot_sigma), (double)NAN}};
    states_new(&s, MS);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        arris_robot_state_t is = a_state(1000000, 0, 0);
        *(double *)(void *)((char *)&is + bad[i].offset) = bad[i].value;
        put_state(&m, &is);
        states_receive(&s, m.data, m.n, MS);
    }
    assert_int_equal(s.count[STATES_MALFORMED], sizeof bad / sizeof *bad);
    assert_int_equal(s.line.n, 0);
    assert_trouble(&s, 2 * MS, "malformed");
    states_free(&s);
}

/* ---- pictures -------------------------------------------------------------------------------- */

static void pictures_are_like_the_first(void **state) {
    (void)state;
    static message m;
    pictures p;
    pictures_begin(&p);
    put_image(&m, 40, 30, 7, 5, 99);
    pictures_receive(&p, m.data, m.n, 123);
    put_image(&m, 41, 30, 8, 6, 99);
    pictures_receive(&p, m.data, m.n, 124);
    put_image(&m, 40, 30, 9, 9, 98);
    pictures_receive(&p, m.data, m.n, 125);
    assert_int_equal(p.other, 1);
    assert_int_equal(p.missing, 3);
    const picture_slot *s = pictures_take(&p);
    assert_int_equal(s->index, 5);
    assert_int_equal(s->utime, 7);
    assert_int_equal(s->arrival, 123);
    assert_int_equal(s->data[40 * 30 - 1], 99);
    assert_int_equal(pictures_take(&p)->index, 9);
    assert_null(pictures_take(&p));
    for (int i = 0; i < PICTURES_ROOM + 2; i++) { /* the oldest give way */
        put_image(&m, 40, 30, i, -1, (uint8_t)i);
        pictures_receive(&p, m.data, m.n, 126);
    }
    assert_int_equal(p.overrun, 2);
    assert_int_equal(pictures_take(&p)->utime, 2);
    pictures_free(&p);
}

/* ---- a million malformed messages ------------------------------------------------------------ */

typedef struct victims {
    states states;
    pictures pictures;
    uint64_t commands, acks; /* refused */
} victims;

/* Hands a message to the reader of its kind, in memory of its own so that a byte too far is seen.
 */
static void receive(victims *v, int kind, const message *m) {
    static double pos[MESSAGE_POSES][3], quat[MESSAGE_POSES][4];
    arris_robot_command_t command;
    arris_robot_ack_t ack;
    uint8_t *exact = malloc(m->n);
    memcpy(exact, m->data, m->n);
    if (kind == 0)
        states_receive(&v->states, exact, m->n, MS);
    else if (kind == 1)
        v->commands += robot_command_read(exact, m->n, pos, quat, &command) != 0;
    else if (kind == 2)
        v->acks += robot_ack_read(exact, m->n, &ack) != 0;
    else
        pictures_receive(&v->pictures, exact, m->n, MS);
    free(exact);
}

static uint64_t refused(const victims *v) {
    return v->states.count[STATES_MALFORMED] + v->pictures.malformed + v->commands + v->acks;
}

static void malformed_messages_do_no_harm(void **state) {
    (void)state;
    static message good[4], m;
    enum { ALL = 1000000 };
    arris_robot_state_t is = a_state(1000000, 0, 0);
    uint64_t r = 7, broken = 0, missed = 0;
    victims v = {.commands = 0};
    states_new(&v.states, MS);
    pictures_begin(&v.pictures);
    put_state(&good[0], &is);
    put_command(&good[1], 1, 1, ARRIS_ROBOT_COMMAND_T_PATH, 10, 5, 1, 2, 3);
    put_ack(&good[2], "because");
    put_image(&good[3], 16, 8, 7, 5, 99);
    receive(&v, 3, &good[3]);
    for (int i = 0; broken < ALL; i++) {
        uint64_t before = refused(&v);
        m.n = good[i % 4].n;
        memcpy(m.data, good[i % 4].data, m.n);
        bool surely = damage(&m, &r);
        receive(&v, i % 4, &m);
        broken += surely;
        missed += surely && refused(&v) == before;
    }
    print_message("%d broken messages, %llu refused with those that had turned bits\n", ALL,
                  (unsigned long long)refused(&v));
    assert_int_equal(missed, 0);
    hear(&v.states, 900000000, 1, 1, 10000 * MS);
    assert_int_equal(timeline_newest(&v.states.line)->utime, 900000000);
    while (pictures_take(&v.pictures))
        ;
    put_image(&m, 16, 8, 77, 5, 99);
    pictures_receive(&v.pictures, m.data, m.n, MS);
    assert_int_equal(pictures_take(&v.pictures)->utime, 77);
    states_free(&v.states);
    pictures_free(&v.pictures);
}

/* ---- what is told of lines ------------------------------------------------------------------- */

static arris_line a_line(int32_t id, enum arris_line_change change) {
    return (arris_line){.id = id, .change = change, .into = -1};
}

static const book_line *entry_of(const book *b, int32_t id) {
    for (uint32_t i = 0; i < b->n; i++)
        if (b->item[i].l.id == id)
            return &b->item[i];
    return NULL;
}

static void update(book *b, const arris_line *line, uint32_t n) {
    arris_line copy[8];
    memcpy(copy, line, n * sizeof *line);
    book_update(b, &(arris_lines){.n = n, .max = 8, .item = copy});
}

static void no_change_is_lost(void **state) {
    (void)state;
    book b;
    book_new(&b, 8);
    update(&b, (arris_line[]){a_line(1, ARRIS_ADDED), a_line(2, ARRIS_ADDED)}, 2);
    update(&b, (arris_line[]){a_line(1, ARRIS_MOVED), a_line(2, ARRIS_SAME)}, 2);
    assert_int_equal(entry_of(&b, 1)->pending, ARRIS_ADDED); /* nobody knows it yet */
    assert_int_equal(book_pending(&b), 2);
    book_told(&b);
    assert_int_equal(book_pending(&b), 0);
    update(&b, (arris_line[]){a_line(1, ARRIS_MOVED), a_line(2, ARRIS_SAME)}, 2);
    update(&b, (arris_line[]){a_line(1, ARRIS_SAME), a_line(2, ARRIS_SAME)}, 2);
    assert_int_equal(entry_of(&b, 1)->pending, ARRIS_MOVED); /* kept until it was sent */
    arris_line merged = a_line(2, ARRIS_MERGED);
    merged.into = 1;
    update(&b, (arris_line[]){a_line(1, ARRIS_SAME), merged, a_line(3, ARRIS_ADDED)}, 3);
    update(&b, (arris_line[]){a_line(1, ARRIS_SAME), a_line(3, ARRIS_SAME)}, 2);
    assert_int_equal(entry_of(&b, 2)->pending, ARRIS_MERGED);
    assert_int_equal(entry_of(&b, 2)->l.into, 1);
    assert_int_equal(book_total(&b), 2);
    book_told(&b);
    assert_null(entry_of(&b, 2));
    /* frames were dropped in which 1 retired and 4 came */
    update(&b, (arris_line[]){a_line(3, ARRIS_SAME), a_line(4, ARRIS_SAME)}, 2);
    assert_int_equal(entry_of(&b, 1)->pending, ARRIS_RETIRED);
    assert_int_equal(entry_of(&b, 4)->pending, ARRIS_ADDED);
    /* one that went before it was ever told of */
    update(&b, (arris_line[]){a_line(3, ARRIS_SAME), a_line(4, ARRIS_RETIRED)}, 2);
    assert_null(entry_of(&b, 4));
    book_free(&b);
}

/* ---- the stages, as users run them ----------------------------------------------------------- */

static char *box(void) {
    static char path[PATH_MAX];
    if (!realpath("samples/box", path))
        fail_msg("samples/box is not there: run from the root of the checkout");
    return path;
}

static void run(const char *line) {
    process p = arris_launch(scratch("lcm"), line);
    if (p.code)
        fail_msg("'%s' ends with %d and says:\n%s", line, p.code, p.err);
    process_free(&p);
}

#define CHAIN "edges ! undistort ! segments ! track ! reconstruct ! "

static void assert_same_file(const char *a, const char *b) {
    char *x = file_text(scratch(a)), *y = file_text(scratch(b));
    assert_true(strlen(x) > 1000);
    assert_string_equal(x, y);
    free(x);
    free(y);
}

static void a_list_gives_poses(void **state) {
    (void)state;
    char line[4 * PATH_MAX];
    scratch_mkdir("lcm");
    snprintf(line, sizeof line,
             "imagesrc location=%s/frames.csv ! " CHAIN "filesink location=a.json", box());
    run(line);
    for (int i = 0; i < 2; i++) {
        snprintf(line, sizeof line,
                 "imagesrc location=%s/frames ! pose location=%s/frames.csv by=%s max-gap=1e6 ! "
                 "fakesink",
                 box(), box(), i ? "time" : "index");
        run(line);
        snprintf(line, sizeof line,
                 "imagesrc location=%s/frames.csv ! pose location=%s/frames.csv by=%s ! " CHAIN
                 "filesink location=b.json",
                 box(), box(), i ? "time" : "index");
        run(line);
        if (i == 0)
            assert_same_file("lcm/a.json", "lcm/b.json");
    }
}

/* A log of pictures replays to the same lines; what is sent while that is done does not matter. */
static void a_log_replays(void **state) {
    (void)state;
    char line[4 * PATH_MAX];
    scratch_mkdir("lcm");
    snprintf(line, sizeof line,
             "imagesrc location=%s/frames.csv ! " CHAIN "tee name=t t. ! filesink "
             "location=a.json t. ! lcmsink images=every segments=every preview=10 "
             "url=file://run.lcmlog?mode=w",
             box());
    run(line);
    snprintf(line, sizeof line,
             "lcmsrc url=file://run.lcmlog camera=%s/camera.json ! pose location=%s/frames.csv ! "
             "queue ! " CHAIN "filesink location=b.json",
             box(), box());
    run(line);
    assert_same_file("lcm/a.json", "lcm/b.json");
}

enum { SENT = 20000 /* by each of two threads */ };

static void *send_to_log(void *link) {
    for (int32_t i = 0; i < SENT; i++)
        if (link_publish(link, "COUNT", &i, sizeof i))
            return NULL;
    return link;
}

typedef struct counted {
    int32_t n;
    int64_t sum;
} counted;

static void on_count(void *user, const void *data, size_t n) {
    counted *c = user;
    int32_t i = -1;
    if (n == sizeof i)
        memcpy(&i, data, n);
    c->n++;
    c->sum += i;
}

static lcm_link *open_log(const char *mode) {
    char url[PATH_MAX + 20];
    fault f;
    snprintf(url, sizeof url, "file://%s%s", scratch("lcm/count.lcmlog"), mode);
    lcm_link *l = link_open(url, &f);
    assert_non_null(l);
    return l;
}

/* What a log holds; `damaged`: whether it says that it is. */
static counted count_log(bool damaged) {
    counted c = {0};
    fault f;
    lcm_link *l = open_log("");
    assert_int_equal(link_subscribe(l, "COUNT", 1, on_count, NULL, &c, &f), 0);
    link_start(l);
    for (int i = 0; i < 6000 && !link_ended(l); i++)
        nanosleep(&(struct timespec){0, 5000000}, NULL);
    assert_true(link_ended(l));
    assert_int_equal(link_trouble(l) != NULL, damaged);
    link_close(l);
    return c;
}

/* Frames are sent by one thread and the status by another. */
static void a_log_keeps_what_threads_send_at_once(void **state) {
    (void)state;
    pthread_t other;
    void *sent;
    scratch_mkdir("lcm");
    lcm_link *l = open_log("?mode=w");
    assert_int_equal(pthread_create(&other, NULL, send_to_log, l), 0);
    assert_non_null(send_to_log(l));
    pthread_join(other, &sent);
    assert_non_null(sent);
    link_close(l);
    counted c = count_log(false);
    assert_int_equal(c.n, 2 * SENT);
    assert_int_equal(c.sum, (int64_t)SENT * (SENT - 1));
}

/* Each place costs the event that it lies in, and the one before it when it is a header. */
static void a_damaged_log_is_read_on(void **state) {
    (void)state;
    enum { EVENT = 28 + sizeof "COUNT" - 1 + sizeof(int32_t) }; /* bytes */
    static const long places[] = {100 * EVENT, 200 * EVENT + 20, 300 * EVENT + 24};
    scratch_mkdir("lcm");
    lcm_link *l = open_log("?mode=w");
    assert_non_null(send_to_log(l));
    link_close(l);
    FILE *log = fopen(scratch("lcm/count.lcmlog"), "r+");
    assert_non_null(log);
    for (size_t i = 0; i < sizeof places / sizeof *places; i++)
        assert_true(fseek(log, places[i], SEEK_SET) == 0 && fputs("\xff\xff", log) >= 0);
    fclose(log);
    counted c = count_log(true);
    print_message("%d of %d\n", c.n, SENT);
    assert_true(c.n < SENT && c.n >= SENT - 6);
}

/* The box's poses as those of a flange on which the camera sits by t, with axes as the flange's. */
static void write_flange_poses(const double t[3]) {
    char name[2 * PATH_MAX];
    double v[6];
    int index;
    long long utime;
    snprintf(name, sizeof name, "%s/frames.csv", box());
    FILE *in = fopen(name, "r"), *out = fopen(scratch("lcm/flange.csv"), "w");
    assert_true(in && out);
    fprintf(out, "index,file,utime,x,y,z,omega,theta,kappa\n");
    assert_int_equal(fscanf(in, "%*[^\n]"), 0);
    while (fscanf(in, " %d,%99[^,],%lld,%lf,%lf,%lf,%lf,%lf,%lf", &index, name, &utime, &v[0],
                  &v[1], &v[2], &v[3], &v[4], &v[5]) == 9) {
        double R[9];
        arris_rotation(v[3], v[4], v[5], R);
        for (int i = 0; i < 3; i++)
            v[i] -= R[i] * t[0] + R[3 + i] * t[1] + R[6 + i] * t[2];
        fprintf(out, "%d,%s/%s,%lld,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g\n", index, box(), name,
                utime, v[0], v[1], v[2], v[3], v[4], v[5]);
    }
    fclose(in);
    fclose(out);
}

/* How far apart the first ends of the lines of two lines.json are at most, mm; they have as many.
 */
static double difference(const char *a, const char *b) {
    char *text[2] = {file_text(scratch(a)), file_text(scratch(b))}, *at[2] = {text[0], text[1]};
    double worst = 0;
    int n = 0;
    for (;; n++) {
        double p[2][3];
        for (int k = 0; k < 2; k++)
            if ((at[k] = strstr(at[k], "\"p\": [")))
                assert_int_equal(sscanf(at[k] += 6, "%lf, %lf, %lf", &p[k][0], &p[k][1], &p[k][2]),
                                 3);
        assert_int_equal(!at[0], !at[1]);
        if (!at[0])
            break;
        for (int i = 0; i < 3; i++)
            worst = fmax(worst, fabs(p[0][i] - p[1][i]));
    }
    assert_true(n > 10);
    free(text[0]);
    free(text[1]);
    return worst;
}

static void a_camera_on_a_flange_measures_the_same(void **state) {
    (void)state;
    static const double t[3] = {-1.9, -91.7, -36.7};
    char line[4 * PATH_MAX];
    scratch_mkdir("lcm");
    write_flange_poses(t);
    scratch_write("lcm/handeye.json",
                  "{\"camera_to_flange\": {\"x\": %g, \"y\": %g, \"z\": %g, \"qw\": 1, \"qx\": 0, "
                  "\"qy\": 0, \"qz\": 0}}",
                  t[0], t[1], t[2]);
    snprintf(line, sizeof line,
             "imagesrc location=%s/frames.csv ! " CHAIN "filesink location=a.json", box());
    run(line);
    snprintf(line, sizeof line,
             "imagesrc location=flange.csv camera=%s/camera.json handeye=handeye.json ! " CHAIN
             "filesink location=b.json",
             box());
    run(line);
    snprintf(
        line, sizeof line,
        "imagesrc location=%s/frames.csv ! pose location=flange.csv handeye=handeye.json ! " CHAIN
        "filesink location=c.json",
        box());
    run(line);
    assert_true(difference("lcm/a.json", "lcm/b.json") < 1e-3);
    assert_same_file("lcm/b.json", "lcm/c.json");
}

static void handeye_files_are_checked(void **state) {
    (void)state;
    static const char good[] = "{\"camera_to_flange\": {\"x\": -1.9, \"y\": -91.7, \"z\": -36.7, "
                               "\"qw\": 1, \"qx\": 0, \"qy\": 0, \"qz\": 0}, \"cov\": []}";
    static const char *const bad[] = {
        "",
        "[]",
        "{}",
        "{\"camera_to_flange\": 1}",
        "{\"camera_to_flange\": {\"x\": \"a\", \"y\": 0, \"z\": 0, \"qw\": 1, \"qx\": 0, \"qy\": "
        "0, "
        "\"qz\": 0}}",
        "{\"camera_to_flange\": {\"x\": 0, \"y\": 0, \"z\": 0, \"qw\": 2, \"qx\": 0, \"qy\": 0, "
        "\"qz\": 0}}"};
    handeye h;
    fault f;
    assert_int_equal(handeye_parse(good, strlen(good), "h.json", &h, &f), 0);
    assert_true(h.t[1] == -91.7 && h.q[0] == 1);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        assert_int_equal(handeye_parse(bad[i], strlen(bad[i]), "h.json", &h, &f), ARRIS_E_INPUT);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(fingerprints_never_change),
        cmocka_unit_test(quaternions_and_matrices_agree),
        cmocka_unit_test(a_pose_moves_along),
        cmocka_unit_test(nothing_is_extrapolated),
        cmocka_unit_test(rotations_go_the_short_way),
        cmocka_unit_test(silence_is_named),
        cmocka_unit_test(a_second_robot_is_not_mixed_in),
        cmocka_unit_test(time_that_jumps_is_named),
        cmocka_unit_test(nonsense_is_counted),
        cmocka_unit_test(pictures_are_like_the_first),
        cmocka_unit_test(malformed_messages_do_no_harm),
        cmocka_unit_test(no_change_is_lost),
        cmocka_unit_test(a_list_gives_poses),
        cmocka_unit_test(a_log_replays),
        cmocka_unit_test(a_log_keeps_what_threads_send_at_once),
        cmocka_unit_test(a_damaged_log_is_read_on),
        cmocka_unit_test(a_camera_on_a_flange_measures_the_same),
        cmocka_unit_test(handeye_files_are_checked),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
