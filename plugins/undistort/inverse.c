/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * inverse.c: the inverse of the lens model as a grid of displacements, interpolated by Lagrange's
 * cubic in x and y.
 *
 * The error falls with the fourth power of the grid's pitch: at 4 px it is below 1e-5 px for common
 * lenses. Every cell is tried at its middle, where the error is greatest; where the table isn't
 * good enough (beside the fold of an extreme lens) points go through arris_undistort instead.
 */
#include "inverse.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "arris_geometry.h"

enum { PITCH = 4 };                   /* px from node to node */
static const double TOLERANCE = 1e-4; /* px */

typedef struct displacement {
    float x, y; /* ideal minus distorted, px */
} displacement;

typedef float v4 __attribute__((vector_size(16)));

struct inverse {
    arris_camera camera;
    int columns, rows; /* nodes; node (0, 0) lies at pixel (-PITCH, -PITCH) */
    displacement *node;
    bool *exact; /* by cell: take arris_undistort; cell (i, j) follows node (i + 1, j + 1) */
};

/* Lagrange's cubic through the 4 x 4 nodes of a cell, at (tx, ty) of it: the four rows first, each
 * (x, y) pairs of four nodes, then the four columns. */
static displacement interpolate(const inverse *inv, int i, int j, float tx, float ty) {
    const v4 b = {tx, tx, ty, ty}, a = b + 1, c = b - 1, d = b - 2;
    const v4 w[4] = {b * c * d * (-1 / 6.F), a * c * d * (1 / 2.F), a * b * d * (-1 / 2.F),
                     a * b * c * (1 / 6.F)};
    v4 left = {0}, right = {0};
    for (int row = 0; row < 4; row++) {
        v4 n[2];
        memcpy(n, &inv->node[(size_t)(j + row) * inv->columns + i], sizeof n);
        left += n[0] * w[row][2];
        right += n[1] * w[row][2];
    }
    left *= (v4){w[0][0], w[0][0], w[1][0], w[1][0]};
    right *= (v4){w[2][0], w[2][0], w[3][0], w[3][0]};
    left += right;
    return (displacement){left[0] + left[2], left[1] + left[3]};
}

static void fill_nodes(inverse *inv) {
    for (int j = 0; j < inv->rows; j++)
        for (int i = 0; i < inv->columns; i++) {
            double u = PITCH * (i - 1), v = PITCH * (j - 1), x, y;
            bool there = arris_undistort(&inv->camera, u, v, &x, &y) == 0;
            inv->node[j * inv->columns + i] = (displacement){
                there ? (float)(x - u) : NAN,
                there ? (float)(y - v) : NAN,
            };
        }
}

/* The cells whose table is not good enough. */
static void try_cells(inverse *inv) {
    for (int j = 0; j < inv->rows - 3; j++)
        for (int i = 0; i < inv->columns - 3; i++) {
            double u = PITCH * (i + 0.5), v = PITCH * (j + 0.5), x, y;
            displacement d = interpolate(inv, i, j, 0.5F, 0.5F);
            bool there = arris_undistort(&inv->camera, u, v, &x, &y) == 0;
            inv->exact[j * inv->columns + i] =
                !(there && hypot(u + (double)d.x - x, v + (double)d.y - y) < TOLERANCE);
        }
}

inverse *inverse_new(const arris_camera *camera) {
    inverse *inv = calloc(1, sizeof *inv);
    if (!inv)
        return NULL;
    inv->camera = *camera;
    inv->columns = (camera->width - 1) / PITCH + 4; /* a cell has a node more on either side */
    inv->rows = (camera->height - 1) / PITCH + 4;
    size_t n = (size_t)inv->columns * inv->rows;
    inv->node = malloc(n * sizeof *inv->node);
    inv->exact = calloc(n, sizeof *inv->exact);
    if (!inv->node || !inv->exact) {
        inverse_free(inv);
        return NULL;
    }
    fill_nodes(inv);
    try_cells(inv);
    return inv;
}

void inverse_free(inverse *inv) {
    if (!inv)
        return;
    free(inv->node);
    free(inv->exact);
    free(inv);
}

static bool undistort_exactly(const inverse *inv, float *x, float *y) {
    double ideal_x, ideal_y;
    if (arris_undistort(&inv->camera, (double)*x, (double)*y, &ideal_x, &ideal_y))
        return false;
    *x = (float)ideal_x;
    *y = (float)ideal_y;
    return true;
}

bool inverse_point(const inverse *inv, float *x, float *y) {
    const arris_camera *c = &inv->camera;
    if (!(*x >= 0 && *y >= 0 && *x <= (float)(c->width - 1) && *y <= (float)(c->height - 1)))
        return undistort_exactly(inv, x, y);
    int i = (int)*x / PITCH, j = (int)*y / PITCH;
    if (inv->exact[j * inv->columns + i])
        return undistort_exactly(inv, x, y);
    displacement d =
        interpolate(inv, i, j, *x * (1.F / PITCH) - (float)i, *y * (1.F / PITCH) - (float)j);
    *x += d.x;
    *y += d.y;
    return true;
}

/* Closes the chain whose points start at `first`; one that doesn't fit is lost. */
static void end_chain(arris_edges *out, uint32_t first, bool closed) {
    uint32_t n = out->n - first;
    if (n && out->n_chains < out->max_chains) {
        out->chain[out->n_chains++] = (arris_chain){first, n, closed};
    } else if (n) {
        out->lost_chains++;
        out->lost += n;
        out->n = first;
    }
}

static uint32_t undistort_chain(const inverse *inv, const arris_edges *in, const arris_chain *c,
                                arris_edges *out) {
    uint32_t first = out->n, dropped = 0, lost = 0;
    for (uint32_t i = 0; i < c->n; i++) {
        arris_edge_point p = in->point[c->first + i];
        if (!inverse_point(inv, &p.x, &p.y)) {
            dropped++;
            end_chain(out, first, false);
            first = out->n;
        } else if (out->n < out->max) {
            out->point[out->n++] = p;
        } else {
            lost++;
        }
    }
    end_chain(out, first, c->closed && !dropped && !lost);
    out->lost += lost;
    return dropped;
}

uint32_t inverse_edges(const inverse *inv, const arris_edges *in, const arris_camera *ideal,
                       arris_edges *out) {
    uint32_t dropped = 0;
    out->n = out->n_chains = 0;
    out->lost = in->lost;
    out->lost_chains = in->lost_chains;
    out->noise = in->noise;
    out->camera = ideal;
    for (uint32_t i = 0; i < in->n_chains; i++)
        dropped += undistort_chain(inv, in, &in->chain[i], out);
    return dropped;
}
