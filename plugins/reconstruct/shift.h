/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * shift.h: by how much the camera's reported position is off in each frame, as far as it shows in
 * all lines of the frame. No dependency on the runtime.
 *
 * A view that is corrected by what the *other* lines of its frame say has their noise in place of
 * the pose's. What it cannot tell is where all lines are together: their estimates have averaged
 * the poses, and what is common to these averages stays; path.h takes care of it.
 */
#ifndef SHIFT_H
#define SHIFT_H

#include "line.h"

typedef struct shifts shifts;

/* Room for so many frames; where a scan has more, neighbours share. NULL when memory is short. */
shifts *shifts_new(uint32_t max);
void shifts_free(shifts *t); /* NULL is allowed */

/* Forgets everything; `frames` are to come, whose position has the covariance S, mm². */
void shifts_begin(shifts *t, uint32_t frames, const double S[9]);

/* Adds what the kept views of a settled line say. */
void shifts_add(shifts *t, const line *l, const scene *s);

/* Sets the shifts of the line's kept views; `added`: the line is one of those. */
void shifts_set(const shifts *t, line *l, const scene *s, bool added);

/* How many places there are, each for a frame or for neighbours that share. */
uint32_t shifts_places(const shifts *t);

/* A place's frame and its shift, by all lines. False when none says anything. */
bool shifts_at(const shifts *t, uint32_t place, uint32_t *at_frame, double shift[3]);

/* The mean number of lines that say something in a place. */
double shifts_lines(const shifts *t);

/* The inverse of S. */
void shifts_prior(const shifts *t, double inverse[9]);

/* S anew from the shifts: their squares and what they leave (EM; Dempster 1977). */
void shifts_spread(const shifts *t, double S[9]);

#endif
