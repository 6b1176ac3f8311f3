/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * shift.h: by how much the camera's reported position is off in each frame, as far as it shows in
 * all lines of the frame. No dependency on the runtime.
 *
 * A view that is corrected by what the *other* lines of its frame say has their noise in place of
 * the pose's. What it cannot tell is where all lines are together: their estimates have averaged
 * the poses, and what is common to these averages stays. So it makes lines truer to each other, and
 * each as true as the best, but their covariance remains that of the poses as reported.
 */
#ifndef SHIFT_H
#define SHIFT_H

#include "line.h"

typedef struct shifts shifts;

/* Room for so many frames; where a scan has more, neighbours share. NULL when memory is short. */
shifts *shifts_new(uint32_t max);
void shifts_free(shifts *t); /* NULL is allowed */

/* Forgets everything; `frames` are to come. */
void shifts_begin(shifts *t, uint32_t frames, const scene *s);

/* Adds what the kept views of a settled line say. */
void shifts_add(shifts *t, const line *l, const scene *s);

/* Sets the shifts of the line's kept views; `added`: the line is one of those. */
void shifts_set(const shifts *t, line *l, const scene *s, bool added);

#endif
