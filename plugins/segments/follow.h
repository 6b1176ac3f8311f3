/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * follow.h: segments of lines that are foreseen, straight from the picture.
 */
#ifndef FOLLOW_H
#define FOLLOW_H

#include "support.h"

typedef struct follower follower;

/* For pictures of up to this size. NULL: no memory. */
follower *follower_new(int width, int height);
void follower_free(follower *f); /* NULL is allowed */

/* Adds a segment to `out`, which it is given empty, for every foreseen line that is seen over at
 * least `min_length` px and passes for an edge of its polarity near where it is foreseen. `r` looks
 * at the picture and knows the other edges near by; then it knows these lines too. `camera` is what
 * the coordinates of `out` follow. */
void follow(follower *f, const arris_guide *guide, const arris_image *image,
            const arris_camera *camera, double noise, double min_length, refitter *r,
            arris_segments *out);

/* Whether a line from (x1, y1) to (x2, y2) is one of the segments, or a part of one. */
bool follow_has(const arris_segments *found, double x1, double y1, double x2, double y2);

#endif
