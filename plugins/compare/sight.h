/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * sight.h: what of the nominal the camera's path can see and measure. No dependency on the runtime.
 */
#ifndef SIGHT_H
#define SIGHT_H

#include "match.h"

/* Poses spread over the path: all until they are too many, then every second, every fourth... */
enum { SIGHT_POSES = 32 };
typedef struct sight {
    uint32_t n, seen, every; /* zero to begin with */
    arris_pose pose[SIGHT_POSES];
} sight;
void sight_add(sight *s, const arris_pose *pose);

/* The greatest angle (rad) between the planes through the edge and the camera centres: how far the
 * motion goes around the edge. Near 0 the motion runs along it, and it cannot be measured. */
double sight_swing(const sight *s, const piece *e);

/* seen[i] becomes the number of the poses in which half of edge i or more is in the picture of `c`
 * and not behind a triangle of m, laid by `where`. Returns 0 or ARRIS_E_MEMORY. */
int sight_count(const sight *s, const arris_camera *c, const nominal *m, const place *where,
                const piece *e, uint32_t *seen);

#endif
