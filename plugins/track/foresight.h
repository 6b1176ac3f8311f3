/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * foresight.h: where the running 3D lines are to be seen next. No dependency on the runtime.
 */
#ifndef FORESIGHT_H
#define FORESIGHT_H

#include "arris_geometry.h"

/* The segment that the line makes in the picture of the camera at `pose`, its lens included, and
 * how far off across itself it may be, px: `sigmas` of the line's own uncertainty at the worse end.
 * False when the line is not known, or an end of it is not in front of the camera. */
bool foresee(const arris_line *l, const arris_camera *c, const arris_pose *pose, double sigmas,
             arris_segment *where, double *reach);

#endif
