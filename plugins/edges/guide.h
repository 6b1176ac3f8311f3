/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * guide.h: decides, for every frame, where edges are looked for. No dependency on the runtime.
 *
 * In one frame of GUIDE_PERIOD the whole picture is searched. In the others, a line whose 3D
 * estimate foresaw it well in the frame before is not searched for: it is handed on, to be looked
 * for along the normals of where it should be. What no such line explains is searched for where it
 * was in the frame before, and as far around as the picture has moved. So all that is new is found
 * GUIDE_PERIOD - 1 frames later at the most, and what a guided line is said to be never outlives
 * what a search finds.
 *
 *     bool part = guide_decide(g, lines, pose, foreseen);     // else the whole picture
 *     const canny_region *r = guide_regions(g, &n);           // if so: to search
 *     guide_learn(g, edges);                                  // what the search found
 */
#ifndef GUIDE_H
#define GUIDE_H

#include "arris_geometry.h"
#include "canny.h"

enum { GUIDE_PERIOD = 4, GUIDE_LINES = 512 };

typedef struct guide guide;

/* For pictures through this lens. NULL: no memory. */
guide *guide_new(const arris_camera *lens);
void guide_free(guide *g); /* NULL is allowed */

/* Begins a frame, taken from `pose` (NULL or invalid: not known). `lines` are those of the frame
 * before, or NULL. True: the lines that it writes to `out` need not be searched for; false: the
 * whole picture is to be searched, and `out` is empty. */
bool guide_decide(guide *g, const arris_lines *lines, const arris_pose *pose, arris_guide *out);

/* The n regions of the picture to search, which do not overlap. */
const canny_region *guide_regions(const guide *g, uint32_t *n);

/* Ends the frame: these chains were found in it. */
void guide_learn(guide *g, const arris_edges *edges);

#endif
