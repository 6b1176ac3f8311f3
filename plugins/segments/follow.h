/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * follow.h: segments of lines that are foreseen, straight from the picture.
 */
#ifndef FOLLOW_H
#define FOLLOW_H

#include "support.h"

/* Adds a segment to `out`, which it is given empty, for every foreseen line that is seen over at
 * least `min_length` px and passes for an edge of its polarity near where it is foreseen. `r` looks
 * at the picture and knows what was beside the lines. `camera` is what the coordinates of `out`
 * follow. */
void follow(support *s, const arris_guide *guide, const arris_image *image,
            const arris_camera *camera, double noise, double min_length, refitter *r,
            arris_segments *out);

#endif
