/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * robot.c: the daemon between LCM and a robot's controller (robot.h).
 */
#include "robot.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>

#include "messages.h"

enum { INBOX = 16, ANSWERS = 32, STATE_MAX = 1000, QUEUE = 64 };

typedef struct command {
    arris_robot_command_t m;
    double pos[MESSAGE_POSES][3], quat[MESSAGE_POSES][4];
} command;

/* What was last said to a command. */
typedef struct answer {
    int64_t commander; /* 0: the place is free */
    int32_t request;
    int8_t result;
    char reason[ROBOT_TEXT];
} answer;

struct robot {
    const robot_driver *driver;
    void *self;
    robot_limits limits;
    lcm_link *link;
    int64_t session;
    int32_t state_seq, ack_seq;
    robot_reading reading;

    int64_t commander, heard; /* 0: nobody; ns */
    int64_t holder;           /* who held it last */
    int32_t request;          /* under way; 0: none */
    int64_t deadline;         /* ns, of the request */
    int8_t outcome;           /* of the request, once the robot stands */
    char reason[ROBOT_TEXT];
    answer answers[ANSWERS];
    unsigned next_answer;
    robot_pose poses[ROBOT_POSES];

    pthread_mutex_t mutex; /* of the inbox, which LCM's thread fills */
    command inbox[INBOX], taken;
    unsigned n, first;
    atomic_ullong malformed;
};

/* ---- what comes in --------------------------------------------------------------------------- */

void robot_receive(robot *r, const void *data, size_t n) {
    pthread_mutex_lock(&r->mutex);
    command *c = &r->inbox[(r->first + r->n) % INBOX];
    if (r->n == INBOX) /* it comes again: its sender is not answered */
        ;
    else if (robot_command_read(data, n, c->pos, c->quat, &c->m))
        atomic_fetch_add(&r->malformed, 1);
    else
        r->n++;
    pthread_mutex_unlock(&r->mutex);
}

static void receive(void *user, const void *data, size_t n) {
    robot_receive(user, data, n);
}

static bool take(robot *r) {
    pthread_mutex_lock(&r->mutex);
    bool any = r->n > 0;
    if (any) {
        r->taken = r->inbox[r->first];
        r->first = (r->first + 1) % INBOX;
        r->n--;
    }
    pthread_mutex_unlock(&r->mutex);
    return any;
}

/* ---- answers --------------------------------------------------------------------------------- */

static void send_answer(robot *r, const answer *a, int64_t utime) {
    uint8_t buffer[STATE_MAX];
    arris_robot_ack_t m = {.utime = utime,
                           .seq = r->ack_seq++,
                           .session = r->session,
                           .commander = a->commander,
                           .request = a->request,
                           .result = a->result,
                           .reason = (char *)(uintptr_t)a->reason};
    int n = arris_robot_ack_t_encode(buffer, 0, sizeof buffer, &m);
    if (n > 0)
        link_publish(r->link, "ROBOT_ACK", buffer, (size_t)n);
}

static answer *find_answer(robot *r, int64_t commander, int32_t request) {
    for (int i = 0; i < ANSWERS; i++)
        if (r->answers[i].commander == commander && r->answers[i].request == request)
            return &r->answers[i];
    return NULL;
}

static void reply(robot *r, int64_t commander, int32_t request, int8_t result, const char *reason,
                  int64_t utime) {
    answer *a = find_answer(r, commander, request);
    if (!a)
        a = &r->answers[r->next_answer++ % ANSWERS];
    *a = (answer){.commander = commander, .request = request, .result = result};
    snprintf(a->reason, sizeof a->reason, "%s", reason);
    send_answer(r, a, utime);
}

/* ---- commands -------------------------------------------------------------------------------- */

/* Has the robot stop, and the request under way end with `outcome`. */
static void halt(robot *r, int8_t outcome, const char *reason, int64_t now) {
    if (!r->request || r->outcome != ARRIS_ROBOT_ACK_T_DONE)
        return;
    r->outcome = outcome;
    snprintf(r->reason, sizeof r->reason, "%s", reason);
    r->driver->stop(r->self, now);
}

/* Why a motion is refused; false when it is not. */
static bool refuses_pose(const robot *r, const command *c, char why[ROBOT_TEXT]) {
    for (int32_t i = 0; i < c->m.n; i++)
        for (int k = 0; k < 3; k++) {
            const double *space = r->limits.space[k];
            if (c->pos[i][k] >= space[0] && c->pos[i][k] <= space[1])
                continue;
            snprintf(why, ROBOT_TEXT,
                     "pose %d lies outside the work space: %c is %g mm, allowed is %g to %g", i + 1,
                     "xyz"[k], c -> pos[i][k], space[0], space[1]);
            return true;
        }
    return false;
}

static bool refuses_motion(const robot *r, const command *c, char why[ROBOT_TEXT]) {
    const int8_t what = c->m.command;
    const char *text = NULL;
    bool counts = what == ARRIS_ROBOT_COMMAND_T_HOME   ? c->m.n == 0
                  : what == ARRIS_ROBOT_COMMAND_T_MOVE ? c->m.n == 1
                                                       : c->m.n >= 1;
    *why = '\0';
    if (r->request)
        text = "another command is under way";
    else if (r->reading.error)
        text = *r->reading.message ? r->reading.message : "the robot reports an error";
    else if (what != ARRIS_ROBOT_COMMAND_T_HOME && !r->reading.homed)
        text = "the robot is not homed: send HOME first";
    else if (!counts)
        text = "this command does not take so many poses";
    else if (c->m.speed > r->limits.max_speed)
        text = "this is faster than is allowed";
    if (text)
        snprintf(why, ROBOT_TEXT, "%s", text);
    return text || refuses_pose(r, c, why);
}

static int start(robot *r, const command *c, int64_t now) {
    double speed = c->m.speed > 0 ? c->m.speed : r->limits.speed;
    for (int32_t i = 0; i < c->m.n; i++) {
        memcpy(r->poses[i].pos, c->pos[i], sizeof c->pos[i]);
        memcpy(r->poses[i].quat, c->quat[i], sizeof c->quat[i]);
    }
    return c->m.command == ARRIS_ROBOT_COMMAND_T_HOME
               ? r->driver->home(r->self, speed, now)
               : r->driver->follow(r->self, r->poses, c->m.n, speed, now);
}

static void command_motion(robot *r, const command *c, int64_t now, int64_t utime) {
    char why[ROBOT_TEXT];
    bool refused = refuses_motion(r, c, why);
    if (!refused && start(r, c, now)) {
        refused = true;
        snprintf(why, sizeof why, "the controller does not take it");
    }
    reply(r, c->m.commander, c->m.request,
          refused ? ARRIS_ROBOT_ACK_T_REFUSED : ARRIS_ROBOT_ACK_T_ACCEPTED, why, utime);
    if (refused)
        return;
    r->request = c->m.request;
    r->outcome = ARRIS_ROBOT_ACK_T_DONE;
    *r->reason = '\0';
    r->deadline = c->m.time_limit > 0 ? now + (int64_t)(c->m.time_limit * 1e9) : INT64_MAX;
}

/* What is done at once. */
static void command_now(robot *r, const command *c, int64_t now, int64_t utime) {
    int rc = 0;
    if (c->m.command == ARRIS_ROBOT_COMMAND_T_STOP)
        halt(r, ARRIS_ROBOT_ACK_T_STOPPED, "a STOP was commanded", now);
    else if (c->m.command == ARRIS_ROBOT_COMMAND_T_HOLD) {
        rc = r->driver->hold(r->self, true, now);
        r->holder = c->m.commander;
    } else if (c->m.command == ARRIS_ROBOT_COMMAND_T_RESUME)
        rc = r->driver->hold(r->self, false, now);
    reply(r, c->m.commander, c->m.request, ARRIS_ROBOT_ACK_T_ACCEPTED, "", utime);
    reply(r, c->m.commander, c->m.request, rc ? ARRIS_ROBOT_ACK_T_STOPPED : ARRIS_ROBOT_ACK_T_DONE,
          rc ? "the controller does not take it" : "", utime);
    if (c->m.command == ARRIS_ROBOT_COMMAND_T_RELEASE && !r->request)
        r->commander = 0;
}

static void obey(robot *r, const command *c, int64_t now, int64_t utime) {
    const int8_t what = c->m.command;
    bool anybody = what == ARRIS_ROBOT_COMMAND_T_STOP || what == ARRIS_ROBOT_COMMAND_T_HOLD ||
                   (what == ARRIS_ROBOT_COMMAND_T_RESUME && c->m.commander == r->holder);
    if (c->m.commander == r->commander)
        r->heard = now;
    if (what == ARRIS_ROBOT_COMMAND_T_ALIVE)
        return;
    const answer *before = find_answer(r, c->m.commander, c->m.request);
    if (before) {
        send_answer(r, before, utime);
        return;
    }
    if (!anybody && r->commander && r->commander != c->m.commander) {
        reply(r, c->m.commander, c->m.request, ARRIS_ROBOT_ACK_T_REFUSED,
              "another commander is obeyed", utime);
        return;
    }
    if (!anybody && !r->commander) {
        r->commander = c->m.commander;
        r->heard = now;
    }
    if (what == ARRIS_ROBOT_COMMAND_T_HOME || what == ARRIS_ROBOT_COMMAND_T_MOVE ||
        what == ARRIS_ROBOT_COMMAND_T_PATH)
        command_motion(r, c, now, utime);
    else
        command_now(r, c, now, utime);
}

/* ---- watching over it ------------------------------------------------------------------------ */

static void watch(robot *r, int64_t now, int64_t utime) {
    const robot_reading *is = &r->reading;
    bool silent = (double)(now - r->heard) * 1e-9 > r->limits.link_timeout;
    if (is->error)
        halt(r, ARRIS_ROBOT_ACK_T_STOPPED,
             *is->message ? is->message : "the robot reports an error", now);
    if (silent)
        halt(r, ARRIS_ROBOT_ACK_T_STOPPED, "its commander is not heard any more", now);
    if (now > r->deadline)
        halt(r, ARRIS_ROBOT_ACK_T_TIMED_OUT, "it was not done within the time limit", now);
    bool still = !is->moving && (!is->held || r->outcome != ARRIS_ROBOT_ACK_T_DONE);
    if (r->request && still) {
        reply(r, r->commander, r->request, r->outcome, r->reason, utime);
        r->request = 0;
    }
    if (!r->request && silent)
        r->commander = 0;
}

/* ---- what it tells --------------------------------------------------------------------------- */

static void tell(robot *r, const char *channel, const robot_pose *at, int64_t utime) {
    const robot_reading *is = &r->reading;
    uint8_t buffer[STATE_MAX];
    arris_robot_state_t m = {.utime = utime,
                             .seq = r->state_seq,
                             .session = r->session,
                             .pos_sigma = is->pos_sigma,
                             .rot_sigma = is->rot_sigma,
                             .moving = is->moving,
                             .homed = is->homed,
                             .held = is->held,
                             .commander = r->commander,
                             .request = r->request,
                             .error = is->error,
                             .message = (char *)(uintptr_t)is->message};
    memcpy(m.pos, at->pos, sizeof m.pos);
    memcpy(m.quat, at->quat, sizeof m.quat);
    int n = arris_robot_state_t_encode(buffer, 0, sizeof buffer, &m);
    if (n > 0)
        link_publish(r->link, channel, buffer, (size_t)n);
}

static void read_controller(robot *r, int64_t now) {
    if (r->driver->read(r->self, now, &r->reading) == 0)
        return;
    r->reading.error = ARRIS_ROBOT_STATE_T_ERROR_CONTROLLER;
    snprintf(r->reading.message, sizeof r->reading.message, "the controller does not answer");
}

void robot_step(robot *r, int64_t now, int64_t utime) {
    while (take(r))
        obey(r, &r->taken, now, utime);
    read_controller(r, now);
    watch(r, now, utime);
    tell(r, "ROBOT_STATE", &r->reading.reported, utime);
    if (r->reading.knows_truth)
        tell(r, "ROBOT_TRUTH", &r->reading.truth, utime);
    r->state_seq++;
}

/* ---- beginning and end ----------------------------------------------------------------------- */

robot *robot_new(const robot_driver *driver, const robot_options *options,
                 const robot_limits *limits, lcm_link *link, int64_t now, fault *f) {
    robot *r = calloc(1, sizeof *r);
    if (!r) {
        fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for the robot");
        return NULL;
    }
    r->driver = driver;
    r->limits = *limits;
    r->link = link;
    r->deadline = INT64_MAX;
    pthread_mutex_init(&r->mutex, NULL);
    if (getrandom(&r->session, sizeof r->session, 0) != sizeof r->session)
        r->session = now;
    r->self = driver->open(options, now, f);
    if (r->self && link_subscribe(link, "ROBOT_COMMAND", QUEUE, receive, NULL, r, f) == 0)
        return r;
    robot_free(r);
    return NULL;
}

void robot_free(robot *r) {
    if (!r)
        return;
    link_unsubscribe(r->link, r);
    if (r->self)
        r->driver->close(r->self);
    free(r);
}

uint64_t robot_malformed(const robot *r) {
    return atomic_load(&r->malformed);
}
