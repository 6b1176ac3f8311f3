/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * noise.h: how large the residuals of all lines are, what they share, and how they hang together
 * over the frames. No dependency on the runtime.
 */
#ifndef NOISE_H
#define NOISE_H

#include "line.h"

typedef struct noise {
    double v[3], M[9], self, lines; /* of this frame */
    double common, weight;          /* mm²: the share of the residuals common to a view */
    double product, square;         /* of a line's residuals in successive frames */
} noise;

/* Adds the residual of a settled line in this frame: the view v, linear about the estimate before
 * it, with its distance. `before` is what this returned for the line in the frame before, 0 when
 * there was none. */
double noise_add(noise *n, const view *v, const linear *r, double before);

/* Ends the frame. */
void noise_end_frame(noise *n);

/* sigma of the camera's position in a view, mm, as far as it shows in more than one line. */
double noise_position(const noise *n);

/* How many successive views count as one, by the lines' residuals: (1 + rho) / (1 - rho), rho their
 * correlation from one to the next, from 0 to 0.9. */
double noise_memory(const noise *n);

#endif
