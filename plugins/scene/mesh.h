/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * mesh.h: the triangles of an OBJ or STL file, through assimp. The file is not trusted.
 */
#ifndef MESH_H
#define MESH_H

#include "fault.h"

enum { MESH_MAX_FILE = 64 << 20 /* bytes */, MESH_MAX_TRIANGLES = 20000 };

/* The greatest coordinate, mm. Single precision, which assimp has, is then 0.004 mm at worst. */
#define MESH_MAX_SIZE 1e5

typedef struct mesh_triangle {
    uint32_t v[3]; /* points */
    float grey;    /* of its material's diffuse colour (Rec. 601 luma), 0 to 1 */
} mesh_triangle;

typedef struct mesh {
    size_t n_points, n_triangles;
    double (*point)[3];      /* mm; no two are the same */
    mesh_triangle *triangle; /* in the order of the file; none without area */
    size_t flat;             /* faces that were left out since they have no area */
} mesh;

/* Loads `path`, which ends in .obj or .stl. mesh_free must follow in any case. Returns 0, or
 * ARRIS_E_INPUT (no such file, another kind, damaged, empty, too big, a coordinate that is not
 * finite), _IO or _MEMORY. */
int mesh_load(mesh *m, const char *path, fault *f);
void mesh_free(mesh *m);

#endif
