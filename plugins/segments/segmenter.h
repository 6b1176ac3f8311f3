/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * segmenter.h: straight segments of linked edge points. No runtime in here: tests and benches call
 * it as it stands.
 *
 *     segmenter_params p = SEGMENTER_DEFAULTS;
 *     segmenter *s = segmenter_new(width, height, max_points, &p);
 *     segmenter_run(s, &edges, &image, &segments);        // nothing is allocated
 *     segmenter_free(s);
 */
#ifndef SEGMENTER_H
#define SEGMENTER_H

#include "arris_types.h"

typedef struct segmenter segmenter;

enum { SEGMENTER_REFIT, SEGMENTER_THESIS };

typedef struct segmenter_params {
    double tol;        /* px that a chain may deviate from a segment's chord */
    double angtol;     /* rad, and */
    double linkrad;    /* px, by which segments that are joined may be apart */
    double min_length; /* px */
    int32_t mode;
} segmenter_params;

#define SEGMENTER_DEFAULTS                                                                         \
    { 2, 0.05, 2, 15, SEGMENTER_REFIT }

/* How many segments a layer should hold for a picture of this size. */
size_t segmenter_max(int width, int height);

/* Reserves all that pictures of up to this size need. NULL: no memory. */
segmenter *segmenter_new(int width, int height, const segmenter_params *p);
void segmenter_free(segmenter *s); /* NULL is allowed */

/* For tests: leaves out what only some machines have. */
void segmenter_portable(segmenter *s);

/* The next run is of this frame, and looks in the picture for these lines only; NULL or none: its
 * edges are given. */
void segmenter_guide(segmenter *s, const arris_guide *guide, uint64_t frame);

/* The segments of `edges` into `out`, whose array and capacity the caller has set; the rest of
 * `out` is overwritten. `image` is what the edges are from, of a size that segmenter_new knew, or
 * NULL: without it, and when it has been seen through another lens than the edges can be led back
 * to, the lines are those through the edge points, and levels, blur and chi2 are 0. */
void segmenter_run(segmenter *s, const arris_edges *edges, const arris_image *image,
                   arris_segments *out);

#endif
