/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * driver.h: what stands between the daemon and a robot's controller. A driver is one file with one
 * of these tables; the daemon calls it from one thread, one call at a time, and checks beforehand
 * that the robot is homed, that poses lie in the work space and that speeds are allowed.
 *
 * Times `now` are arris_now, ns. Functions return 0, or ARRIS_E_IO when the controller does not
 * answer or refuses; none waits longer than some ms. After `home` and `follow`, `read` says moving
 * or held until the robot has come to rest.
 */
#ifndef ROBOT_DRIVER_H
#define ROBOT_DRIVER_H

#include "fault.h"

enum { ROBOT_POSES = 500, ROBOT_TEXT = 200 };

typedef struct robot_pose {
    double pos[3];  /* of the flange in the robot's base, mm */
    double quat[4]; /* w, x, y, z: flange to base */
} robot_pose;

typedef struct robot_options {
    robot_pose home;
    double acceleration;                                 /* mm/s² */
    double jitter, rot_jitter, repeatability, offset[3]; /* mm, rad: of the simulated robot */
    int seed;
} robot_options;

typedef struct robot_reading {
    robot_pose reported;         /* as the controller says */
    double pos_sigma, rot_sigma; /* mm, rad; 0: unknown */
    bool moving, homed, held;
    int32_t error;            /* ARRIS_ROBOT_STATE_T_ERROR_... */
    char message[ROBOT_TEXT]; /* the controller's words for it */
    bool knows_truth;         /* a simulation: `truth` is where it really is */
    robot_pose truth;
} robot_reading;

typedef struct robot_driver {
    const char *name, *summary;
    /* `read` may be asked for any time since the last one: then a daemon that was late makes up for
     * what it left out. */
    bool any_time;
    void *(*open)(const robot_options *o, int64_t now, fault *f); /* NULL with *f filled */
    void (*close)(void *self);
    int (*home)(void *self, double speed, int64_t now); /* mm/s */
    int (*follow)(void *self, const robot_pose *pose, int n, double speed, int64_t now);
    int (*stop)(void *self, int64_t now);            /* forgets where it was going */
    int (*hold)(void *self, bool hold, int64_t now); /* or goes on */
    int (*read)(void *self, int64_t now, robot_reading *out);
} robot_driver;

extern const robot_driver driver_sim;

#endif
