/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * route.h: the poses that a simulated camera takes, frame by frame.
 */
#ifndef ROUTE_H
#define ROUTE_H

#include "arris_types.h"

enum route_kind { ROUTE_X, ROUTE_Y, ROUTE_ARC };

typedef struct route {
    enum route_kind kind;
    double middle[6]; /* x, y, z (mm), omega, theta, kappa (rad): the pose half way */
    double step;      /* mm from frame to frame */
    double radius;    /* mm, of the arc */
} route;

/* Where the camera is in frame i of n: on a straight way along its own x or y axis, or on an arc in
 * its x-z plane around the point `radius` in front of the middle, at which it looks. Of a path
 * without end (n = 0) frame 0 is the middle. */
void route_pose(const route *p, int64_t i, int64_t n, arris_pose *pose);

/* Shakes a pose: normal errors of `position` mm and `rotation` rad on every axis, which follow from
 * the seed alone. */
void route_shake(arris_pose *pose, double position, double rotation, uint64_t seed);

#endif
