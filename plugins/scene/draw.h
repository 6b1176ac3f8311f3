/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * draw.h: a picture of regions of even grey, through a lens, from the pieces of their borders.
 *
 * Along a row the grey level changes at borders only, so a picture is the sum along x of what each
 * bit of border changes there: jump times dy (Green's theorem; exact area coverage). Each bit is
 * laid down as B-splines at its place in the lens's picture, to a fraction of a pixel, and a
 * Gaussian after the sum brings the blur up to that of lens and pixel: the edge's profile is the
 * same wherever it lies between pixels. Nothing in it knows of edges that were not given to it.
 */
#ifndef DRAW_H
#define DRAW_H

#include "fault.h"

typedef struct draw draw;

/* The least blur, sigma in px: the splines have it already. */
#define DRAW_MIN_PSF 0.41

/* `psf` is the sigma of the lens's blur, px, at least DRAW_MIN_PSF; the pixel's own (a box) comes
 * to it. `camera` is copied. Returns 0, or ARRIS_E_INPUT (its model folds back within the picture)
 * or ARRIS_E_MEMORY. */
int draw_new(draw **made, const arris_camera *camera, double psf, fault *f);
void draw_free(draw *d);

/* The part of the plane of ideal pixels that the picture needs: x0, y0, x1, y1. */
const double *draw_window(const draw *d);

void draw_clear(draw *d);

/* A piece of border from (x0, y0) to (x1, y1), in ideal pixels. What is left of the window must
 * have been moved onto its left border, what is right of it may be missing. `jump` is the grey
 * level at its greater x less that at its smaller x when y1 > y0, and the opposite when y1 < y0. */
void draw_piece(draw *d, double x0, double y0, double x1, double y1, double jump);

/* The picture: `background` where there is no region, noise of sigma `noise` (grey levels), rounded
 * and clipped. The noise follows from `seed` alone. */
void draw_finish(draw *d, double background, double noise, uint64_t seed, const arris_image *out);

#endif
