/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * follow.h: where a simulated robot truly is, from its messages on ROBOT_TRUTH.
 */
#ifndef FOLLOW_H
#define FOLLOW_H

#include "fault.h"

typedef struct follow follow;

/* Listens on `url` ("default": as without a URL). `handeye` is a handeye.json, or NULL: the robot's
 * pose is the camera's. follow_free must follow in any case. Returns 0, or ARRIS_E_INPUT, _IO,
 * _USAGE, _MEMORY. */
int follow_new(follow **made, const char *url, const char *handeye, fault *f);
void follow_free(follow *w);

/* The camera's pose at utime (µs), as soon as the robot has said where it was after that. False
 * when it has not by `deadline` (arris_now), or has said nothing around then. By one thread. */
bool follow_pose(follow *w, int64_t utime, int64_t deadline, arris_pose *out);

#endif
