/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * refit.h: the line of an edge from the grey levels, at the Cramér-Rao bound.
 */
#ifndef REFIT_H
#define REFIT_H

#include "rows.h"

typedef struct refit_start {
    row_line line;   /* as observed, brighter side on the right */
    double gradient; /* mean of the smoothed picture's across the line, levels per px */
    double noise;    /* sigma of one pixel, levels; 0: from what the fit leaves */
    bool whole;      /* the ends are the edge's own; else `edges` lost it there */
    double dx, dy;   /* px that it has moved in the picture since the edge points were found */
} refit_start;

typedef struct refitter refitter;

/* Room for lines in pictures of up to this size. NULL: no memory. */
refitter *refitter_new(int width, int height);
void refitter_free(refitter *f); /* NULL is allowed */

/* The picture of all lines until the next call; it must stay. The lens of `camera` maps the
 * coordinates of the edge points to the picture's; NULL: they are the same. Without `edges` those
 * of the call before tell what is beside the lines. */
void refitter_look(refitter *f, const arris_image *image, const arris_edges *edges,
                   const arris_camera *camera);

/* Likewise for the lines that follow. */
void refitter_set_lens(refitter *f, const arris_camera *camera);

/* Fits a blurred step to the rows (rows.h) of the line near that of `start`, which it moves there,
 * and fills *s but for `chain`; the ends are the feet of the observed ones. False when it cannot be
 * measured or is no step that stands out of the noise; then *s means nothing. */
bool refit(refitter *f, refit_start *start, arris_segment *s);

/* For tests: without what only some machines have. */
void refitter_portable(refitter *f);

#endif
