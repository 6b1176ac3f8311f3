/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * sweep.c: which patch is seen where (sweep.h).
 *
 * The sweep goes along y' = y + SHEAR x, so that edges along the rows are nothing special, and no
 * two points have the same y': an edge has always an upper and a lower end, and the pieces that
 * come out close around their regions.
 */
#include "sweep.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double SHEAR = 0.0137; /* any number that edges don't have for a slope by design */
static const double APART = 1e-7;   /* between the y' of two points */
static const double SAME = 1e-7;    /* edges this close along x are not told apart */
static const double SLIVER = 1e-6;  /* nobody looks into an interval that is narrower */
static const double NOTABLE = 1e-3; /* the size of what counts as seen or hidden */

enum { NONE = UINT32_MAX };

typedef struct edge {
    double x0, y0, x1, y1, slope; /* upper and lower end, sheared; dx/dy' */
    double top, bottom, x;        /* x where the slab begins and ends, and where one looks */
    double since;                 /* y' from which it has had these sides */
    int32_t left, right;
    int sign; /* 1: it points down; -1: up */
    uint32_t p, q, n, next;
    const sweep_toggle *toggle;
} edge;

typedef struct point {
    double x, y;    /* y sheared */
    uint32_t first; /* of the edges that begin here */
    bool used;
} point;

typedef struct rank {
    double y;
    uint32_t point;
} rank;

struct sweep {
    size_t max_points, max_edges, max_crossings, n_points, n_edges, n_active, n_crossings, n_inside;
    size_t n_planes;
    point *point;
    rank *order, *crossing;
    edge *edge, **active, **below;
    const int32_t *plane_of;
    int32_t *in, *lit;       /* how often a patch covers the place, and the light reaches a plane */
    int32_t *inside, *place; /* the patches that do, and where in that list */

    double left, right, top, bottom; /* the window */
    const double (*depth)[3];
    uint8_t *seen, *hidden;
    sweep_emit *emit;
    void *to;
};

sweep *sweep_new(size_t points, size_t edges, const int32_t *plane_of, size_t patches,
                 size_t planes) {
    sweep *w = calloc(1, sizeof *w);
    if (!w)
        return NULL;
    *w = (sweep){.max_points = points, .max_edges = edges, .max_crossings = 16 * edges + 64};
    w->n_planes = planes, w->plane_of = plane_of;
    w->point = calloc(points + 1, sizeof *w->point);
    w->order = calloc(points + 1, sizeof *w->order);
    w->edge = calloc(edges + 1, sizeof *w->edge);
    w->active = calloc(edges + 1, sizeof(edge *));
    w->below = calloc(edges + 1, sizeof(edge *));
    w->crossing = calloc(w->max_crossings, sizeof *w->crossing);
    w->in = calloc(patches + 1, sizeof *w->in);
    w->lit = calloc(planes + 1, sizeof *w->lit);
    w->inside = calloc(patches + 1, sizeof *w->inside);
    w->place = calloc(patches + 1, sizeof *w->place);
    if (w->point && w->order && w->edge && w->active && w->below && w->crossing && w->in &&
        w->lit && w->inside && w->place)
        return w;
    sweep_free(w);
    return NULL;
}

void sweep_free(sweep *w) {
    if (!w)
        return;
    void *all[] = {w->point, w->order, w->edge,   w->active, w->below, w->crossing,
                   w->in,    w->lit,   w->inside, w->place,  w};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        free(all[i]);
}

void sweep_begin(sweep *w) {
    w->n_points = w->n_edges = 0;
}

uint32_t sweep_point(sweep *w, double x, double y) {
    if (w->n_points == w->max_points)
        return NONE;
    w->point[w->n_points] = (point){.x = x, .y = y + SHEAR * x, .first = NONE};
    return (uint32_t)w->n_points++;
}

void sweep_edge(sweep *w, uint32_t p, uint32_t q, const sweep_toggle *toggle, uint32_t n) {
    if (w->n_edges < w->max_edges && p != q && p != NONE && q != NONE)
        w->edge[w->n_edges++] = (edge){.p = p, .q = q, .toggle = toggle, .n = n};
}

/* ---- what is seen ---------------------------------------------------------------------------- */

/* Crosses an edge from left to right. */
static void cross(sweep *w, const edge *e) {
    for (uint32_t i = 0; i < e->n; i++) {
        const sweep_toggle *t = &e->toggle[i];
        int32_t before = w->in[t->patch], after = before + e->sign * t->in;
        w->in[t->patch] = after;
        w->lit[w->plane_of[t->patch]] += e->sign * t->lit;
        if (before == 0 && after != 0) {
            w->place[t->patch] = (int32_t)w->n_inside;
            w->inside[w->n_inside++] = t->patch;
        } else if (before != 0 && after == 0) {
            int32_t last = w->inside[--w->n_inside], at = w->place[t->patch];
            w->inside[at] = last;
            w->place[last] = at;
        }
    }
}

/* The region at (x, y'), among the patches that cover it. */
static int32_t look(const sweep *w, double x, double y) {
    double best = -INFINITY;
    int32_t patch = -1;
    y -= SHEAR * x;
    for (size_t i = 0; i < w->n_inside; i++) {
        int32_t k = w->inside[i];
        const double *d = w->depth[w->plane_of[k]];
        double near = d[0] * x + d[1] * y + d[2];
        if (near > best || (near == best && k > patch)) {
            best = near;
            patch = k;
        }
    }
    return patch < 0 ? SWEEP_NOTHING : sweep_region(patch, w->lit[w->plane_of[patch]] != 0);
}

static void note(sweep *w, int32_t region) {
    int32_t on_top = region < 0 ? -1 : w->plane_of[region / 2];
    for (size_t i = 0; i < w->n_inside; i++) {
        int32_t plane = w->plane_of[w->inside[i]];
        *(plane == on_top ? &w->seen[plane] : &w->hidden[plane]) = 1;
    }
}

/* x of the edge at y'; at its ends exactly what all edges have that end there. */
static double at(const edge *e, double y) {
    return y >= e->y1 ? e->x1 : y <= e->y0 ? e->x0 : e->x0 + (y - e->y0) * e->slope;
}

/* A piece from y0 to y1, on one side of each border of the window. What is left of the window moves
 * along the line onto its border; what is right of it is nobody's concern. */
static void emit_piece(const sweep *w, const edge *e, double y0, double y1) {
    sweep_piece p = {.left = e->left, .right = e->right};
    if (!(y1 > y0) || at(e, (y0 + y1) / 2) > w->right)
        return;
    p.x0 = fmax(at(e, y0), w->left), p.x1 = fmax(at(e, y1), w->left);
    p.y0 = y0 - SHEAR * p.x0;
    p.y1 = y1 - SHEAR * p.x1;
    w->emit(w->to, &p);
}

/* Where the edge comes to x, if it does from y0 to y1; else one of the two. */
static double meet(const edge *e, double x, double y0, double y1) {
    double y = e->slope != 0 ? e->y0 + (x - e->x0) / e->slope : y0;
    return fmin(fmax(y, y0), y1);
}

/* The edge's sides are about to change, or it ends: emits what had the old ones. */
static void flush(sweep *w, edge *e, double y) {
    double y0 = e->since;
    e->since = y;
    if (e->left == e->right || !(y > y0))
        return;
    double a = meet(e, w->left, y0, y), b = meet(e, w->right, y0, y);
    emit_piece(w, e, y0, fmin(a, b));
    emit_piece(w, e, fmin(a, b), fmax(a, b));
    emit_piece(w, e, fmax(a, b), y);
}

/* Looks along the line at the middle of a layer from y0 to y1, in which no edges cross. */
static void layer(sweep *w, double y0, double y1) {
    double middle = (y0 + y1) / 2;
    for (size_t i = 0; i < w->n_active; i++) {
        edge *e = w->active[i];
        size_t k = i;
        e->x = at(e, middle);
        for (; k > 0 && w->active[k - 1]->x > e->x; k--)
            w->active[k] = w->active[k - 1];
        w->active[k] = e;
    }
    int32_t region = SWEEP_NOTHING;
    for (size_t i = 0; i < w->n_active; i++) {
        edge *e = w->active[i];
        int32_t left = region;
        double a = e->x, b = i + 1 < w->n_active ? w->active[i + 1]->x : fmax(a, w->right);
        cross(w, e);
        if (b - a > SLIVER) {
            region = look(w, (a + b) / 2, middle);
            if (w->seen && b - a > NOTABLE && y1 - y0 > NOTABLE)
                note(w, region);
        }
        if (e->left != left || e->right != region) {
            flush(w, e, y0);
            e->left = left;
            e->right = region;
        }
    }
    while (w->n_inside > 0) /* what goes on beyond the window */
        w->in[w->inside[--w->n_inside]] = 0;
    memset(w->lit, 0, w->n_planes * sizeof *w->lit);
}

/* ---- the sweep ------------------------------------------------------------------------------- */

static bool is_above(const rank *a, const rank *b) {
    return a->y != b->y ? a->y < b->y : a->point < b->point;
}

/* Moves the one at k down to its place in the heap of n, whose lowest is at its root. */
static void sift(rank *a, size_t k, size_t n) {
    rank r = a[k];
    for (size_t child; (child = 2 * k + 1) < n; k = child) {
        child += child + 1 < n && is_above(&a[child], &a[child + 1]);
        if (!is_above(&r, &a[child]))
            break;
        a[k] = a[child];
    }
    a[k] = r;
}

/* From top to bottom. (Heapsort: libc's qsort allocates.) */
static void sort(rank *a, size_t n) {
    for (size_t k = n / 2; k-- > 0;)
        sift(a, k, n);
    while (n-- > 1) {
        rank r = a[0];
        a[0] = a[n];
        a[n] = r;
        sift(a, 0, n);
    }
}

/* Where e, which is left of f at the top of the slab, comes to be right of it. */
static void note_crossing(sweep *w, const edge *e, const edge *f, double y0, double y1) {
    double before = fmax(f->top - e->top, 0), after = e->bottom - f->bottom;
    double y = y0 + before / (before + after) * (y1 - y0);
    bool beside =
        (f->top < w->left && e->bottom < w->left) || (e->top > w->right && f->bottom > w->right);
    if (y > y0 && y < y1 && !beside && w->n_crossings < w->max_crossings)
        w->crossing[w->n_crossings++] = (rank){y, 0};
}

static bool is_left(const edge *e, const edge *f) {
    double d = e->top - f->top;
    return d < -SAME || (d < SAME && e->bottom < f->bottom);
}

/* Orders the active edges along the top of a slab, and finds where they cross on the way down to
 * its bottom: each inversion between the two orders is a crossing. */
static void find_crossings(sweep *w, double y0, double y1) {
    w->n_crossings = 0;
    for (size_t i = 0; i < w->n_active; i++) {
        edge *e = w->active[i];
        size_t k = i;
        e->top = at(e, y0), e->bottom = at(e, y1);
        for (; k > 0 && is_left(e, w->active[k - 1]); k--)
            w->active[k] = w->active[k - 1];
        w->active[k] = e;
    }
    for (size_t i = 0; i < w->n_active; i++) {
        edge *e = w->active[i];
        size_t k = i;
        for (; k > 0 && w->below[k - 1]->bottom > e->bottom + SAME; k--) {
            note_crossing(w, w->below[k - 1], e, y0, y1);
            w->below[k] = w->below[k - 1];
        }
        w->below[k] = e;
    }
    sort(w->crossing, w->n_crossings);
}

/* From one stop at an end of edges to the next. */
static void slab(sweep *w, double y0, double y1) {
    if (!(y1 > y0) || w->n_active == 0)
        return;
    find_crossings(w, y0, y1);
    for (size_t i = 0; i < w->n_crossings; i++)
        if (w->crossing[i].y - y0 > APART / 100) {
            layer(w, y0, w->crossing[i].y);
            y0 = w->crossing[i].y;
        }
    layer(w, y0, y1);
}

static void retire(sweep *w, double y) {
    size_t n = 0;
    for (size_t i = 0; i < w->n_active; i++) {
        edge *e = w->active[i];
        if (e->y1 <= y)
            flush(w, e, y);
        else
            w->active[n++] = e;
    }
    w->n_active = n;
}

static void start(sweep *w, uint32_t first, double y) {
    for (uint32_t i = first; i != NONE; i = w->edge[i].next) {
        edge *e = &w->edge[i];
        e->since = y;
        e->left = e->right = SWEEP_NOTHING;
        w->active[w->n_active++] = e;
    }
}

/* From top to bottom, and no two at the same y'. */
static void order_points(sweep *w) {
    for (size_t i = 0; i < w->n_points; i++)
        w->order[i] = (rank){w->point[i].y, (uint32_t)i};
    sort(w->order, w->n_points);
    for (size_t i = 0; i < w->n_points; i++) {
        if (i > 0)
            w->order[i].y = fmax(w->order[i].y, w->order[i - 1].y + APART);
        w->point[w->order[i].point].y = w->order[i].y;
    }
}

/* Hangs the edges on the points at which they begin. Returns the first of those that come into the
 * window from above. What lies right of it changes nothing in it. */
static uint32_t link_edges(sweep *w) {
    uint32_t from_above = NONE;
    for (size_t i = 0; i < w->n_edges; i++) {
        edge *e = &w->edge[i];
        e->sign = w->point[e->p].y < w->point[e->q].y ? 1 : -1;
        point *upper = &w->point[e->sign > 0 ? e->p : e->q];
        point *lower = &w->point[e->sign > 0 ? e->q : e->p];
        e->x0 = upper->x, e->y0 = upper->y, e->x1 = lower->x, e->y1 = lower->y;
        e->slope = (e->x1 - e->x0) / (e->y1 - e->y0);
        if (e->y1 <= w->top || e->y0 >= w->bottom || (e->x0 > w->right && e->x1 > w->right))
            continue;
        uint32_t *list = e->y0 <= w->top ? &from_above : &upper->first;
        e->next = *list;
        *list = (uint32_t)i;
        upper->used = lower->used = true;
    }
    return from_above;
}

static void set_window(sweep *w, const double window[4]) {
    w->left = window[0];
    w->right = window[2];
    w->top = window[1] + SHEAR * window[0];
    w->bottom = window[3] + SHEAR * window[2];
}

void sweep_run(sweep *w, const double window[4], const double (*depth)[3], uint8_t *seen,
               uint8_t *hidden, sweep_emit *emit, void *to) {
    w->depth = depth, w->seen = seen, w->hidden = hidden, w->emit = emit, w->to = to;
    set_window(w, window);
    order_points(w);
    double y = w->top;
    w->n_active = 0;
    start(w, link_edges(w), y);
    for (size_t i = 0; i < w->n_points; i++) {
        const point *p = &w->point[w->order[i].point];
        if (!p->used || p->y <= w->top || p->y >= w->bottom)
            continue;
        slab(w, y, p->y);
        y = p->y;
        retire(w, y);
        start(w, p->first, y);
    }
    slab(w, y, w->bottom);
    for (size_t i = 0; i < w->n_active; i++)
        flush(w, w->active[i], w->bottom);
}
