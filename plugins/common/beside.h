/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * beside.h: what lies beside a line's edge, from its views, and by how much it moves each of them.
 *
 * A face that is seen almost from its edge is a band too narrow to be resolved. It moves the edge
 * by up to a tenth of a pixel, and by what changes with the view, so that it passes for depth and
 * no residual tells of it. But what is on one side of a step, whatever it is, lies under one tail
 * of the blur: it moves the step and changes its blur together, by about the same, towards that
 * side where it widens it. An edge's blur is the same in all its views. So by how much that of a
 * view differs from the others' tells how far the view is off, once it is known which side it comes
 * from: there what is no part of a step changes from view to view, too.
 */
#ifndef BESIDE_H
#define BESIDE_H

#include <stdbool.h>
#include <stdint.h>

/* A view, as of its segment; all run the same way along the edge. */
typedef struct beside_view {
    double blur;     /* px; 0: unknown */
    double other[2]; /* what is on its left and on its right that is no part of a step, sigma */
    bool counts;     /* for the others */
} beside_view;

/* Where a view is moved to: `px` to its right; `variance`, px², of that adds to its offset's,
 * `share` of which is systematic. */
typedef struct beside_move {
    double px, variance, share;
} beside_move;

/* The mean blur of an edge, in the order of its n views, that nothing beside it moves, px; *weight
 * is 0 when something does, or when too few views tell. */
double beside_blur(const beside_view *v, uint32_t n, double *weight);

/* By how much each view is moved, when something evidently does; else false. `usual`: blur of the
 * edges that nothing moves, px; 0: there are none. */
bool beside_find(const beside_view *v, uint32_t n, double usual, beside_move *move);

#endif
