/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * truth.h: an object's true edges, as points along them that are projected into a picture.
 */
#ifndef TRUTH_H
#define TRUTH_H

#include "arris_plugin.h"

typedef struct truth_edge {
    double p[3], q[3]; /* mm */
} truth_edge;

typedef struct truth {
    uint32_t n_edges, n;
    truth_edge *edge;
    double (*point)[3]; /* n points on the edges, every 2 mm */
    uint32_t *edge_of;  /* the edge that a point is on */
} truth;

/* A point as a picture shows it, and the normal of its edge there. */
typedef struct truth_pixel {
    double x, y, nx, ny; /* px */
    bool seen;           /* false: it is not in the picture, or too near its border */
} truth_pixel;

/* Reads `id,x1,y1,z1,x2,y2,z2` in mm, one visible edge a line after the header. Returns 0 or an
 * error of the stage `s`; then too truth_free releases what there is. */
int truth_read(arris_stage *s, const char *path, truth *t);
void truth_free(truth *t);

/* Projects all points, through the lens when `c` has one, into `pixel`, which holds t->n. */
void truth_project(const truth *t, const arris_camera *c, const arris_pose *pose,
                   truth_pixel *pixel);

/* The median of n values, which it sorts; NAN of none. */
double median(double *v, size_t n);

#endif
