/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * truth.c: an object's true edges, as points along them that are projected into a picture.
 */
#include "truth.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { MOST_EDGES = 1000, MOST_POINTS = 100000, BORDER = 4 /* px */ };

static const double spacing = 2; /* mm, of the points */

static double length(const truth_edge *e) {
    return hypot(hypot(e->q[0] - e->p[0], e->q[1] - e->p[1]), e->q[2] - e->p[2]);
}

/* ---- reading -------------------------------------------------------------------------------- */

static int read_edges(arris_stage *s, const char *path, FILE *f, truth *t) {
    char line[256];
    for (int number = 1; fgets(line, sizeof line, f); number++) {
        truth_edge e;
        if (number == 1)
            continue;
        if (t->n_edges == MOST_EDGES ||
            sscanf(line, "%*[^,],%lf,%lf,%lf,%lf,%lf,%lf", &e.p[0], &e.p[1], &e.p[2], &e.q[0],
                   &e.q[1], &e.q[2]) != 6 ||
            !(length(&e) < 1e5))
            return arris_fail(s, ARRIS_E_INPUT, "write id,x1,y1,z1,x2,y2,z2 in mm",
                              "%s: line %d is not one of at most %d edges", path, number,
                              MOST_EDGES);
        t->edge[t->n_edges++] = e;
    }
    return 0;
}

static void lay_points(truth *t, uint32_t edge) {
    const truth_edge *e = &t->edge[edge];
    int n = (int)(length(e) / spacing);
    for (int k = 0; k < n && t->n < MOST_POINTS; k++) {
        double at = (k + 0.5) / n;
        for (int i = 0; i < 3; i++)
            t->point[t->n][i] = e->p[i] + at * (e->q[i] - e->p[i]);
        t->edge_of[t->n++] = edge;
    }
}

int truth_read(arris_stage *s, const char *path, truth *t) {
    t->edge = calloc(MOST_EDGES, sizeof *t->edge);
    t->point = calloc(MOST_POINTS, sizeof *t->point);
    t->edge_of = calloc(MOST_POINTS, sizeof *t->edge_of);
    if (!t->edge || !t->point || !t->edge_of)
        return arris_fail(s, ARRIS_E_MEMORY, NULL, "no memory for the true edges");
    FILE *f = fopen(path, "r");
    if (!f)
        return arris_fail(s, ARRIS_E_IO, NULL, "cannot open the true edges %s", path);
    int e = read_edges(s, path, f, t);
    fclose(f);
    for (uint32_t i = 0; i < t->n_edges; i++)
        lay_points(t, i);
    return e;
}

void truth_free(truth *t) {
    free(t->edge);
    free(t->point);
    free(t->edge_of);
}

/* ---- projecting ----------------------------------------------------------------------------- */

static bool to_pixel(const arris_camera *c, const arris_pose *pose, const double X[3], double *x,
                     double *y) {
    double u, v;
    if (!(arris_project(c, pose, X, &u, &v) > 0))
        return false;
    arris_distort(c, u, v, x, y);
    return *x > BORDER && *y > BORDER && *x < c->width - 1 - BORDER && *y < c->height - 1 - BORDER;
}

void truth_project(const truth *t, const arris_camera *c, const arris_pose *pose,
                   truth_pixel *pixel) {
    for (uint32_t i = 0; i < t->n; i++) {
        const truth_edge *e = &t->edge[t->edge_of[i]];
        truth_pixel *px = &pixel[i];
        double X[3], x2 = 0, y2 = 0;
        for (int k = 0; k < 3; k++) /* a little further along */
            X[k] = t->point[i][k] + (e->q[k] - e->p[k]) / length(e);
        px->seen = pose->valid && to_pixel(c, pose, t->point[i], &px->x, &px->y) &&
                   to_pixel(c, pose, X, &x2, &y2);
        double n = hypot(x2 - px->x, y2 - px->y);
        px->nx = -(y2 - px->y) / n;
        px->ny = (x2 - px->x) / n;
    }
}

static int by_size(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

double median(double *v, size_t n) {
    qsort(v, n, sizeof *v, by_size);
    return n ? v[n / 2] : NAN;
}
