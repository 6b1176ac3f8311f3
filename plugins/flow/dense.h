/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * dense.h: dense optical flow from picture to picture.
 */
#ifndef DENSE_H
#define DENSE_H

#include "arris_types.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct dense dense;

/* For pictures of one size and format, whatever these are. NULL: no memory. */
dense *dense_new(void);
void dense_free(dense *d); /* NULL is allowed */

/* How far every pixel of the picture before has come in `in`: fills u and v of `out`, which has the
 * same size, and keeps `in` for the next call. The first call has no flow: all is 0, and not
 * `valid`. Returns 0 or ARRIS_E_INTERNAL (OpenCV failed). */
int dense_run(dense *d, const arris_image *in, arris_flow *out);

#ifdef __cplusplus
}
#endif
#endif
