/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * canny.h: Canny's edges (thesis, section 2.3) as linked sub-pixel chains. No runtime in here:
 * tests, benches and other kernels call it as it stands.
 *
 *     canny_params p = CANNY_DEFAULTS;
 *     canny *c = canny_new(width, height, &p);
 *     canny_run(c, &image, &edges);       // nothing is allocated
 *     canny_free(c);
 */
#ifndef CANNY_H
#define CANNY_H

#include "arris_types.h"
#include "path.h"

typedef struct canny canny;

typedef struct canny_params {
    double sigma;       /* of the Gaussian, px, 0 to 5; 0: none */
    double low, high;   /* of the gradient, grey levels per px; -1: from the picture's noise */
    int32_t min_length; /* points of a chain */
    int32_t x, y, width, height; /* the region of interest, px; width 0: the whole picture */
} canny_params;

#define CANNY_DEFAULTS                                                                             \
    { 1, -1, -1, 10, 0, 0, 0, 0 }

/* How many points and chains an edges layer should hold for a picture of this size. */
size_t canny_max_points(int width, int height);
size_t canny_max_chains(int width, int height);

/* Sets the region from "x,y,width,height"; false when it is none of a picture of that size. */
bool canny_set_roi(canny_params *p, const char *text, int width, int height);

/* Reserves all that pictures of up to this size (1 to 8192 px a side) need. NULL: no memory. */
canny *canny_new(int width, int height, const canny_params *p);
void canny_free(canny *c); /* NULL is allowed */

/* For tests: takes another path than the fastest; false when this machine hasn't got it. */
bool canny_set_path(canny *c, enum path path);

/* The chains of `im`, whose size is at most that of canny_new, into `out`, whose arrays and
 * capacities the caller has set; the rest of `out` is overwritten. The region of interest is
 * treated as a picture of its own: what is outside of it has no influence. Points whose filter
 * support leaves the picture are not reported. */
void canny_run(canny *c, const arris_image *im, arris_edges *out);

/* No chains, but the noise: of a picture that is not to be searched. */
void canny_skip(canny *c, const arris_image *im, arris_edges *out);

/* The step, in grey levels, whose gradient behind a common lens is at the lower threshold in the
 * last picture. */
float canny_least_step(const canny *c);

#endif
