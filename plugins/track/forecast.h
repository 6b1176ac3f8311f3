/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * forecast.h: where a track should be seen next, and how well a segment agrees with it. No
 * dependency on the runtime.
 */
#ifndef FORECAST_H
#define FORECAST_H

#include "arris_types.h"

typedef struct forecast {
    arris_segment where; /* its ends; the grey levels of its sides, alike when they are unknown */
    bool turned;         /* it runs against the direction of the segment that is expected */
    double cov[3];       /* of its distance across itself at the two ends: var, cov, var, px² */
    double box;          /* px: surely no farther off; 0: as `cov` says */
    bool line;           /* of a 3D line: that may flip its polarity over a changing background */
} forecast;

/* The forecast at the ends of `where`, off by as much as `box` px across it, no matter where. */
forecast forecast_box(const arris_segment *where, double box);

/* How far off the forecast may be across itself, px. */
double forecast_reach(const forecast *f);

/* Whether the segment, of either direction, may be within `reach` of the forecast: what is not is
 * none of it. */
bool forecast_near(const forecast *f, const arris_segment *s, double reach);

/* How badly the segment, which is near, agrees: 0 when it is where it was foreseen, in the whole of
 * it, 1 and more where it is out of the gate, by the Mahalanobis distance of position and
 * direction, or where it has too little in common with the forecast. */
double forecast_misfit(const forecast *f, const arris_segment *s);

/* What speaks against such a segment's being what was foreseen, polarity and contrast included; the
 * smaller, the more likely. INFINITY when it is none. *off is its misfit. */
double forecast_cost(const forecast *f, const arris_segment *s, double *off);

/* ---- segments ------------------------------------------------------------------------------- */

/* The unit vector along s, and its length in px; 0 when the ends coincide. */
double segment_direction(const arris_segment *s, double u[2]);

/* The stretch that s has in common with p: from t[0] to t[1] px along p from its first end, where s
 * is d[0] and d[1] px to the right of p. Returns its share of the longer one, 0 when it is less
 * than half of the shorter one or the directions differ. */
double segment_stretch(const arris_segment *p, const arris_segment *s, double t[2], double d[2]);

/* The same line, walked in the direction of f->where. */
arris_segment segment_along(const forecast *f, const arris_segment *s);

#endif
