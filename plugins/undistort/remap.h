/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * remap.h: a picture resampled as an ideal camera would have taken it.
 */
#ifndef REMAP_H
#define REMAP_H

#include "arris_types.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct remap remap;

/* Computes where every pixel of the ideal picture lies in that of `camera`. NULL: no memory. */
remap *remap_new(const arris_camera *camera);
void remap_free(remap *r); /* NULL is allowed */

/* Resamples `in` into `out`; both have the camera's size and the same format. What the lens didn't
 * see repeats its picture's border. Returns 0 or ARRIS_E_INTERNAL (OpenCV failed). */
int remap_image(const remap *r, const arris_image *in, arris_image *out);

#ifdef __cplusplus
}
#endif
#endif
