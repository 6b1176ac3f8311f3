/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * inverse.h: the lens undone at a few nanoseconds a point.
 */
#ifndef INVERSE_H
#define INVERSE_H

#include "arris_types.h"

typedef struct inverse inverse;

/* Prepares the inverse of `camera`, whose picture is at most 8192 px a side. NULL: no memory. */
inverse *inverse_new(const arris_camera *camera);
void inverse_free(inverse *inv); /* NULL is allowed */

/* Moves a point of the lens's picture to where an ideal camera sees it, to 1e-4 px. Returns false
 * when the lens model has no inverse there; then the point is not moved. Allocates nothing. */
bool inverse_point(const inverse *inv, float *x, float *y);

/* The chains of `in` undistorted into `out`, whose arrays and capacities the caller has set; the
 * rest of `out` is overwritten, its camera is `ideal`. A point without an inverse is dropped and
 * its chain split there. Returns how many were dropped. */
uint32_t inverse_edges(const inverse *inv, const arris_edges *in, const arris_camera *ideal,
                       arris_edges *out);

#endif
