/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * robot.h: the daemon between LCM and a robot's controller: takes commands, answers them, watches
 * over the motion, and tells the robot's state.
 *
 * It obeys one commander at a time: the first, until that one releases the robot or is silent while
 * nothing moves. A commander that is not heard for `link_timeout` while the robot moves is taken as
 * lost, and the robot stops. Everything by one thread, but for what comes in by LCM's.
 */
#ifndef ROBOT_H
#define ROBOT_H

#include "driver.h"
#include "link.h"

typedef struct robot_limits {
    double space[3][2];      /* mm: the work space, from and to along x, y, z */
    double speed, max_speed; /* mm/s: where a command says none; at most */
    double link_timeout;     /* s */
} robot_limits;

typedef struct robot robot;

/* For robot_free. NULL with *f filled. The channels are ROBOT_STATE, ROBOT_TRUTH, ROBOT_COMMAND,
 * ROBOT_ACK. */
robot *robot_new(const robot_driver *driver, const robot_options *options,
                 const robot_limits *limits, lcm_link *link, int64_t now, fault *f);
void robot_free(robot *r); /* NULL is allowed; the robot is stopped */

/* Obeys what has come in, reads the controller and tells its state, as of `now` (arris_now, ns),
 * which is `utime` (µs since the epoch). */
void robot_step(robot *r, int64_t now, int64_t utime);

/* A command, as it comes over LCM; it is obeyed by the next step. Any thread. */
void robot_receive(robot *r, const void *data, size_t n);

/* Messages that were none. Any thread. */
uint64_t robot_malformed(const robot *r);

#endif
