/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * view.c: the picture that a camera takes of a cell (view.h): projects the cell's points and
 * planes, lets the sweep find the borders that are seen, and draws them.
 */
#include "view.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "arris_geometry.h"

static const double NEAR = 1;       /* mm: what is nearer to the camera's centre is not seen */
static const double EDGE_ON = 1e-6; /* mm from the camera's centre: such a plane is not seen */
enum { NONE = UINT32_MAX };

struct view {
    const cell *c;
    arris_camera camera;
    view_light light;
    sweep *sweep;
    draw *draw;
    double (*X)[3]; /* the points in the camera's frame, mm */
    double (*depth)[3];
    bool *edge_on;    /* planes */
    uint32_t *corner; /* where the edges of a plane end that come too near, by plane */
    sweep_toggle *toggle;
    size_t n_toggles;
    float *level; /* grey level by region */
};

int view_new(view **made, const cell *c, const arris_camera *camera, double psf,
             const view_light *light, fault *f) {
    view *v = *made = calloc(1, sizeof *v);
    if (!v)
        return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for a view");
    v->c = c, v->camera = *camera, v->light = *light;
    /* an edge that comes too near ends there, and each of its toggles goes on from there */
    size_t edges = c->n_edges + c->n_toggles;
    v->sweep = sweep_new(c->n_points + c->n_edges, edges, c->plane_of, c->n_patches, c->n_planes);
    v->X = calloc(c->n_points, sizeof *v->X);
    v->depth = calloc(c->n_planes, sizeof *v->depth);
    v->edge_on = calloc(c->n_planes, sizeof *v->edge_on);
    v->corner = calloc(c->n_planes, sizeof *v->corner);
    v->toggle = calloc(c->n_toggles + 1, sizeof *v->toggle);
    v->level = calloc(2 * c->n_patches, sizeof *v->level);
    if (v->sweep && v->X && v->depth && v->edge_on && v->corner && v->toggle && v->level)
        return draw_new(&v->draw, camera, psf, f);
    return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for a view of %zu edges", edges);
}

void view_free(view *v) {
    if (!v)
        return;
    sweep_free(v->sweep);
    draw_free(v->draw);
    free(v->X), free(v->depth), free(v->edge_on), free(v->corner), free(v->toggle);
    free(v->level);
    free(v);
}

/* ---- what the camera sees of planes and points ----------------------------------------------- */

static void turn(const double R[9], const double a[3], double b[3]) {
    for (int k = 0; k < 3; k++)
        b[k] = arris_dot(R + 3 * k, a);
}

/* 1/z of a plane, affine in the pixel: n K^-1 (x, y, 1) / d in the camera's frame. */
static void see_planes(view *v, const arris_pose *pose) {
    const arris_camera *c = &v->camera;
    for (size_t i = 0; i < v->c->n_planes; i++) {
        const cell_plane *p = &v->c->plane[i];
        double n[3], d = p->d - arris_dot(p->n, pose->C), *k = v->depth[i];
        v->corner[i] = NONE;
        v->edge_on[i] = fabs(d) < EDGE_ON;
        if (v->edge_on[i])
            continue;
        turn(pose->R, p->n, n);
        k[0] = n[0] / c->fx / d;
        k[1] = (n[1] - n[0] * c->skew / c->fx) / c->fy / d;
        k[2] = n[2] / d - k[0] * c->cx - k[1] * c->cy;
    }
}

/* Lambert's law, for the side of the plane that the camera is on. */
static void shade(view *v, const arris_pose *pose) {
    for (size_t i = 0; i < v->c->n_patches; i++) {
        const cell_patch *k = &v->c->patch[i];
        const cell_plane *p = &v->c->plane[k->plane];
        double side = arris_dot(p->n, pose->C) - p->d;
        double direct = side * p->facing > 0 ? (1 - v->light.ambient) * fabs(p->facing) : 0;
        double dark = 255 * (double)k->grey * v->light.ambient;
        double bright = dark + 255 * (double)k->grey * direct;
        v->level[sweep_region((int32_t)i, false)] =
            (float)(p->light == CELL_BRIGHT ? bright : dark);
        v->level[sweep_region((int32_t)i, true)] = (float)bright;
    }
}

static uint32_t add_point(view *v, const double X[3]) {
    const arris_camera *c = &v->camera;
    double x = X[0] / X[2], y = X[1] / X[2];
    return sweep_point(v->sweep, c->fx * x + c->skew * y + c->cx, c->fy * y + c->cy);
}

/* Every point keeps its number; those too near are never used, and stand aside. */
static void see_points(view *v, const arris_pose *pose) {
    for (size_t i = 0; i < v->c->n_points; i++) {
        const double *P = v->c->point[i];
        double d[3] = {P[0] - pose->C[0], P[1] - pose->C[1], P[2] - pose->C[2]};
        turn(pose->R, d, v->X[i]);
        if (v->X[i][2] > NEAR)
            add_point(v, v->X[i]);
        else
            sweep_point(v->sweep, 0, 1e9);
    }
}

/* ---- edges ----------------------------------------------------------------------------------- */

/* The edge from p, which is seen, to q, which is too near, ends on the way; from there each plane's
 * edges go on to a corner that they have in common, so that its patches stay closed. `back`: the
 * edge really points from q to p. */
static void add_cut(view *v, uint32_t p, uint32_t q, bool back, const sweep_toggle *t, uint32_t n) {
    const double *P = v->X[p], *Q = v->X[q];
    double s = (P[2] - NEAR) / (P[2] - Q[2]), X[3];
    for (int k = 0; k < 3; k++)
        X[k] = P[k] + s * (Q[k] - P[k]);
    X[2] = NEAR;
    uint32_t end = add_point(v, X);
    sweep_edge(v->sweep, back ? end : p, back ? p : end, t, n);
    for (uint32_t i = 0; i < n; i++) {
        uint32_t *corner = &v->corner[v->c->plane_of[t[i].patch]];
        if (*corner == NONE)
            *corner = end;
        sweep_edge(v->sweep, back ? *corner : end, back ? end : *corner, &t[i], 1);
    }
}

static void add_edge(view *v, const cell_edge *e) {
    const cell *c = v->c;
    const sweep_toggle *t = v->toggle + v->n_toggles;
    uint32_t n = 0;
    bool p = v->X[e->p][2] > NEAR, q = v->X[e->q][2] > NEAR;
    if (!p && !q)
        return;
    for (uint32_t i = 0; i < e->n; i++)
        if (!v->edge_on[c->plane_of[c->toggle[e->first + i].patch]]) {
            v->toggle[v->n_toggles++] = c->toggle[e->first + i];
            n++;
        }
    if (n == 0 && e->n > 0)
        return;
    if (p && q)
        sweep_edge(v->sweep, e->p, e->q, t, n);
    else
        add_cut(v, p ? e->p : e->q, p ? e->q : e->p, q, t, n);
}

static void draw_border(void *to, const sweep_piece *p) {
    view *v = to;
    double left = p->left < 0 ? v->light.background : (double)v->level[p->left];
    double right = p->right < 0 ? v->light.background : (double)v->level[p->right];
    if (fabs(right - left) > 1e-9)
        draw_piece(v->draw, p->x0, p->y0, p->x1, p->y1, right - left);
}

void view_take(view *v, const arris_pose *pose, double noise, uint64_t seed,
               const arris_image *out) {
    see_planes(v, pose);
    shade(v, pose);
    sweep_begin(v->sweep);
    see_points(v, pose);
    v->n_toggles = 0;
    for (size_t i = 0; i < v->c->n_edges; i++)
        add_edge(v, &v->c->edge[i]);
    draw_clear(v->draw);
    sweep_run(v->sweep, draw_window(v->draw), (const double(*)[3])v->depth, NULL, NULL, draw_border,
              v);
    draw_finish(v->draw, v->light.background, noise, seed, out);
}
