/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * motion.h: where a robot is on its way along a path, at any time: trapezoidal speed along straight
 * pieces. Pure functions of time; nothing is allocated.
 */
#ifndef ROBOT_MOTION_H
#define ROBOT_MOTION_H

#include "driver.h"

/* The way s along a path by time, in up to three phases of constant acceleration. */
typedef struct profile {
    int64_t begin; /* ns */
    int n;
    struct {
        double t, s, v, a; /* s since `begin`, and there: mm, mm/s, mm/s² */
    } phase[3];
    double t_end, s_end; /* s, mm: then it stands */
} profile;

/* From rest at s0 to rest at s1 (not before s0), with at most `speed` and `acceleration`. */
profile profile_plan(double s0, double s1, double speed, double acceleration, int64_t begin);
/* The same motion braked from `now` on. */
profile profile_brake(const profile *p, double acceleration, int64_t now);
/* The way at `now`, which may not be before `begin`. */
double profile_at(const profile *p, int64_t now);
static inline int64_t profile_end(const profile *p) {
    return p->begin + (int64_t)(p->t_end * 1e9);
}

/* A path from where the robot is (pose[0]) along n - 1 others. */
typedef struct path {
    int n;
    robot_pose pose[ROBOT_POSES + 1];
    double s[ROBOT_POSES + 1]; /* the way to each: mm, or 100 mm a radian where that is more */
    double travel[ROBOT_POSES + 1][3]; /* what each axis has gone through, mm */
} path;

void path_begin(path *p, const robot_pose *at);
void path_add(path *p, const robot_pose *to);
/* The corner at which the robot must stop that comes after `from`: the next that turns by more than
 * 5 degrees, or the last. */
int path_run_end(const path *p, int from);
/* The pose at the way s, and what each axis has gone through. */
void path_at(const path *p, double s, robot_pose *out, double travel[3]);

#endif
