/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * window.h: the fixed lag: lines and poses adjusted together while the scan runs, at a cost and in
 * a memory that stay the same. No dependency on the runtime.
 *
 * Unknown are the poses of the last frames and the lines that they see, 64 at most. A frame that
 * leaves the window is eliminated: what it said stays as information of all lines together, a
 * matrix of 4 rows a line, since a pose's error is in every line that was seen from it. Would each
 * line keep its own share alone, an error that all have in common, the scan's place and scale,
 * would be averaged away over the frames. The noise is estimated on the way, as adj_estimate has
 * it: of the poses by axis, how it hangs together over the frames, and of each line.
 */
#ifndef ADJUST_WINDOW_H
#define ADJUST_WINDOW_H

#include "problem.h"

enum { WINDOW_FRAMES = 64 }; /* at most */

typedef struct window window;

typedef struct window_params {
    uint32_t frames;              /* of the window: 1 to WINDOW_FRAMES */
    double pose_sigma, rot_sigma; /* mm, rad; 0: unknown, estimated */
    double robust;                /* sigmas */
} window_params;

/* For running lines of which there are max_lines at most. NULL: no memory. Nothing is allocated
 * afterwards. */
window *window_new(const window_params *p, const arris_camera *c, uint32_t max_lines);
void window_free(window *w); /* NULL is allowed */

/* Begins a frame. */
void window_frame(window *w, const arris_pose *reported);
/* A segment of that frame, in pixels of the camera `c`, whose lens is taken out of it. Those that
 * find no room in their frame are left out. */
void window_add(window *w, int32_t track, const arris_segment *s, const arris_camera *c);

/* Adjusts the window, once the frame's segments were added. `lines` are the running lines of that
 * frame; a track is the line's of its id or that it was merged into. What comes of it replaces
 * their ends, covariance, rms and change, in place, also of lines that are out of the window by
 * now. Without a frame before it only does that. */
void window_adjust(window *w, arris_lines *lines);

#endif
