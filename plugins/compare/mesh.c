/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * mesh.c: the straight edges of a mesh. Vertices that coincide are made one (STL has no topology),
 * edges of triangles are sorted by their vertices, those that stand are joined where they run on.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "arris_geometry.h"
#include "nominal.h"

static const double STRAIGHT = 0.99998; /* cosine of 0.36°: such edges run on */

/* An edge of a triangle, or a line of its own, which counts as having no face. */
typedef struct side {
    uint32_t a, b;  /* a < b */
    uint32_t face;  /* UINT32_MAX: none */
    bool turned;    /* the face goes from b to a */
    uint32_t order; /* in the file */
} side;

/* ---- one vertex where several coincide ------------------------------------------------------- */

typedef struct grid {
    uint32_t *head, *next, mask;
    double cell;
} grid;

static uint32_t hash(int64_t x, int64_t y, int64_t z) {
    uint64_t h = (uint64_t)x * 0x9e3779b97f4a7c15u ^ (uint64_t)y * 0xc2b2ae3d27d4eb4fu ^
                 (uint64_t)z * 0x165667b19e3779f9u;
    return (uint32_t)(h ^ h >> 32);
}

static double extent(const nominal *m) {
    double most = 0;
    for (uint32_t i = 1; i < m->n_vertices; i++)
        for (int k = 0; k < 3; k++)
            most = fmax(most, fabs(m->vertex[i][k] - m->vertex[0][k]));
    return isfinite(most) ? most : 1;
}

/* In a chain of vertices one near p, or UINT32_MAX. */
static uint32_t find_near(const nominal *m, const grid *g, uint32_t w, const double p[3],
                          double near) {
    for (; w != UINT32_MAX; w = g->next[w]) {
        const double *q = m->vertex[w];
        if (fabs(p[0] - q[0]) < near && fabs(p[1] - q[1]) < near && fabs(p[2] - q[2]) < near)
            break;
    }
    return w;
}

/* The vertex that stands for v: an earlier one nearer than `near`, or itself. */
static uint32_t stand_for(const nominal *m, grid *g, uint32_t v, double near) {
    const double *p = m->vertex[v];
    int64_t low[3], high[3]; /* cells: rarely more than one */
    for (int k = 0; k < 3; k++) {
        low[k] = (int64_t)floor((p[k] - near) / g->cell);
        high[k] = (int64_t)floor((p[k] + near) / g->cell);
    }
    for (int64_t x = low[0]; x <= high[0]; x++)
        for (int64_t y = low[1]; y <= high[1]; y++)
            for (int64_t z = low[2]; z <= high[2]; z++) {
                uint32_t w = find_near(m, g, g->head[hash(x, y, z) & g->mask], p, near);
                if (w != UINT32_MAX)
                    return w;
            }
    uint32_t h = hash((int64_t)floor(p[0] / g->cell), (int64_t)floor(p[1] / g->cell),
                      (int64_t)floor(p[2] / g->cell)) &
                 g->mask;
    g->next[v] = g->head[h];
    g->head[h] = v;
    return v;
}

/* one[v] becomes the vertex that stands for v. */
static bool weld(const nominal *m, uint32_t *one) {
    double near = 1e-6 * extent(m) + 1e-9;
    grid g = {.mask = 1, .cell = 64 * near};
    while (g.mask < m->n_vertices && g.mask < 1u << 30)
        g.mask <<= 1;
    g.mask--;
    g.head = malloc((g.mask + 1) * sizeof *g.head);
    g.next = malloc((m->n_vertices + 1) * sizeof *g.next);
    bool good = g.head && g.next;
    if (good)
        memset(g.head, 0xff, (g.mask + 1) * sizeof *g.head);
    for (uint32_t v = 0; good && v < m->n_vertices; v++) {
        const double *p = m->vertex[v];
        bool finite = fabs(p[0]) < 1e9 && fabs(p[1]) < 1e9 && fabs(p[2]) < 1e9;
        one[v] = finite ? stand_for(m, &g, v, near) : v;
    }
    free(g.head);
    free(g.next);
    return good;
}

/* ---- the sides ------------------------------------------------------------------------------- */

/* The unit normal of a triangle; false when it has no area. */
static bool face_normal(const nominal *m, uint32_t face, double n[3]) {
    const uint32_t *t = m->triangle[face];
    double a[3], b[3];
    for (int k = 0; k < 3; k++) {
        a[k] = m->vertex[t[1]][k] - m->vertex[t[0]][k];
        b[k] = m->vertex[t[2]][k] - m->vertex[t[0]][k];
    }
    double size = sqrt(arris_dot(a, a) * arris_dot(b, b));
    arris_cross(a, b, n);
    return arris_unit(n) > 1e-9 * size;
}

static void add_side(side *s, uint32_t *n, uint32_t a, uint32_t b, uint32_t face) {
    if (a == b)
        return;
    s[*n] = (side){a < b ? a : b, a < b ? b : a, face, a > b, *n};
    ++*n;
}

static int by_vertices(const void *x, const void *y) {
    const side *a = x, *b = y;
    return a->a != b->a   ? (a->a > b->a) - (a->a < b->a)
           : a->b != b->b ? (a->b > b->b) - (a->b < b->b)
                          : (a->order > b->order) - (a->order < b->order);
}

static int by_order(const void *x, const void *y) {
    const side *a = x, *b = y;
    return (a->order > b->order) - (a->order < b->order);
}

/* Whether the n sides between two vertices are an edge of the part. */
static bool stands(const nominal *m, const side *s, uint32_t n, double crease) {
    double u[3], v[3];
    if (n != 2 || s[0].face == UINT32_MAX || s[1].face == UINT32_MAX)
        return true;
    face_normal(m, s[0].face, u);
    face_normal(m, s[1].face, v);
    double c = arris_dot(u, v);
    return acos(fmax(-1, fmin(1, s[0].turned == s[1].turned ? -c : c))) > crease;
}

/* Keeps of each group of equal sides the first, when it is an edge. `mate` gets the second's face.
 */
static uint32_t keep_edges(const nominal *m, side *s, uint32_t n, double crease, uint32_t *mate) {
    uint32_t kept = 0;
    for (uint32_t i = 0, k; i < n; i = k) {
        for (k = i + 1; k < n && s[k].a == s[i].a && s[k].b == s[i].b; k++)
            ;
        if (stands(m, s + i, k - i, crease)) {
            uint32_t second = k - i > 1 ? s[i + 1].face : UINT32_MAX;
            mate[s[i].order] = second;
            s[kept++] = s[i];
        }
    }
    return kept;
}

/* ---- runs ------------------------------------------------------------------------------------ */

/* An end of a kept side at a vertex. */
typedef struct stub {
    uint32_t vertex, side;
} stub;

static int by_vertex(const void *x, const void *y) {
    const stub *a = x, *b = y;
    return a->vertex != b->vertex ? (a->vertex > b->vertex) - (a->vertex < b->vertex)
                                  : (a->side > b->side) - (a->side < b->side);
}

static uint32_t root(uint32_t *up, uint32_t i) {
    while (up[i] != i)
        i = up[i] = up[up[i]];
    return i;
}

/* The unit direction of a side away from one of its vertices. */
static void away(const nominal *m, const side *s, uint32_t vertex, double d[3]) {
    uint32_t other = s->a == vertex ? s->b : s->a;
    for (int k = 0; k < 3; k++)
        d[k] = m->vertex[other][k] - m->vertex[vertex][k];
    arris_unit(d);
}

static void join_at(const nominal *m, const side *s, const stub *at, uint32_t n, uint32_t *up) {
    enum { STAR = 64 }; /* a fan of more edges has no run through it that matters */
    for (uint32_t i = 0; i < n && n <= STAR; i++)
        for (uint32_t k = i + 1; k < n; k++) {
            double d[3], e[3];
            away(m, &s[at[i].side], at[i].vertex, d);
            away(m, &s[at[k].side], at[k].vertex, e);
            if (arris_dot(d, e) < -STRAIGHT)
                up[root(up, at[k].side)] = root(up, at[i].side);
        }
}

static void find_runs(const nominal *m, const side *s, uint32_t n, stub *stubs, uint32_t *up) {
    for (uint32_t i = 0; i < n; i++) {
        up[i] = i;
        stubs[2 * i] = (stub){s[i].a, i};
        stubs[2 * i + 1] = (stub){s[i].b, i};
    }
    qsort(stubs, 2 * (size_t)n, sizeof *stubs, by_vertex);
    for (uint32_t i = 0, k; i < 2 * n; i = k) {
        for (k = i + 1; k < 2 * n && stubs[k].vertex == stubs[i].vertex; k++)
            ;
        join_at(m, s, stubs + i, k - i, up);
    }
}

/* ---- the edges ------------------------------------------------------------------------------- */

static void add_normal(const nominal *m, uint32_t face, double sum[3]) {
    double n[3];
    if (face != UINT32_MAX && face_normal(m, face, n))
        for (int k = 0; k < 3; k++)
            sum[k] += n[k];
}

/* Makes `e` reach to v as well. */
static void reach(nominal_edge *e, const double v[3]) {
    double d[3], w[3];
    for (int k = 0; k < 3; k++) {
        d[k] = e->q[k] - e->p[k];
        w[k] = v[k] - e->p[k];
    }
    double t = arris_dot(d, w) / arris_dot(d, d);
    if (t < 0)
        memcpy(e->p, v, sizeof e->p);
    if (t > 1)
        memcpy(e->q, v, sizeof e->q);
}

static double length(const nominal_edge *e) {
    double d[3] = {e->q[0] - e->p[0], e->q[1] - e->p[1], e->q[2] - e->p[2]};
    return sqrt(arris_dot(d, d));
}

/* Every run becomes an edge; its number in the file's order, short ones too, is its id. */
static int take_runs(nominal *m, const side *s, uint32_t n, uint32_t *up, const uint32_t *mate,
                     double min_length, fault *f) {
    uint32_t runs = 0, kept = 0;
    uint32_t *number = malloc((n + 1) * sizeof *number);
    m->edge = calloc(n + 1, sizeof *m->edge);
    if (!number || !m->edge) {
        free(number);
        return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for %u edges", n);
    }
    for (uint32_t i = 0; i < n; i++)
        number[i] = UINT32_MAX;
    for (uint32_t i = 0; i < n; i++) {
        uint32_t r = root(up, i);
        if (number[r] == UINT32_MAX) {
            number[r] = runs++;
            memcpy(m->edge[number[r]].p, m->vertex[s[i].a], sizeof m->edge->p);
            memcpy(m->edge[number[r]].q, m->vertex[s[i].b], sizeof m->edge->q);
        }
        nominal_edge *e = &m->edge[number[r]];
        reach(e, m->vertex[s[i].a]);
        reach(e, m->vertex[s[i].b]);
        add_normal(m, s[i].face, e->normal);
        add_normal(m, mate[s[i].order], e->normal);
    }
    free(number);
    for (uint32_t i = 0; i < runs; i++) {
        nominal_edge *e = &m->edge[kept];
        *e = m->edge[i];
        arris_unit(e->normal);
        snprintf(e->id, sizeof e->id, "e%u", i + 1);
        kept += length(e) >= min_length;
    }
    m->n_edges = kept;
    return kept <= NOMINAL_MAX_EDGES
               ? 0
               : fault_set(f, ARRIS_E_INPUT, "a greater crease-angle or min-length makes it fewer",
                           "the model has %u edges, more than %d", kept, NOMINAL_MAX_EDGES);
}

int mesh_edges(nominal *m, const uint32_t (*lines)[2], uint32_t n_lines, double crease,
               double min_length, fault *f) {
    size_t most = 3 * (size_t)m->n_triangles + n_lines + 1;
    uint32_t *one = malloc((m->n_vertices + 1) * sizeof *one), n = 0;
    side *s = malloc(most * sizeof *s);
    uint32_t *mate = malloc(most * sizeof *mate), *up = malloc(most * sizeof *up);
    stub *stubs = malloc(2 * most * sizeof *stubs);
    int r = fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for %zu edges", most);
    if (one && s && mate && up && stubs && weld(m, one)) {
        double unused[3];
        for (uint32_t t = 0; t < m->n_triangles; t++) {
            uint32_t *v = m->triangle[t];
            for (int k = 0; k < 3; k++)
                v[k] = one[v[k]];
            for (int k = 0; k < 3 && face_normal(m, t, unused); k++)
                add_side(s, &n, v[k], v[(k + 1) % 3], t);
        }
        for (uint32_t i = 0; i < n_lines; i++)
            add_side(s, &n, one[lines[i][0]], one[lines[i][1]], UINT32_MAX);
        qsort(s, n, sizeof *s, by_vertices);
        n = keep_edges(m, s, n, crease, mate);
        qsort(s, n, sizeof *s, by_order);
        find_runs(m, s, n, stubs, up);
        r = take_runs(m, s, n, up, mate, min_length, f);
    }
    free(one);
    free(s);
    free(mate);
    free(up);
    free(stubs);
    return r;
}
