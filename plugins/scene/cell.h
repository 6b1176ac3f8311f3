/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * cell.h: a scene as a sweep wants it: planes, patches, edges; and where the light falls.
 *
 * A patch is all that lies in one plane and has one grey level, a plane what several patches have
 * in common. Of patches in one plane the one that comes later in the file lies on top, as paint
 * does.
 */
#ifndef CELL_H
#define CELL_H

#include "mesh.h"
#include "sweep.h"

enum cell_light { CELL_DARK, CELL_BRIGHT, CELL_PARTLY };

typedef struct cell_plane {
    double n[3], d; /* n X = d, n of unit length */
    double facing;  /* cosine of the angle at which light falls on it, > 0: on the side of n */
    enum cell_light light;
} cell_plane;

typedef struct cell_patch {
    int32_t plane;
    float grey; /* 0 to 1 */
} cell_patch;

typedef struct cell_edge {
    uint32_t p, q;     /* points */
    uint32_t first, n; /* toggles */
} cell_edge;

typedef struct cell {
    size_t n_points, n_planes, n_patches, n_edges, n_toggles;
    size_t max_points, max_edges, max_toggles;
    double (*point)[3]; /* mm */
    cell_plane *plane;
    cell_patch *patch;
    int32_t *plane_of; /* by patch, for the sweep */
    cell_edge *edge;
    sweep_toggle *toggle;
} cell;

enum { CELL_MAX_EDGES = 100000 };

/* Builds the patches and edges of a mesh. Where faces run into each other an edge is put. cell_free
 * must follow in any case. Returns 0, ARRIS_E_INPUT (more than CELL_MAX_EDGES) or ARRIS_E_MEMORY.
 */
int cell_build(cell *c, const mesh *m, fault *f);
void cell_free(cell *c);

/* Lets parallel light fall in along `direction` (not zero), and adds the edges of the shadows.
 * Once. Returns as cell_build does. */
int cell_light_up(cell *c, const double direction[3], fault *f);

/* Adds an edge between two points, with its toggles; cell_fault says what its error means. */
int cell_add_edge(cell *c, const double P[3], const double Q[3], const sweep_toggle *toggle,
                  uint32_t n);
int cell_fault(int code, fault *f);

#endif
