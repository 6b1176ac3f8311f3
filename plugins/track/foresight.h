/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * foresight.h: where the running 3D lines are to be seen next. No dependency on the runtime.
 */
#ifndef FORESIGHT_H
#define FORESIGHT_H

#include "arris_geometry.h"
#include "forecast.h"

/* A camera at a pose of which this much is not known. */
typedef struct viewpoint {
    const arris_camera *camera;
    const arris_pose *pose;
    double position, rotation; /* sigma of the pose, mm and rad */
} viewpoint;

/* Adds what the pose leaves open to the forecast of a line at this depth, mm. */
void blur_forecast(const viewpoint *v, double depth, forecast *f);

/* Whether the segment is in the picture, at least in part. */
bool in_picture(const arris_camera *c, const arris_segment *s);

/* What the line looks like from there, its lens included, and its depth in the middle, mm. False
 * when it is not in front of the camera or outside of its picture. */
bool foresee(const arris_line *l, const viewpoint *v, forecast *f, double *depth);

#endif
