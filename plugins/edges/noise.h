/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * noise.h: the noise of a picture.
 */
#ifndef NOISE_H
#define NOISE_H

#include "arris_types.h"

/* Both give the standard deviation of one pixel's noise in grey levels, rounding to whole levels
 * included; 0 for a picture without noise, and for one that is too small to tell. `white` is the
 * level of a saturated pixel. */

/* From neighbouring pixels. */
float noise_of_pixels(const arris_image *im, int white);

/* As the gradient after a Gaussian of `sigma` px sees it: independent noise of this size would give
 * gradients as noisy as those found. More than the above where noise was smeared over pixels, by
 * demosaicing, scaling or JPEG. */
float noise_of_gradients(const arris_image *im, int white, double sigma);

#endif
