/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * sim.c: the driver `sim`: a simulated robot. It goes where it is told with trapezoidal speed, says
 * that it is exactly there, and is somewhere near: off by a constant offset, by what each target is
 * missed by (repeatability), and by the stick-slip of its axes, each of which lags more and more,
 * then slips ahead.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "arris_plugin.h"
#include "lcmtypes/arris_robot_state_t.h"
#include "motion.h"
#include "rigid.h"

static const double CYCLE = 2; /* mm of an axis's travel from slip to slip */

typedef struct sim {
    robot_options o;
    path path;
    int run, end; /* the poses of the path that it goes from and to without a stop */
    double speed; /* mm/s */
    profile profile;
    bool homed, homing, held, moving, stopping;
    double travel[3];  /* mm, of the axes before this path */
    double miss[2][3]; /* mm: by which the run's first and last poses are missed */
    uint64_t targets;  /* ever missed */
} sim;

/* ---- chance, the same for the same seed ------------------------------------------------------ */

/* From 0 to 1, by what it is for (splitmix64). */
static double chance(const sim *m, uint64_t kind, uint64_t k) {
    uint64_t z = ((uint64_t)m->o.seed << 48 ^ kind << 40 ^ k) + 0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return (double)((z ^ z >> 31) >> 11) * 0x1p-53;
}

/* With sigma 1. */
static double gauss(const sim *m, uint64_t kind, uint64_t k) {
    return sqrt(-2 * log(1 - chance(m, kind, 2 * k))) * cos(2 * M_PI * chance(m, kind, 2 * k + 1));
}

/* How far an axis is ahead after `travel` mm, with a sigma of 1: in each cycle it falls behind,
 * then slips ahead over its last part. It begins in the middle of a fall, at 0. */
static double stick_slip(const sim *m, int axis, double travel) {
    uint64_t kind = 10 + (uint64_t)axis;
    double way = travel / CYCLE + (0.6 + 0.35 * chance(m, kind, 0)) / 2;
    uint64_t k = (uint64_t)way;
    double u = way - (double)k, slip = 0.6 + 0.35 * chance(m, kind, 2 * k);
    double top = sqrt(3) * (0.7 + 0.6 * chance(m, kind, 2 * k + 1));
    double next = sqrt(3) * (0.7 + 0.6 * chance(m, kind, 2 * k + 3));
    if (u < slip)
        return top * (1 - 2 * u / slip);
    return -top + (top + next) * (u - slip) / (1 - slip);
}

/* ---- motion ---------------------------------------------------------------------------------- */

static void begin_run(sim *m, int from, int64_t now) {
    m->run = from;
    m->end = path_run_end(&m->path, from);
    m->profile = profile_plan(m->path.s[from], m->path.s[m->end], m->speed, m->o.acceleration, now);
    memcpy(m->miss[0], m->miss[1], sizeof m->miss[0]);
    for (int i = 0; i < 3; i++)
        m->miss[1][i] = m->o.repeatability * gauss(m, 1, 3 * m->targets + (uint64_t)i);
    m->targets++;
}

/* Turns q by the small rotation w, rad, about the base's axes. */
static void turn(double q[4], const double w[3]) {
    const double a[4] = {1, w[0] / 2, w[1] / 2, w[2] / 2}, r[4] = {q[0], q[1], q[2], q[3]};
    q[0] = a[0] * r[0] - a[1] * r[1] - a[2] * r[2] - a[3] * r[3];
    q[1] = a[0] * r[1] + a[1] * r[0] + a[2] * r[3] - a[3] * r[2];
    q[2] = a[0] * r[2] - a[1] * r[3] + a[2] * r[0] + a[3] * r[1];
    q[3] = a[0] * r[3] + a[1] * r[2] - a[2] * r[1] + a[3] * r[0];
    double n = sqrt(1 + a[1] * a[1] + a[2] * a[2] + a[3] * a[3]);
    for (int i = 0; i < 4; i++)
        q[i] /= n;
}

/* By how much its way along the run misses the poses, mm. */
static void missed(const sim *m, double s, double miss[3]) {
    double from = m->path.s[m->run], way = m->path.s[m->end] - from;
    double f = way > 0 ? (s - from) / way : 1;
    for (int i = 0; i < 3; i++)
        miss[i] = (1 - f) * m->miss[0][i] + f * m->miss[1][i];
}

/* Where the run has brought it, by the controller and in truth. */
static void locate(const sim *m, int64_t now, robot_pose *reported, robot_pose *truth,
                   double travel[3]) {
    double s = profile_at(&m->profile, now), miss[3], w[3];
    missed(m, s, miss);
    path_at(&m->path, s, reported, travel);
    *truth = *reported;
    for (int i = 0; i < 3; i++) {
        travel[i] += m->travel[i];
        double total = travel[0] + travel[1] + travel[2];
        truth->pos[i] += m->o.offset[i] + miss[i] + m->o.jitter * stick_slip(m, i, travel[i]);
        w[i] = m->o.rot_jitter * stick_slip(m, 3 + i, total);
    }
    turn(truth->quat, w);
}

/* Takes the runs that have ended by `now` as done. */
static void advance(sim *m, int64_t now) {
    while (m->moving && now >= profile_end(&m->profile)) {
        if (m->held)
            return;
        if (m->end + 1 < m->path.n && !m->stopping) {
            begin_run(m, m->end, profile_end(&m->profile));
            continue;
        }
        m->moving = false;
        m->homed |= m->homing;
        m->homing = m->stopping = false;
    }
}

/* ---- the driver ------------------------------------------------------------------------------ */

static void *sim_open(const robot_options *o, int64_t now, fault *f) {
    sim *m = calloc(1, sizeof *m);
    robot_pose somewhere = o->home;
    if (!m) {
        fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for the robot");
        return NULL;
    }
    m->o = *o;
    somewhere.pos[0] += 20; /* it was left there */
    path_begin(&m->path, &somewhere);
    m->profile = profile_plan(0, 0, 1, o->acceleration, now);
    return m;
}

static int sim_follow(void *self, const robot_pose *pose, int n, double speed, int64_t now) {
    sim *m = self;
    robot_pose here, truth;
    double travel[3];
    locate(m, now, &here, &truth, travel);
    memcpy(m->travel, travel, sizeof travel);
    missed(m, profile_at(&m->profile, now), m->miss[1]);
    path_begin(&m->path, &here);
    for (int i = 0; i < n; i++)
        path_add(&m->path, &pose[i]);
    m->speed = speed;
    m->moving = true;
    m->held = m->stopping = false;
    begin_run(m, 0, now);
    return 0;
}

static int sim_home(void *self, double speed, int64_t now) {
    sim *m = self;
    m->homed = false;
    m->homing = true;
    return sim_follow(self, &m->o.home, 1, speed, now);
}

static int sim_stop(void *self, int64_t now) {
    sim *m = self;
    if (!m->moving)
        return 0;
    if (!m->held)
        m->profile = profile_brake(&m->profile, m->o.acceleration, now);
    m->held = m->homing = false;
    m->stopping = true;
    return 0;
}

static int sim_hold(void *self, bool hold, int64_t now) {
    sim *m = self;
    if (!m->moving || hold == m->held)
        return 0;
    m->held = hold;
    if (hold)
        m->profile = profile_brake(&m->profile, m->o.acceleration, now);
    else
        m->profile = profile_plan(profile_at(&m->profile, now), m->path.s[m->end], m->speed,
                                  m->o.acceleration, now);
    return 0;
}

static int sim_read(void *self, int64_t now, robot_reading *out) {
    sim *m = self;
    double travel[3];
    advance(m, now);
    *out = (robot_reading){.pos_sigma = hypot(m->o.jitter, m->o.repeatability),
                           .rot_sigma = m->o.rot_jitter,
                           .moving = m->moving && now < profile_end(&m->profile),
                           .homed = m->homed,
                           .held = m->held,
                           .error = ARRIS_ROBOT_STATE_T_ERROR_NONE,
                           .knows_truth = true};
    locate(m, now, &out->reported, &out->truth, travel);
    return 0;
}

static void sim_close(void *self) {
    free(self);
}

const robot_driver driver_sim = {
    .name = "sim",
    .summary = "a simulated robot, which tells the truth about itself on a channel of its own",
    .any_time = true,
    .open = sim_open,
    .close = sim_close,
    .home = sim_home,
    .follow = sim_follow,
    .stop = sim_stop,
    .hold = sim_hold,
    .read = sim_read,
};
