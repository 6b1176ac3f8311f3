/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * guide.h: decides, for every frame, whether edges are looked for. No dependency on the runtime.
 *
 * Once lines are known well, one frame in GUIDE_PERIOD is not searched: lines whose 3D estimate
 * foresees them well are handed on, to be looked for along the normals of where they should be, and
 * nothing else is looked at. Texture, and what is not yet known so well or might be taken for
 * another line, is seen less often. So all that is new is found one frame later at the most, and
 * what a guided line is said to be never outlives what a search finds.
 */
#ifndef GUIDE_H
#define GUIDE_H

#include "arris_geometry.h"

enum { GUIDE_PERIOD = 3, GUIDE_LINES = 512 };

typedef struct guide guide;

/* For pictures through this lens. NULL: no memory. */
guide *guide_new(const arris_camera *lens);
void guide_free(guide *g); /* NULL is allowed */

/* Begins a frame, taken from `pose` (NULL or invalid: not known). `lines` are those of the frame
 * before, or NULL. True: no more is to be looked for than the lines that it writes to `out`; false:
 * the picture is to be searched, and `out` is empty. */
bool guide_decide(guide *g, const arris_lines *lines, const arris_pose *pose, arris_guide *out);

#endif
