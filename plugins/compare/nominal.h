/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * nominal.h: the nominal edges of a part, from a list of edges (.json, FORMATS: {"unit": "mm",
 * "lines": [{"id", "p", "q"}]}) or from a mesh (OBJ, STL, PLY, DXF...) by assimp. No dependency on
 * the runtime.
 *
 * The edges of a mesh are its boundary edges, those whose faces meet at more than the crease angle,
 * and the lines that it has of its own; collinear runs are joined.
 */
#ifndef NOMINAL_H
#define NOMINAL_H

#include "fault.h"

typedef struct nominal_edge {
    char id[64];
    double p[3], q[3]; /* the ends, mm */
    double normal[3];  /* unit, between the outward normals of its faces; zero: it has none */
    double tolerance;  /* mm; 0: that of the inspection */
    bool mark;         /* visible, but no edge of the part: paint, a decal; never judged */
} nominal_edge;

typedef struct nominal {
    uint32_t n_edges;
    nominal_edge *edge;
    uint32_t n_vertices, n_triangles; /* of a mesh, for what hides what */
    double (*vertex)[3];              /* mm */
    uint32_t (*triangle)[3];
} nominal;

enum { NOMINAL_MAX_FILE = 512 << 20, NOMINAL_MAX_EDGES = 20000 };

/* Reads a model. Edges shorter than `min_length` (mm) are left out; `crease` is in rad. For
 * nominal_free, also after an error. Returns 0, or ARRIS_E_INPUT (no model, not in mm, no edge in
 * it), _IO, _MEMORY. */
int nominal_read(nominal *m, const char *path, double crease, double min_length, fault *f);
void nominal_free(nominal *m);

/* In mesh.c: the edges of m's triangles, and of `lines` (pairs of vertices), n of them, which it
 * appends to m->edge. Returns 0 or ARRIS_E_INPUT (too many), _MEMORY. */
int mesh_edges(nominal *m, const uint32_t (*lines)[2], uint32_t n, double crease, double min_length,
               fault *f);

#endif
