/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * light.c: where parallel light falls, and the edges of the shadows that it casts (cell.h).
 *
 * What the light reaches is what one would see against it: the same sweep, along the light, finds
 * the borders. Each is laid back onto the planes at its two sides, where the lit part begins or
 * ends.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "arris_geometry.h"
#include "cell.h"

static const double GRAZING = 1e-4; /* cosine below which light on a plane counts for nothing */

struct light {
    cell *c;
    double u[3], v[3], l[3]; /* across the light, and along it; unit */
    double (*depth)[3];
    uint8_t *seen, *hidden;
    sweep_piece *piece; /* the borders, to be laid onto the planes when it is known which need it */
    size_t n_pieces, max_pieces;
    int error;
};

static void keep(void *to, const sweep_piece *p) {
    struct light *g = to;
    if (g->n_pieces == g->max_pieces) {
        size_t more = 2 * g->max_pieces + 256;
        sweep_piece *bigger = realloc(g->piece, more * sizeof *bigger);
        if (!bigger) {
            g->error = ARRIS_E_MEMORY;
            return;
        }
        g->piece = bigger;
        g->max_pieces = more;
    }
    g->piece[g->n_pieces++] = *p;
}

static void make_axes(struct light *g, const double direction[3]) {
    memcpy(g->l, direction, sizeof g->l);
    arris_unit(g->l);
    double least[3] = {0, 0, 0};
    int k = fabs(g->l[0]) < fabs(g->l[1]) ? 0 : 1;
    least[fabs(g->l[2]) < fabs(g->l[k]) ? 2 : k] = 1;
    arris_cross(least, g->l, g->u);
    arris_unit(g->u);
    arris_cross(g->l, g->u, g->v);
}

/* How near a plane is to the light at (u, v): the negative way along it, affine in both. */
static void find_depths(struct light *g) {
    for (size_t i = 0; i < g->c->n_planes; i++) {
        cell_plane *p = &g->c->plane[i];
        p->facing = -arris_dot(p->n, g->l);
        if (fabs(p->facing) < GRAZING)
            continue;
        g->depth[i][0] = -arris_dot(p->n, g->u) / p->facing;
        g->depth[i][1] = -arris_dot(p->n, g->v) / p->facing;
        g->depth[i][2] = p->d / p->facing;
    }
}

/* All points, and those edges and toggles that belong to planes which the light does not graze. */
static void fill(struct light *g, sweep *w, double window[4], sweep_toggle *toggle) {
    const cell *c = g->c;
    window[0] = window[1] = INFINITY, window[2] = window[3] = -INFINITY;
    for (size_t i = 0; i < c->n_points; i++) {
        double x = arris_dot(g->u, c->point[i]), y = arris_dot(g->v, c->point[i]);
        sweep_point(w, x, y);
        window[0] = fmin(window[0], x - 1), window[1] = fmin(window[1], y - 1);
        window[2] = fmax(window[2], x + 1), window[3] = fmax(window[3], y + 1);
    }
    for (size_t i = 0; i < c->n_edges; i++) {
        const cell_edge *e = &c->edge[i];
        sweep_toggle *first = toggle;
        for (uint32_t k = 0; k < e->n; k++)
            if (fabs(c->plane[c->plane_of[c->toggle[e->first + k].patch]].facing) >= GRAZING)
                *toggle++ = c->toggle[e->first + k];
        sweep_edge(w, e->p, e->q, first, (uint32_t)(toggle - first));
    }
}

/* Lays an end of a border back onto a plane. */
static void lay_back(const struct light *g, int32_t plane, double x, double y, double X[3]) {
    const double *d = g->depth[plane];
    double along = -(d[0] * x + d[1] * y + d[2]);
    for (int k = 0; k < 3; k++)
        X[k] = x * g->u[k] + y * g->v[k] + along * g->l[k];
}

/* The lit part of the region's plane begins (lit = 1) or ends (-1) to the right of the piece. */
static int add_border(struct light *g, const sweep_piece *p, int32_t region, int lit) {
    if (region == SWEEP_NOTHING)
        return 0;
    sweep_toggle t = {.patch = region / 2, .lit = (int8_t)lit};
    int32_t plane = g->c->plane_of[t.patch];
    if (g->c->plane[plane].light != CELL_PARTLY)
        return 0;
    double P[3], Q[3];
    lay_back(g, plane, p->x0, p->y0, P);
    lay_back(g, plane, p->x1, p->y1, Q);
    return cell_add_edge(g->c, P, Q, &t, 1);
}

static int add_borders(struct light *g) {
    const cell *c = g->c;
    int r = 0;
    for (size_t i = 0; i < c->n_planes; i++)
        c->plane[i].light = !g->seen[i] ? CELL_DARK : g->hidden[i] ? CELL_PARTLY : CELL_BRIGHT;
    for (size_t i = 0; r == 0 && i < g->n_pieces; i++) {
        const sweep_piece *p = &g->piece[i];
        if (p->left >= 0 && p->right >= 0 && c->plane_of[p->left / 2] == c->plane_of[p->right / 2])
            continue;
        r = add_border(g, p, p->left, -1);
        if (r == 0)
            r = add_border(g, p, p->right, 1);
    }
    return r;
}

int cell_light_up(cell *c, const double direction[3], fault *f) {
    struct light g = {.c = c};
    double window[4];
    sweep *w = sweep_new(c->n_points, c->n_edges, c->plane_of, c->n_patches, c->n_planes);
    sweep_toggle *toggle = calloc(c->n_toggles + 1, sizeof *toggle);
    g.depth = calloc(c->n_planes, sizeof *g.depth);
    g.seen = calloc(c->n_planes, 1);
    g.hidden = calloc(c->n_planes, 1);
    if (w && toggle && g.depth && g.seen && g.hidden) {
        make_axes(&g, direction);
        find_depths(&g);
        fill(&g, w, window, toggle);
        sweep_run(w, window, (const double(*)[3])g.depth, g.seen, g.hidden, keep, &g);
        if (g.error == 0)
            g.error = add_borders(&g);
    } else {
        g.error = ARRIS_E_MEMORY;
    }
    sweep_free(w);
    free(toggle), free(g.depth), free(g.seen), free(g.hidden), free(g.piece);
    return cell_fault(g.error, f);
}
