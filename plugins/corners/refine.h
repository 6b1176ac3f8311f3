/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * refine.h: a corner to sub-pixel.
 */
#ifndef REFINE_H
#define REFINE_H

#include "arris_types.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Moves the corner to where the edges around it meet. It stays as it is when they don't say where
 * that is, or say it is elsewhere. */
void refine_corner(const arris_image *im, arris_corner *c);

#ifdef __cplusplus
}
#endif
#endif
