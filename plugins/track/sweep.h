/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * sweep.h: where a line that has no depth yet is to be seen: a sighting of it swept along the
 * epipolar lines of its ends over the interval of depths that is left. No dependency on the
 * runtime.
 *
 * The point of the line at inverse depth w behind an end of the sighting is C + ray / w, and its
 * picture from elsewhere is that of the direction ray + w (C - C'): linear in w before the
 * division by depth, infinity (w = 0) included. Every sighting narrows w, one scalar Kalman step an
 * end; a line along the motion never gets any narrower, nor does it need to.
 */
#ifndef SWEEP_H
#define SWEEP_H

#include "foresight.h"

/* Of depths, as inverse depths, 1/mm: what is expected, and what is possible. */
typedef struct depths {
    double mean, sigma;
    double least, most;
} depths;

typedef struct sweep {
    double C[3], ray[2][3]; /* camera centre; rays to the ends of the sighting, at depth 1 */
    double length;          /* px, of the sighting; 0: there is none yet */
    double own[2];          /* px²: its variances across at the ends */
    double w[2], var[2];    /* the inverse depths there and their variances */
} sweep;

/* Begins a sweep of the segment. */
void sweep_begin(sweep *s, const arris_segment *seen, const viewpoint *v, const depths *d);

/* What the line looks like from another place. False when it is not in front of the camera there or
 * outside of its picture. */
bool sweep_forecast(const sweep *s, const viewpoint *v, forecast *f);

/* The line was seen as this segment. Begins anew when that tells more. */
void sweep_sight(sweep *s, const arris_segment *seen, const viewpoint *v, const depths *d);

/* Whether the sightings tell how far away the line is; then *w is its inverse depth as seen from
 * there. */
bool sweep_depth(const sweep *s, const viewpoint *v, double *w);

#endif
