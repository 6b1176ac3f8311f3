/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_robot.c: the robot's daemon with the simulated robot, in simulated time; its commands come
 * over LCM as from another program.
 */
#include <math.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <time.h>

#include <cmocka.h>

#include "arris_geometry.h"
#include "robot/motion.h"
#include "robot/robot.h"
#include "sent.h"
#include "timeline.h"

static const int64_t PERIOD = 5000000;   /* ns */
static const int64_t BEGIN = 1000000000; /* ns, of simulated time */

/* ---- motion ---------------------------------------------------------------------------------- */

/* The greatest speed and acceleration of a profile, by differences of 0.1 ms. */
static void measure(const profile *p, double *speed, double *acceleration) {
    double s[3] = {0, 0, 0};
    *speed = *acceleration = 0;
    for (int64_t k = 0, t = p->begin; t <= profile_end(p); k++, t += 100000) {
        s[k % 3] = profile_at(p, t);
        double v = (s[k % 3] - s[(k + 2) % 3]) * 1e4,
               before = (s[(k + 2) % 3] - s[(k + 1) % 3]) * 1e4;
        if (k > 0)
            *speed = fmax(*speed, v);
        if (k > 1)
            *acceleration = fmax(*acceleration, fabs(v - before) * 1e4);
    }
}

static void speed_is_a_trapezoid(void **state) {
    (void)state;
    static const double way[] = {100, 6, 4, 0.001}; /* below 5 mm it is a triangle */
    double v, a;
    for (int i = 0; i < 4; i++) {
        profile p = profile_plan(10, 10 + way[i], 50, 500, BEGIN);
        measure(&p, &v, &a);
        assert_true(v < 50.001 && a < 501);
        assert_true(fabs(profile_at(&p, BEGIN) - 10) < 1e-9);
        assert_true(fabs(profile_at(&p, profile_end(&p)) - 10 - way[i]) < 1e-9);
    }
    profile p = profile_plan(0, 100, 50, 500, BEGIN);
    assert_true(fabs(p.t_end - 2.1) < 1e-9);
    profile b = profile_brake(&p, 500, BEGIN + 1000000000);
    assert_true(fabs(profile_at(&b, profile_end(&b)) - profile_at(&p, BEGIN + 1000000000) - 2.5) <
                1e-9);
}

static void a_path_stops_at_its_corners(void **state) {
    (void)state;
    static path p;
    static const double x[] = {0, 10, 20, 20, 30}, y[] = {0, 0, 0.5, 10, 20};
    robot_pose at = {.quat = {1, 0, 0, 0}};
    path_begin(&p, &at);
    for (int i = 1; i < 5; i++) {
        at.pos[0] = x[i];
        at.pos[1] = y[i];
        path_add(&p, &at);
    }
    assert_int_equal(path_run_end(&p, 0), 2); /* 2.9 degrees are no corner */
    assert_int_equal(path_run_end(&p, 2), 3);
    assert_int_equal(path_run_end(&p, 3), 4);
}

/* ---- the simulated robot --------------------------------------------------------------------- */

static robot_options plain(void) {
    return (robot_options){.home.quat = {1, 0, 0, 0}, .acceleration = 500, .seed = 1};
}

/* A robot that has just been sent along a corner at 50 mm/s, turning by 0.3 rad. */
static void *on_its_way(const robot_options *o) {
    fault f;
    robot_reading r;
    void *sim = driver_sim.open(o, 0, &f);
    const robot_pose corner[2] = {{{150, 20, 10}, {cos(0.15), 0, sin(0.15), 0}},
                                  {{150, 80, 10}, {1, 0, 0, 0}}};
    assert_non_null(sim);
    driver_sim.home(sim, 100, 0);
    driver_sim.read(sim, BEGIN, &r);
    assert_true(r.homed && !r.moving);
    driver_sim.follow(sim, corner, 2, 50, BEGIN);
    return sim;
}

static double distance(const double a[3], const double b[3]) {
    double d[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
    return sqrt(arris_dot(d, d));
}

/* States at 200 Hz, interpolated as `pose` does, against where the robot was in between. */
static void interpolation_keeps_to_the_truth(void **state) {
    (void)state;
    robot_options o = plain();
    void *sampled = on_its_way(&o), *asked = on_its_way(&o);
    timeline line;
    robot_reading r;
    double worst = 0, worst_angle = 0;
    uint64_t seed = 3;
    assert_true(timeline_new(&line, 4096));
    for (int64_t t = BEGIN; t < BEGIN + 5000000000; t += PERIOD) {
        driver_sim.read(sampled, t, &r);
        timed_pose p = {.utime = t / 1000};
        memcpy(p.pos, r.reported.pos, sizeof p.pos);
        memcpy(p.quat, r.reported.quat, sizeof p.quat);
        timeline_add(&line, &p);
    }
    for (int64_t t = BEGIN; t < BEGIN + 4900000000; t += 1000 * (1 + chance(&seed) % 4000)) {
        timed_pose p;
        double dot = 0;
        driver_sim.read(asked, t, &r);
        assert_int_equal(timeline_at(&line, t / 1000, 50000, &p), TIMELINE_FOUND);
        worst = fmax(worst, distance(p.pos, r.truth.pos));
        for (int i = 0; i < 4; i++)
            dot += p.quat[i] * r.truth.quat[i];
        worst_angle = fmax(worst_angle, 2 * acos(fmin(fabs(dot), 1)));
    }
    print_message("at 50 mm/s and 200 Hz: %.2f um and %.1f urad off at most\n", worst * 1e3,
                  worst_angle * 1e6);
    assert_true(worst < 5e-3);
    assert_true(worst_angle < 5e-5);
    timeline_free(&line);
    driver_sim.close(sampled);
    driver_sim.close(asked);
}

/* The sum of squares of what the truth is off, and its greatest leap within a ms. */
static double errors(const robot_options *o, const double offset[3], double *leap) {
    void *sim = on_its_way(o);
    robot_reading r;
    double squares = 0, before[3] = {0};
    int n = 0;
    *leap = 0;
    for (int64_t t = BEGIN; t < BEGIN + 5000000000; t += 1000000, n++) {
        double e[3];
        driver_sim.read(sim, t, &r);
        for (int i = 0; i < 3; i++)
            e[i] = r.truth.pos[i] - r.reported.pos[i] - offset[i];
        squares += arris_dot(e, e);
        if (n > 0)
            *leap = fmax(*leap, distance(e, before));
        memcpy(before, e, sizeof e);
    }
    driver_sim.close(sim);
    return squares / n;
}

static void the_truth_is_off_as_asked(void **state) {
    (void)state;
    static const double none[3] = {0, 0, 0};
    double leap;
    robot_options o = plain();
    assert_true(errors(&o, none, &leap) == 0);
    memcpy(o.offset, (double[]){0.3, -0.2, 0.1}, sizeof o.offset);
    assert_true(errors(&o, o.offset, &leap) < 1e-20);
    o.jitter = 0.1;
    double squares = 0; /* over many robots, all three axes */
    for (o.seed = 1; o.seed <= 40; o.seed++)
        squares += errors(&o, o.offset, &leap) / 40;
    print_message("jitter of 0.1 mm an axis: %.3f mm rms in all, %.3f mm in 1 ms at most\n",
                  sqrt(squares), leap);
    assert_true(sqrt(squares) > 0.14 && sqrt(squares) < 0.21); /* sqrt(3) times 0.1 */
    assert_true(leap < 0.3);
    o.jitter = 0;
    o.repeatability = 0.04;
    squares = 0;
    for (o.seed = 1; o.seed <= 40; o.seed++)
        squares += errors(&o, o.offset, &leap) / 40;
    assert_true(sqrt(squares) > 0.02 && sqrt(squares) < 0.1);
    assert_true(leap < 0.01);
}

/* ---- a daemon and who commands it ------------------------------------------------------------ */

typedef struct cell {
    lcm_link *link;
    robot *robot;
    int64_t now;           /* ns, of simulated time */
    pthread_mutex_t mutex; /* of what follows, by the LCM thread; read when that has caught up */
    int synced;
    int acks;
    int32_t request;
    int8_t result;
    char reason[200];
    double x;
    bool moving;
} cell;

static void on_ack(void *user, const void *data, size_t n) {
    cell *c = user;
    arris_robot_ack_t m;
    assert_true(arris_robot_ack_t_decode(data, 0, (int)n, &m) > 0);
    pthread_mutex_lock(&c->mutex);
    c->acks++;
    c->request = m.request;
    c->result = m.result;
    snprintf(c->reason, sizeof c->reason, "%s", m.reason);
    pthread_mutex_unlock(&c->mutex);
    arris_robot_ack_t_decode_cleanup(&m);
}

static void on_state(void *user, const void *data, size_t n) {
    cell *c = user;
    arris_robot_state_t m;
    assert_true(arris_robot_state_t_decode(data, 0, (int)n, &m) > 0);
    pthread_mutex_lock(&c->mutex);
    c->x = m.pos[0];
    c->moving = m.moving;
    pthread_mutex_unlock(&c->mutex);
    arris_robot_state_t_decode_cleanup(&m);
}

static void on_sync(void *user, const void *data, size_t n) {
    cell *c = user;
    (void)data, (void)n;
    pthread_mutex_lock(&c->mutex);
    c->synced++;
    pthread_mutex_unlock(&c->mutex);
}

static int synced(cell *c) {
    pthread_mutex_lock(&c->mutex);
    int n = c->synced;
    pthread_mutex_unlock(&c->mutex);
    return n;
}

/* All that was sent before has come. */
static void sync_up(cell *c) {
    int before = synced(c);
    link_publish(c->link, "SYNC", "", 1);
    while (synced(c) == before)
        nanosleep(&(struct timespec){0, 10000}, NULL);
}

/* What was read of the cell until now is read before the handlers write to it again: the thread
 * sanitizer does not know the locks within liblcm. */
static void hand_over(cell *c) {
    (void)synced(c);
}

static void step(cell *c, double seconds) {
    int64_t end = c->now + (int64_t)(seconds * 1e9);
    for (; c->now < end; c->now += PERIOD) {
        hand_over(c);
        robot_step(c->robot, c->now, c->now / 1000);
        sync_up(c);
    }
}

static void give(cell *c, int64_t commander, int32_t request, int8_t command, double speed, int n,
                 double x) {
    static message m;
    put_command(&m, commander, request, command, speed, n, x, 0, 0);
    hand_over(c);
    link_publish(c->link, "ROBOT_COMMAND", m.data, m.n);
    sync_up(c);
    step(c, 0.005);
}

/* Seconds of motion during which the commander says that it is there. */
static void go_on(cell *c, int64_t commander, double seconds) {
    for (; seconds > 0; seconds -= 0.1) {
        give(c, commander, 0, ARRIS_ROBOT_COMMAND_T_ALIVE, 0, 0, 0);
        step(c, 0.1);
    }
}

static void assert_ack(const cell *c, int32_t request, int8_t result, const char *reason) {
    if (c->request != request || c->result != result || !strstr(c->reason, reason))
        fail_msg("request %d came to %d '%s', not request %d to %d '%s'", c->request, c->result,
                 c->reason, request, result, reason);
}

static cell begin(void) {
    static const robot_limits limits = {.space = {{-100, 300}, {-100, 100}, {-100, 100}},
                                        .speed = 100,
                                        .max_speed = 200,
                                        .link_timeout = 0.5};
    cell c = {.now = BEGIN, .mutex = PTHREAD_MUTEX_INITIALIZER};
    fault f;
    c.link = link_open("memq://", &f);
    assert_non_null(c.link);
    robot_options o = plain();
    c.robot = robot_new(&driver_sim, &o, &limits, c.link, c.now, &f);
    assert_non_null(c.robot);
    return c;
}

static void listen(cell *c) {
    fault f;
    assert_int_equal(link_subscribe(c->link, "ROBOT_ACK", 64, on_ack, NULL, c, &f), 0);
    assert_int_equal(link_subscribe(c->link, "ROBOT_STATE", 64, on_state, NULL, c, &f), 0);
    assert_int_equal(link_subscribe(c->link, "SYNC", 64, on_sync, NULL, c, &f), 0);
}

static void end(cell *c) {
    robot_free(c->robot);
    link_unsubscribe(c->link, c);
    link_close(c->link);
}

#define CMD(name) ARRIS_ROBOT_COMMAND_T_##name
#define ACK(name) ARRIS_ROBOT_ACK_T_##name

static void home(cell *c) {
    listen(c);
    give(c, 1, 1, CMD(HOME), 0, 0, 0);
    assert_ack(c, 1, ACK(ACCEPTED), "");
    go_on(c, 1, 1);
    assert_ack(c, 1, ACK(DONE), "");
}

static void what_is_wrong_is_refused(void **state) {
    (void)state;
    cell c = begin();
    listen(&c);
    give(&c, 1, 1, CMD(MOVE), 50, 1, 10);
    assert_ack(&c, 1, ACK(REFUSED), "not homed");
    give(&c, 1, 2, CMD(HOME), 0, 0, 0);
    assert_ack(&c, 2, ACK(ACCEPTED), "");
    give(&c, 1, 3, CMD(MOVE), 50, 1, 10);
    assert_ack(&c, 3, ACK(REFUSED), "under way");
    go_on(&c, 1, 1);
    assert_ack(&c, 2, ACK(DONE), "");
    give(&c, 1, 4, CMD(MOVE), 50, 1, 301);
    assert_ack(&c, 4, ACK(REFUSED), "pose 1 lies outside the work space: x is 301 mm");
    give(&c, 1, 5, CMD(MOVE), 500, 1, 10);
    assert_ack(&c, 5, ACK(REFUSED), "faster");
    give(&c, 1, 6, CMD(MOVE), 50, 2, 10);
    assert_ack(&c, 6, ACK(REFUSED), "poses");
    give(&c, 1, 7, CMD(PATH), 50, 0, 10);
    assert_ack(&c, 7, ACK(REFUSED), "poses");
    link_publish(c.link, "ROBOT_COMMAND", "nonsense", 8);
    sync_up(&c);
    assert_int_equal(robot_malformed(c.robot), 1);
    assert_true(fabs(c.x) < 1e-9 && !c.moving);
    end(&c);
}

static void one_commander_is_obeyed(void **state) {
    (void)state;
    cell c = begin();
    home(&c);
    give(&c, 2, 1, CMD(MOVE), 50, 1, 10);
    assert_ack(&c, 1, ACK(REFUSED), "another commander");
    give(&c, 1, 2, CMD(RELEASE), 0, 0, 0);
    give(&c, 2, 2, CMD(MOVE), 50, 1, 100);
    assert_ack(&c, 2, ACK(ACCEPTED), "");
    give(&c, 1, 3, CMD(MOVE), 50, 1, 0);
    assert_ack(&c, 3, ACK(REFUSED), "another commander");
    give(&c, 1, 4, CMD(STOP), 0, 0, 0); /* that anybody may */
    go_on(&c, 2, 0.5);
    assert_ack(&c, 2, ACK(STOPPED), "STOP");
    assert_true(!c.moving && c.x < 90);
    step(&c, 0.6); /* silent at rest: another may command */
    give(&c, 1, 5, CMD(MOVE), 50, 1, 0);
    assert_ack(&c, 5, ACK(ACCEPTED), "");
    end(&c);
}

static void a_lost_link_stops_the_robot(void **state) {
    (void)state;
    cell c = begin();
    home(&c);
    give(&c, 1, 2, CMD(MOVE), 50, 1, 200);
    go_on(&c, 1, 1);
    assert_true(c.moving && c.x > 40);
    step(&c, 0.45);
    assert_true(c.moving);
    step(&c, 0.3);
    assert_ack(&c, 2, ACK(STOPPED), "not heard");
    assert_true(!c.moving && c.x < 90);
    end(&c);
}

static void holding_and_going_on(void **state) {
    (void)state;
    cell c = begin();
    home(&c);
    give(&c, 1, 2, CMD(MOVE), 50, 1, 100);
    go_on(&c, 1, 0.5);
    give(&c, 7, 1, CMD(HOLD), 0, 0, 0);
    go_on(&c, 1, 1);
    double held = c.x;
    assert_true(!c.moving && held > 20 && held < 40);
    give(&c, 8, 1, CMD(RESUME), 0, 0, 0);
    assert_ack(&c, 1, ACK(REFUSED), "another commander");
    go_on(&c, 1, 1);
    assert_true(c.x == held);
    give(&c, 7, 2, CMD(RESUME), 0, 0, 0);
    go_on(&c, 1, 2.5);
    assert_ack(&c, 2, ACK(DONE), "");
    assert_true(fabs(c.x - 100) < 1e-9);
    give(&c, 1, 3, CMD(MOVE), 50, 1, 0);
    go_on(&c, 1, 0.3);
    give(&c, 1, 4, CMD(HOLD), 0, 0, 0);
    step(&c, 1); /* its commander is lost while it is held: it will not go on */
    assert_ack(&c, 3, ACK(STOPPED), "not heard");
    end(&c);
}

static void what_takes_too_long_is_stopped(void **state) {
    (void)state;
    static message m;
    cell c = begin();
    home(&c);
    double *row = (double[]){200, 0, 0}, *quat = (double[]){1, 0, 0, 0};
    arris_robot_command_t slow = {.utime = 1,
                                  .commander = 1,
                                  .request = 2,
                                  .command = CMD(MOVE),
                                  .speed = 10,
                                  .time_limit = 1,
                                  .n = 1,
                                  .pos = &row,
                                  .quat = &quat};
    encoded(&m, arris_robot_command_t_encode(m.data, 0, MESSAGE_ROOM, &slow));
    link_publish(c.link, "ROBOT_COMMAND", m.data, m.n);
    go_on(&c, 1, 1.3);
    assert_ack(&c, 2, ACK(TIMED_OUT), "time limit");
    assert_true(!c.moving && c.x < 12);
    end(&c);
}

/* UDP loses messages, so a command comes again until it is answered. */
static void a_command_is_done_once(void **state) {
    (void)state;
    cell c = begin();
    home(&c);
    give(&c, 1, 2, CMD(MOVE), 200, 1, 50);
    for (int i = 0; i < 10; i++) {
        give(&c, 1, 2, CMD(MOVE), 200, 1, 50);
        assert_ack(&c, 2, ACK(ACCEPTED), "");
    }
    go_on(&c, 1, 1);
    assert_ack(&c, 2, ACK(DONE), "");
    give(&c, 1, 3, CMD(MOVE), 200, 1, 0);
    go_on(&c, 1, 1);
    int before = c.acks;
    give(&c, 1, 2, CMD(MOVE), 200, 1, 50); /* late, from somewhere */
    step(&c, 0.3);
    assert_int_equal(c.acks, before + 1);
    assert_ack(&c, 2, ACK(DONE), "");
    assert_true(fabs(c.x) < 1e-9);
    end(&c);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(speed_is_a_trapezoid),
        cmocka_unit_test(a_path_stops_at_its_corners),
        cmocka_unit_test(interpolation_keeps_to_the_truth),
        cmocka_unit_test(the_truth_is_off_as_asked),
        cmocka_unit_test(what_is_wrong_is_refused),
        cmocka_unit_test(one_commander_is_obeyed),
        cmocka_unit_test(a_lost_link_stops_the_robot),
        cmocka_unit_test(holding_and_going_on),
        cmocka_unit_test(what_takes_too_long_is_stopped),
        cmocka_unit_test(a_command_is_done_once),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
