/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * client.h: gives the robot one command, and stays until it is done.
 */
#ifndef ROBOT_CLIENT_H
#define ROBOT_CLIENT_H

#include "driver.h"
#include "link.h"

typedef struct client_command {
    int8_t command;    /* ARRIS_ROBOT_COMMAND_T_... */
    double speed;      /* mm/s; 0: the robot's own */
    double time_limit; /* s; 0: none */
    int n;
    robot_pose pose[ROBOT_POSES];
} client_command;

/* Sends it until it is answered, says ALIVE meanwhile, and waits for its end; when *stop is set it
 * has the robot stop. Returns 0 when it was done, ARRIS_E_INPUT when it was refused, stopped or
 * timed out, ARRIS_E_IO when no robot answers within 2 s; the last two with *f filled. A HOLD lasts
 * until *stop is set. */
int client_run(lcm_link *link, const client_command *c, const volatile int *stop, fault *f);

#endif
