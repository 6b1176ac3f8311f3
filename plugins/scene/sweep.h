/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * sweep.h: which patch is seen where in a flat view of patches in space, exactly.
 *
 * A patch is a part of a plane, bounded by edges; a view is a projection that keeps straight lines
 * straight. A line that sweeps down the view stops at every end and every crossing of edges.
 * Between two stops the order of the edges along it is fixed, and so is, from edge to edge, the
 * patch that is nearest. What comes out are the pieces of edges that part two different patches, as
 * straight lines with the patch on either side. There is no raster and no tolerance in it beyond
 * rounding. (Plane sweep: Bentley and Ottmann 1979; visibility along a scan line: Watkins 1970.)
 */
#ifndef SWEEP_H
#define SWEEP_H

#include "arris_types.h"

/* What changes where one crosses an edge from its left to its right, with the edge pointing down:
 * the number of times that the patch covers the place, and that the light reaches its plane. */
typedef struct sweep_toggle {
    int32_t patch;
    int8_t in, lit;
} sweep_toggle;

/* A region is a patch where the light falls on it or does not; nothing is SWEEP_NOTHING. */
enum { SWEEP_NOTHING = -1 };
static inline int32_t sweep_region(int32_t patch, bool lit) {
    return 2 * patch + lit;
}

/* A straight piece from top to bottom, and the regions at its sides; left is where x is smaller. */
typedef struct sweep_piece {
    double x0, y0, x1, y1;
    int32_t left, right;
} sweep_piece;

typedef void sweep_emit(void *to, const sweep_piece *p);

typedef struct sweep sweep;

/* Room for so many points and edges, and patches of which plane_of tells the plane; plane_of must
 * outlive it. Patches of one plane cover each other by their number, the highest on top. NULL: no
 * memory. */
sweep *sweep_new(size_t points, size_t edges, const int32_t *plane_of, size_t patches,
                 size_t planes);
void sweep_free(sweep *w);

/* A new view: forgets all points and edges. */
void sweep_begin(sweep *w);

/* Adds a point, in the units of the view (finite), and returns its number. */
uint32_t sweep_point(sweep *w, double x, double y);

/* Adds the edge from point p to point q; its n toggles must stay until sweep_run has returned. What
 * is beyond the room is left out. */
void sweep_edge(sweep *w, uint32_t p, uint32_t q, const sweep_toggle *toggle, uint32_t n);

/* Emits the pieces within `window` (x0, y0, x1, y1); those left of it are moved onto its left
 * border, so that along every line all that changes before the window is there. depth[plane] is (a,
 * b, c): a x + b y + c is how near the plane is at (x, y), greater being nearer. `seen` and
 * `hidden`, when not NULL, are set to 1 for every plane of which something is seen, or is hidden by
 * another. Allocates nothing.
 */
void sweep_run(sweep *w, const double window[4], const double (*depth)[3], uint8_t *seen,
               uint8_t *hidden, sweep_emit *emit, void *to);

#endif
