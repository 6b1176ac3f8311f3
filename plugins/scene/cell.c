/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * cell.c: planes, patches and edges of a mesh (cell.h).
 */
#include "cell.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "arris_geometry.h"

/* ---- growing arrays -------------------------------------------------------------------------- */

static bool grow(void *array, size_t *max, size_t n, size_t size) {
    void **a = array;
    if (n <= *max)
        return true;
    size_t more = 2 * n + 64;
    void *bigger = realloc(*a, more * size);
    if (!bigger)
        return false;
    *a = bigger;
    *max = more;
    return true;
}

static int64_t add_point(cell *c, const double X[3]) {
    if (!grow(&c->point, &c->max_points, c->n_points + 1, sizeof *c->point))
        return ARRIS_E_MEMORY;
    memcpy(c->point[c->n_points], X, sizeof *c->point);
    return (int64_t)c->n_points++;
}

static int join(cell *c, uint32_t p, uint32_t q, const sweep_toggle *toggle, uint32_t n) {
    if (c->n_edges == CELL_MAX_EDGES)
        return ARRIS_E_INPUT;
    if (!grow(&c->edge, &c->max_edges, c->n_edges + 1, sizeof *c->edge) ||
        !grow(&c->toggle, &c->max_toggles, c->n_toggles + n, sizeof *c->toggle))
        return ARRIS_E_MEMORY;
    c->edge[c->n_edges++] = (cell_edge){p, q, (uint32_t)c->n_toggles, n};
    for (uint32_t i = 0; i < n; i++)
        c->toggle[c->n_toggles++] = toggle[i];
    return 0;
}

int cell_add_edge(cell *c, const double P[3], const double Q[3], const sweep_toggle *toggle,
                  uint32_t n) {
    int64_t p = add_point(c, P), q = add_point(c, Q);
    return p < 0 || q < 0 ? ARRIS_E_MEMORY : join(c, (uint32_t)p, (uint32_t)q, toggle, n);
}

int cell_fault(int code, fault *f) {
    if (code == ARRIS_E_INPUT)
        return fault_set(f, code, "leave out what the camera does not see",
                         "the scene has more than %d edges, with those of shadows and of faces "
                         "that run into each other",
                         CELL_MAX_EDGES);
    return code < 0 ? fault_set(f, code, NULL, "no memory for the scene") : 0;
}

/* ---- planes ---------------------------------------------------------------------------------- */

/* A triangle while the cell is being built. */
typedef struct face {
    uint32_t v[3];
    uint32_t file; /* where it comes in the file */
    float grey;
    double n[3], area;
    double low[3], high[3];
    int32_t plane, patch;
} face;

static double off(const cell_plane *p, const double X[3]) {
    return arris_dot(p->n, X) - p->d;
}

static void measure(face *k, const cell *c) {
    const double *a = c->point[k->v[0]];
    double u[3], v[3];
    for (int i = 0; i < 3; i++) {
        u[i] = c->point[k->v[1]][i] - a[i];
        v[i] = c->point[k->v[2]][i] - a[i];
        k->low[i] = a[i] + fmin(0, fmin(u[i], v[i]));
        k->high[i] = a[i] + fmax(0, fmax(u[i], v[i]));
    }
    arris_cross(u, v, k->n);
    k->area = arris_unit(k->n);
}

static bool lies_in(const face *k, const cell *c, const cell_plane *p, double tolerance) {
    if (fabs(arris_dot(k->n, p->n)) < 0.9999)
        return false;
    for (int i = 0; i < 3; i++)
        if (fabs(off(p, c->point[k->v[i]])) > tolerance)
            return false;
    return true;
}

static int by_area(const void *a, const void *b) {
    const face *p = a, *q = b;
    return p->area != q->area ? (p->area < q->area) - (p->area > q->area)
                              : (p->file > q->file) - (p->file < q->file);
}

static int by_file(const void *a, const void *b) {
    const face *p = a, *q = b;
    return (p->file > q->file) - (p->file < q->file);
}

/* The greatest triangle of a plane says exactly where it is. */
static void find_planes(cell *c, face *all, size_t n, double tolerance) {
    qsort(all, n, sizeof *all, by_area);
    for (size_t i = 0; i < n; i++) {
        face *k = &all[i];
        size_t j = 0;
        while (j < c->n_planes && !lies_in(k, c, &c->plane[j], tolerance))
            j++;
        if (j == c->n_planes) {
            cell_plane p = {.d = arris_dot(k->n, c->point[k->v[0]])};
            memcpy(p.n, k->n, sizeof p.n);
            c->plane[c->n_planes++] = p;
        }
        k->plane = (int32_t)j;
    }
    qsort(all, n, sizeof *all, by_file);
}

static void find_patches(cell *c, face *all, size_t n) {
    for (size_t i = 0; i < n; i++) {
        size_t j = 0;
        while (j < c->n_patches &&
               (c->patch[j].plane != all[i].plane || c->patch[j].grey != all[i].grey))
            j++;
        if (j == c->n_patches)
            c->patch[c->n_patches++] = (cell_patch){all[i].plane, all[i].grey};
        c->plane_of[j] = all[i].plane;
        all[i].patch = (int32_t)j;
    }
}

/* ---- edges ----------------------------------------------------------------------------------- */

typedef struct side {
    uint32_t p, q; /* p < q */
    sweep_toggle t;
} side;

static int by_edge(const void *a, const void *b) {
    const side *s = a, *t = b;
    if (s->p != t->p)
        return s->p < t->p ? -1 : 1;
    if (s->q != t->q)
        return s->q < t->q ? -1 : 1;
    return (s->t.patch > t->t.patch) - (s->t.patch < t->t.patch);
}

static void add_sides(side *s, const cell *c, const face *k) {
    int turn = arris_dot(k->n, c->plane[k->plane].n) > 0 ? 1 : -1;
    for (int i = 0; i < 3; i++) {
        uint32_t p = k->v[i], q = k->v[(i + 1) % 3];
        int w = p < q ? turn : -turn;
        s[i] = (side){p < q ? p : q, p < q ? q : p, {k->patch, (int8_t)w, 0}};
    }
}

/* One edge for all sides from p to q; where a patch goes on across, its sides cancel. */
static int join_sides(cell *c, const side *s, size_t n) {
    sweep_toggle t[32];
    uint32_t m = 0;
    for (size_t i = 0; i < n && m < 32; i++) {
        if (m == 0 || t[m - 1].patch != s[i].t.patch)
            t[m++] = (sweep_toggle){.patch = s[i].t.patch};
        t[m - 1].in = (int8_t)(t[m - 1].in + s[i].t.in);
        if (t[m - 1].in == 0 && (i + 1 == n || s[i + 1].t.patch != s[i].t.patch))
            m--;
    }
    return m > 0 ? join(c, s->p, s->q, t, m) : 0;
}

static int find_edges(cell *c, const face *all, size_t n) {
    side *s = calloc(3 * n, sizeof *s);
    int r = s ? 0 : ARRIS_E_MEMORY;
    for (size_t i = 0; s && i < n; i++)
        add_sides(s + 3 * i, c, &all[i]);
    if (s)
        qsort(s, 3 * n, sizeof *s, by_edge);
    for (size_t i = 0, j; r == 0 && i < 3 * n; i = j) {
        for (j = i; j < 3 * n && s[j].p == s[i].p && s[j].q == s[i].q; j++)
            ;
        r = join_sides(c, s + i, j - i);
    }
    free(s);
    return r;
}

/* ---- seams, where faces run into each other -------------------------------------------------- */

static bool apart(const face *a, const face *b) {
    for (int i = 0; i < 3; i++)
        if (a->high[i] < b->low[i] || b->high[i] < a->low[i])
            return true;
    return false;
}

/* The two points in which the triangle crosses the plane; false when it only touches it. */
static bool cut(const cell *c, const face *k, const cell_plane *p, double tolerance,
                double X[2][3]) {
    int n = 0;
    for (int i = 0; i < 3 && n < 2; i++) {
        const double *a = c->point[k->v[i]], *b = c->point[k->v[(i + 1) % 3]];
        double da = off(p, a), db = off(p, b);
        if ((da > tolerance) == (db > tolerance))
            continue;
        for (int j = 0; j < 3; j++)
            X[n][j] = a[j] + da / (da - db) * (b[j] - a[j]);
        n++;
    }
    bool above = false, below = false;
    for (int i = 0; i < 3; i++) {
        above |= off(p, c->point[k->v[i]]) > tolerance;
        below |= off(p, c->point[k->v[i]]) < -tolerance;
    }
    return n == 2 && above && below;
}

static int add_seam(cell *c, const face *a, const face *b, double tolerance) {
    double X[2][3], Y[2][3], u[3], from[2], to[2];
    if (!cut(c, a, &c->plane[b->plane], tolerance, X) ||
        !cut(c, b, &c->plane[a->plane], tolerance, Y))
        return 0;
    arris_cross(c->plane[a->plane].n, c->plane[b->plane].n, u);
    arris_unit(u);
    from[0] = arris_dot(u, X[0]), to[0] = arris_dot(u, X[1]);
    from[1] = arris_dot(u, Y[0]), to[1] = arris_dot(u, Y[1]);
    double s = fmax(fmin(from[0], to[0]), fmin(from[1], to[1]));
    double e = fmin(fmax(from[0], to[0]), fmax(from[1], to[1]));
    if (e - s < tolerance)
        return 0;
    double P[3], Q[3];
    for (int i = 0; i < 3; i++) {
        P[i] = X[0][i] + (s - from[0]) * u[i];
        Q[i] = X[0][i] + (e - from[0]) * u[i];
    }
    return cell_add_edge(c, P, Q, NULL, 0);
}

static int find_seams(cell *c, const face *all, size_t n, double tolerance) {
    int r = 0;
    for (size_t i = 0; i < n; i++)
        for (size_t j = i + 1; r == 0 && j < n; j++)
            if (all[i].plane != all[j].plane && !apart(&all[i], &all[j]))
                r = add_seam(c, &all[i], &all[j], tolerance);
    return r;
}

/* ---- the cell -------------------------------------------------------------------------------- */

static int copy_points(cell *c, const mesh *m, double *size) {
    for (size_t i = 0; i < m->n_points; i++) {
        if (add_point(c, m->point[i]) < 0)
            return ARRIS_E_MEMORY;
        for (int k = 0; k < 3; k++)
            *size = fmax(*size, fabs(m->point[i][k]));
    }
    return 0;
}

static int build(cell *c, const mesh *m, face *all) {
    size_t n = m->n_triangles;
    double size = 1;
    int r = copy_points(c, m, &size);
    if (r < 0)
        return r;
    double tolerance = 2e-6 * size; /* some ten units of the last place of single precision */
    for (size_t i = 0; i < n; i++) {
        const mesh_triangle *t = &m->triangle[i];
        all[i] = (face){{t->v[0], t->v[1], t->v[2]}, .file = (uint32_t)i, .grey = t->grey};
        measure(&all[i], c);
    }
    find_planes(c, all, n, tolerance);
    find_patches(c, all, n);
    r = find_edges(c, all, n);
    return r == 0 ? find_seams(c, all, n, tolerance) : r;
}

int cell_build(cell *c, const mesh *m, fault *f) {
    size_t n = m->n_triangles;
    memset(c, 0, sizeof *c);
    face *all = calloc(n, sizeof *all);
    c->plane = calloc(n, sizeof *c->plane);
    c->patch = calloc(n, sizeof *c->patch);
    c->plane_of = calloc(n, sizeof *c->plane_of);
    int r = all && c->plane && c->patch && c->plane_of ? build(c, m, all) : ARRIS_E_MEMORY;
    free(all);
    return cell_fault(r, f);
}

void cell_free(cell *c) {
    free(c->point), free(c->plane), free(c->patch), free(c->plane_of);
    free(c->edge), free(c->toggle);
    memset(c, 0, sizeof *c);
}
