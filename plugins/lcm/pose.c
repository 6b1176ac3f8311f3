/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * pose.c: the stage `pose`: gives each frame the camera's pose at the middle of its exposure, from
 * the robot's states as they come over LCM, or from a frames.csv.
 *
 * A frame waits for the state after it, until `wait` ms after it came; its pose is interpolated
 * between that one and the one before, never extrapolated. The stage stands in the lane behind the
 * live source's queue, so that the source does not wait.
 */
#include <pthread.h>
#include <stdlib.h>
#include <time.h>

#include "arris_plugin.h"
#include "frames.h"
#include "handeye.h"
#include "link.h"
#include "rigid.h"
#include "states.h"

enum { BY_INDEX, BY_TIME };
enum { PASS, DROP, ERROR };
enum { QUEUE = 256 /* states */, STUCK = 4 /* polls of POLL */ };
static const int64_t POLL = 5000000, RECENT = 2000000000; /* ns */

struct pose {
    const char *url, *channel, *location, *handeye_path;
    int32_t by, no_pose, offset; /* offset: µs */
    double wait, max_gap;        /* ms */

    arris_stage *stage;
    handeye handeye;
    frame_list frames; /* of location=, by index or time */
    timeline listed;   /* the same, by=time */

    lcm_link *link;        /* NULL: with location= */
    pthread_mutex_t mutex; /* of what follows */
    pthread_cond_t changed;
    states states;
    enum timeline_answer miss; /* why the last frame without pose had none */
    int64_t missed;            /* ns, when that was; 0: never */
    uint64_t counted[STATES_EVENTS];
};

/* ---- the robot's states ---------------------------------------------------------------------- */

static void receive(void *user, const void *data, size_t n) {
    struct pose *p = user;
    pthread_mutex_lock(&p->mutex);
    states_receive(&p->states, data, n, arris_now());
    pthread_cond_signal(&p->changed);
    pthread_mutex_unlock(&p->mutex);
}

static void tick(void *user) {
    static const char *const why[] = {
        [TIMELINE_TOO_NEW] = "frames are later than the robot's states: two clocks, or a slow link",
        [TIMELINE_TOO_OLD] = "frames are earlier than the robot's states: two clocks",
        [TIMELINE_GAP] = "there are gaps in the robot's states"};
    struct pose *p = user;
    int64_t now = arris_now();
    pthread_mutex_lock(&p->mutex);
    const char *trouble = states_trouble(&p->states, now);
    if (!trouble && p->missed && now - p->missed < RECENT)
        trouble = why[p->miss];
    pthread_mutex_unlock(&p->mutex);
    arris_trouble(p->stage, trouble);
}

static void wait_a_bit(struct pose *p, int64_t until) {
    int64_t now = arris_now(), end = until < now + POLL ? until : now + POLL;
    struct timespec t = {.tv_sec = end / 1000000000, .tv_nsec = end % 1000000000};
    pthread_cond_timedwait(&p->changed, &p->mutex, &t);
}

/* Nothing more will be read before this frame has gone: the log is at its end, or waits for us. */
static bool log_stuck(const struct pose *p, int *polls) {
    *polls = link_blocked(p->link) ? *polls + 1 : 0;
    return link_ended(p->link) || *polls == STUCK;
}

/* With the mutex: the pose at utime, as soon as the state after it is there. */
static enum timeline_answer await(struct pose *p, int64_t utime, int64_t arrival, timed_pose *out) {
    bool log = link_log(p->link) != NULL;
    int64_t deadline = log ? INT64_MAX : arrival + (int64_t)(p->wait * 1e6);
    for (int polls = 0;;) {
        bool last = log ? log_stuck(p, &polls) : arris_now() >= deadline;
        enum timeline_answer a =
            timeline_at(&p->states.line, utime, (int64_t)(p->max_gap * 1e3), out);
        if (a != TIMELINE_TOO_NEW || last || !arris_running(p->stage))
            return a;
        wait_a_bit(p, deadline);
    }
}

static void count_events(struct pose *p) {
    for (int e = 0; e < STATES_EVENTS; e++) {
        if (p->states.count[e] != p->counted[e])
            arris_count(p->stage, states_event_name((enum states_event)e),
                        p->states.count[e] - p->counted[e]);
        p->counted[e] = p->states.count[e];
    }
}

static void from_robot(struct pose *p, int64_t utime, int64_t arrival, arris_pose *out) {
    timed_pose t;
    link_start(p->link);
    pthread_mutex_lock(&p->mutex);
    enum timeline_answer a = await(p, utime, arrival, &t);
    if (a == TIMELINE_FOUND) {
        timed_pose_write(&t, out);
    } else {
        p->miss = a;
        p->missed = arris_now();
    }
    count_events(p);
    pthread_mutex_unlock(&p->mutex);
}

static int listen_to_robot(struct pose *p, fault *f) {
    pthread_condattr_t attr;
    pthread_mutex_init(&p->mutex, NULL);
    pthread_condattr_init(&attr);
    pthread_condattr_setclock(&attr, CLOCK_MONOTONIC);
    pthread_cond_init(&p->changed, &attr);
    pthread_condattr_destroy(&attr);
    if (!states_new(&p->states, arris_now()))
        return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for %d states", STATES_ROOM);
    p->link = link_open(p->url, f);
    return p->link ? link_subscribe(p->link, p->channel, QUEUE, receive, tick, p, f) : ARRIS_E_IO;
}

/* ---- a list of poses ------------------------------------------------------------------------- */

static int compare_index(const void *a, const void *b) {
    const frame_entry *x = a, *y = b;
    return (x->index > y->index) - (x->index < y->index);
}

static int compare_time(const void *a, const void *b) {
    const frame_entry *x = a, *y = b;
    return (x->utime > y->utime) - (x->utime < y->utime);
}

static void add_to_timeline(struct pose *p, const frame_entry *e) {
    const timed_pose *newest = timeline_newest(&p->listed);
    timed_pose t = {.utime = e->utime};
    arris_pose pose;
    if (!e->posed || (newest && newest->utime == e->utime))
        return;
    frames_pose(e, &pose);
    for (int i = 0; i < 3; i++)
        t.pos[i] = pose.C[i];
    rigid_quaternion(pose.R, t.quat);
    for (int i = 1; i < 4; i++) /* R is world to body */
        t.quat[i] = -t.quat[i];
    timeline_add(&p->listed, &t);
}

static int load_list(struct pose *p, fault *f) {
    int r = frames_load(&p->frames, p->location, 0, f);
    if (r < 0)
        return r;
    if (!p->frames.posed)
        return fault_set(f, ARRIS_E_INPUT, "its columns x,y,z,omega,theta,kappa hold the poses",
                         "%s has no poses", p->location);
    qsort(p->frames.item, p->frames.n, sizeof *p->frames.item,
          p->by == BY_INDEX ? compare_index : compare_time);
    if (!timeline_new(&p->listed, (uint32_t)p->frames.n))
        return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for %zu poses", p->frames.n);
    for (size_t i = 0; i < p->frames.n && p->by == BY_TIME; i++)
        add_to_timeline(p, &p->frames.item[i]);
    return 0;
}

static void from_list(const struct pose *p, int64_t index, int64_t utime, arris_pose *out) {
    frame_entry key = {.index = index}, *e;
    timed_pose t;
    if (p->by == BY_INDEX) {
        e = bsearch(&key, p->frames.item, p->frames.n, sizeof key, compare_index);
        if (e)
            frames_pose(e, out);
    } else if (timeline_at(&p->listed, utime, (int64_t)(p->max_gap * 1e3), &t) == TIMELINE_FOUND) {
        timed_pose_write(&t, out);
    }
}

/* ---- the stage ------------------------------------------------------------------------------- */

static int setup(arris_stage *s, void *self, arris_caps *caps) {
    struct pose *p = self;
    fault f;
    (void)caps;
    p->stage = s;
    int r = p->handeye_path ? handeye_load(p->handeye_path, &p->handeye, &f) : 0;
    if (r == 0)
        r = p->location ? load_list(p, &f) : listen_to_robot(p, &f);
    return r < 0 ? arris_fail(s, r, f.hint, "%s", f.text) : arris_reserve(s, ARRIS_POSE, 0, 0);
}

static int without_pose(arris_stage *s, const struct pose *p) {
    arris_count(s, "without pose", 1);
    if (p->no_pose == ERROR)
        return arris_fail(s, ARRIS_E_INPUT, "no-pose=pass or no-pose=drop goes on",
                          "there is no pose for this frame");
    return p->no_pose == DROP ? ARRIS_DROP : 0;
}

static int process(arris_stage *s, void *self, arris_frame *f) {
    struct pose *p = self;
    arris_pose *out = arris_layer_give(s, f, ARRIS_POSE);
    int64_t utime = arris_frame_utime(f) + p->offset;
    if (p->location)
        from_list(p, arris_frame_index(f), utime, out);
    else
        from_robot(p, utime, arris_frame_arrival(f), out);
    if (!out->valid)
        return without_pose(s, p);
    if (p->handeye_path)
        rigid_move(out, p->handeye.t, p->handeye.q);
    return 0;
}

static void close_pose(arris_stage *s, void *self) {
    struct pose *p = self;
    (void)s;
    if (p->link)
        link_unsubscribe(p->link, p);
    link_close(p->link);
    states_free(&p->states);
    timeline_free(&p->listed);
    frames_free(&p->frames);
}

#define T struct pose
static const arris_prop props[] = {
    ARRIS_P_STRING(T, url, "url", NULL,
                   "of the LCM network, or file:///PATH of a log; without it LCM_DEFAULT_URL, or "
                   "multicast on this machine"),
    ARRIS_P_STRING(T, channel, "channel", "ROBOT_STATE", "where the robot says where it is"),
    ARRIS_P_INFILE(T, location, "location", NULL,
                   "a frames.csv that the poses are taken from instead"),
    ARRIS_P_ENUM(T, by, "by", "index", "index|time", "what a frame is found by in location="),
    ARRIS_P_INFILE(
        T, handeye_path, "handeye", NULL,
        "a handeye.json: the poses are of the flange, and the camera sits on it; without "
        "it they are the camera's"),
    ARRIS_P_DOUBLE(T, wait, "wait", "60", 0, 10000, "ms",
                   "how long after it came a frame waits for the state after it"),
    ARRIS_P_DOUBLE(T, max_gap, "max-gap", "50", 1, 1e6, "ms",
                   "between two states that are interpolated between"),
    ARRIS_P_INT(T, offset, "offset", "0", -1000000000, 1000000000, "us",
                "added to the frame's time: how much the camera's clock is behind the robot's"),
    ARRIS_P_ENUM(
        T, no_pose, "no-pose", "pass", "pass|drop|error",
        "what is done with a frame that gets no pose; pass: it goes on with an invalid one"),
};

const arris_stage_desc stage_pose = {
    .size = sizeof(arris_stage_desc),
    .name = "pose",
    .summary = "the camera's pose in each frame, from the robot's states or a list",
    .example = "imagesrc location=samples/box/frames.csv ! pose location=samples/box/frames.csv ! "
               "fakesink",
    .layers = {.gives = ARRIS_BIT(ARRIS_POSE)},
    .self_size = sizeof(struct pose),
    .props = props,
    .n_props = sizeof props / sizeof *props,
    .setup = setup,
    .process = process,
    .close = close_pose,
};
