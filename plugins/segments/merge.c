/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * merge.c: pieces and how they are joined (merge.h).
 */
#include "merge.h"

#include <math.h>
#include <string.h>

#include "lanes.h"

enum { MAX_ROUNDS = 32, ROUND = 3 /* points at either end that a corner may have rounded */ };
enum { NONE = -1, SEVERAL = -2 };

/* The alignment is the same for all machines that a function is compiled for. */
typedef double quad __attribute__((vector_size(32), aligned(16)));

/* ---- pieces --------------------------------------------------------------------------------- */

/* Direction of the greatest spread, and the ends' feet on the line. */
static void fit(piece *p) {
    double mx = p->x / p->n, my = p->y / p->n;
    double a = (p->xx - p->x * mx) - (p->yy - p->y * my), b = 2 * (p->xy - p->x * my);
    double h = sqrt(a * a + b * b), cx = p->x2 - p->x1, cy = p->y2 - p->y1;
    /* half of the angle whose cosine is a / h, without loss where that is small */
    double dx = a > 0 ? h + a : fabs(b), dy = a > 0 ? b : copysign(h - a, b);
    double length = sqrt(dx * dx + dy * dy);
    if (!(length > 0))
        dx = cx, dy = cy, length = sqrt(cx * cx + cy * cy);
    if (!(length > 0))
        dx = length = 1;
    if (dx * cx + dy * cy < 0)
        length = -length;
    p->dx = dx / length;
    p->dy = dy / length;
    double t1 = (p->x1 - mx) * p->dx + (p->y1 - my) * p->dy;
    double t2 = (p->x2 - mx) * p->dx + (p->y2 - my) * p->dy;
    p->x1 = mx + t1 * p->dx, p->y1 = my + t1 * p->dy;
    p->x2 = mx + t2 * p->dx, p->y2 = my + t2 * p->dy;
}

static void chord(piece *p) {
    double dx = p->x2 - p->x1, dy = p->y2 - p->y1, length = sqrt(dx * dx + dy * dy);
    p->dx = length > 0 ? dx / length : 1;
    p->dy = length > 0 ? dy / length : 0;
}

/* Adds up x, y, gx, gy, the squares of the first two, and x y, of n points. */
INLINE void add_up(piece *s, const arris_edge_point *p, uint32_t n) {
    quad sum = {0}, squares = {0}, mixed = {0};
    for (uint32_t i = 0; i < n; i++) {
        four v;
        memcpy(&v, &p[i], sizeof v);
        quad w = __builtin_convertvector(v, quad);
        sum += w, squares += w * w;
        mixed += w * __builtin_shufflevector(w, w, 1, 0, 3, 2);
    }
    s->x = sum[0], s->y = sum[1], s->gx = sum[2], s->gy = sum[3];
    s->xx = squares[0], s->yy = squares[1], s->xy = mixed[0];
}

static void add_up_portable(piece *s, const arris_edge_point *p, uint32_t n) {
    add_up(s, p, n);
}

AVX2_PATH static void add_up_avx2(piece *s, const arris_edge_point *p, uint32_t n) {
    add_up(s, p, n);
}

void piece_make(piece *s, const arris_edge_point *p, uint32_t n, uint32_t chain, bool raw) {
    const arris_edge_point *q = &p[n - 1];
    uint32_t skip = raw || n < 4 * ROUND ? 0 : ROUND;
    s->chain = chain, s->points = n, s->raw = raw, s->gone = false;
    s->x1 = p->x, s->y1 = p->y, s->x2 = q->x, s->y2 = q->y;
    s->n = n - 2 * skip;
    (HAS_AVX2 ? add_up_avx2 : add_up_portable)(s, p + skip, n - 2 * skip);
}

/* Variance of the points along the unit vector (u, v) about their mean. */
static double variance(const piece *p, double u, double v) {
    double mx = p->x / p->n, my = p->y / p->n;
    double var = u * u * (p->xx / p->n - mx * mx) + 2 * u * v * (p->xy / p->n - mx * my) +
                 v * v * (p->yy / p->n - my * my);
    return fmax(var, 0);
}

double piece_scatter(const piece *p) {
    double mean = (p->y / p->n - p->y1) * p->dx - (p->x / p->n - p->x1) * p->dy;
    return variance(p, -p->dy, p->dx) + mean * mean;
}

double piece_spread(const piece *p) {
    return variance(p, p->dx, p->dy);
}

/* ---- joining -------------------------------------------------------------------------------- */

static piece join(const piece *a, const piece *b) {
    piece s = a->points >= b->points ? *a : *b;
    s.x1 = a->x1, s.y1 = a->y1, s.x2 = b->x2, s.y2 = b->y2;
    s.n = a->n + b->n;
    s.x = a->x + b->x, s.y = a->y + b->y;
    s.xx = a->xx + b->xx, s.xy = a->xy + b->xy, s.yy = a->yy + b->yy;
    s.gx = a->gx + b->gx, s.gy = a->gy + b->gy;
    (s.raw ? chord : fit)(&s);
    return s;
}

static bool near_line(const piece *p, double x, double y, double tol) {
    return fabs((y - p->y1) * p->dx - (x - p->x1) * p->dy) <= tol;
}

/* Whether b continues a, and at what cost. */
static bool continues(const piece *a, const piece *b, const piece_rule *rule, double *cost) {
    double ex = b->x1 - a->x2, ey = b->y1 - a->y2, gap = ex * ex + ey * ey;
    if (gap > rule->linkrad * rule->linkrad || a->dx * b->dx + a->dy * b->dy <= 0)
        return false;
    double turn = fabs(a->dx * b->dy - a->dy * b->dx), most = rule->sine;
    if (turn >= most)
        return false;
    piece s = join(a, b);
    *cost = turn * turn / (most * most) + gap / (rule->linkrad * rule->linkrad + 1);
    return near_line(&s, a->x1, a->y1, rule->tol) && near_line(&s, a->x2, a->y2, rule->tol) &&
           near_line(&s, b->x1, b->y1, rule->tol) && near_line(&s, b->x2, b->y2, rule->tol);
}

/* A strict order of pairs that depends on their geometry only. */
static bool better(const piece *of, const piece_pair *p, const piece_pair *q) {
    if (p->cost != q->cost || p->first < 0 || q->first < 0)
        return p->cost < q->cost;
    const piece *a = &of[p->first], *b = &of[p->second], *c = &of[q->first], *d = &of[q->second];
    double u[] = {a->x2, a->y2, b->x1, b->y1, a->x1, a->y1, b->x2, b->y2};
    double v[] = {c->x2, c->y2, d->x1, d->y1, c->x1, c->y1, d->x2, d->y2};
    for (int i = 0; i < 8; i++)
        if (u[i] != v[i])
            return u[i] < v[i];
    return false;
}

/* ---- starts of pieces by place -------------------------------------------------------------- */

typedef struct grid {
    double per_cell; /* cells to a px, so that four hold all starts near a point */
    uint32_t mask;
    int32_t *heads;
    piece_node *nodes; /* of each piece */
} grid;

static uint32_t grid_cell(const grid *g, double x) {
    return (uint32_t)(int32_t)(x * g->per_cell + (1 << 20));
}

static int32_t *grid_head(const grid *g, uint32_t col, uint32_t row) {
    return &g->heads[(col * 0x9E3779B1u ^ row * 0x85EBCA77u) >> 16 & g->mask];
}

/* What is new of a piece. */
static void set_node(piece_node *b, const piece *p, int round) {
    b->x1 = (float)p->x1, b->y1 = (float)p->y1, b->x2 = (float)p->x2, b->y2 = (float)p->y2;
    b->dx = (float)p->dx, b->dy = (float)p->dy;
    b->joined = round;
}

/* Whether the pairs that a piece begins may be others than in the round before: it was one of a
 * pair, or what its end is near to has been joined. */
static bool may_differ(const grid *g, const piece_node *b, int round) {
    return round == 0 || b->best.first >= 0 || b->near == SEVERAL || b->joined == round ||
           (b->near >= 0 && g->nodes[b->near].joined == round);
}

static void grid_fill(grid *g, uint32_t n, int round) {
    memset(g->heads, 0xFF, (g->mask + 1) * sizeof *g->heads); /* -1: none */
    for (uint32_t i = 0; i < n; i++) {
        piece_node *b = &g->nodes[i];
        if (b->gone)
            continue;
        int32_t *head = grid_head(g, grid_cell(g, (double)b->x1), grid_cell(g, (double)b->y1));
        b->next = *head;
        b->search = may_differ(g, b, round);
        b->best = (piece_pair){INFINITY, NONE, NONE};
        *head = (int32_t)i;
    }
}

static void offer(const grid *g, const piece *p, int32_t i, const piece_pair *pair) {
    if (better(p, pair, &g->nodes[i].best))
        g->nodes[i].best = *pair;
}

/* Offers each pair that a begins, and whose second start is in a list, to both of its pieces. What
 * is far from the rule is left out in single precision. */
static void find_in(const grid *g, int32_t head, const piece *p, piece_node *a,
                    const piece_rule *rule) {
    float far = (float)(1.01 * rule->linkrad + 0.01), sine = (float)(1.01 * rule->sine + 1e-4);
    int32_t i = (int32_t)(a - g->nodes);
    for (const piece_node *b; head >= 0; head = b->next) {
        b = &g->nodes[head];
        if ((fabsf(b->x1 - a->x2) > far) | (fabsf(b->y1 - a->y2) > far) | (b == a))
            continue;
        a->near = a->near == NONE || a->near == head ? head : SEVERAL;
        piece_pair pair = {0, i, head};
        if (fabsf(a->dx * b->dy - a->dy * b->dx) > sine ||
            !continues(&p[i], &p[head], rule, &pair.cost))
            continue;
        offer(g, p, i, &pair);
        offer(g, p, head, &pair);
    }
}

static void find_pairs(const grid *g, const piece *p, piece_node *a, const piece_rule *rule) {
    double x = (double)a->x2, y = (double)a->y2, far = 1.01 * rule->linkrad + 0.01;
    uint32_t left = grid_cell(g, x - far), right = grid_cell(g, x + far);
    uint32_t top = grid_cell(g, y - far), bottom = grid_cell(g, y + far);
    a->near = NONE;
    for (uint32_t col = left; col <= right; col++)
        for (uint32_t row = top; row <= bottom; row++)
            find_in(g, *grid_head(g, col, row), p, a, rule);
}

/* Joins the pairs that are the best of both their pieces. */
static bool join_best(const grid *g, piece *p, uint32_t n, int round) {
    bool any = false;
    for (uint32_t i = 0; i < n; i++) {
        piece_node *a = &g->nodes[i];
        if (a->gone || a->best.first != (int32_t)i)
            continue;
        piece_node *b = &g->nodes[a->best.second];
        if (b->best.first != (int32_t)i || b->best.second != a->best.second)
            continue;
        p[i] = join(&p[i], &p[a->best.second]);
        set_node(a, &p[i], round + 1);
        p[a->best.second].gone = b->gone = any = true;
    }
    return any;
}

void piece_merge(piece *p, uint32_t n, const piece_rule *rule, int32_t *heads, piece_node *nodes) {
    grid g = {1 / fmax(16, 3 * rule->linkrad), 63, heads, nodes};
    while (g.mask + 1 < PIECE_HEADS && g.mask < n)
        g.mask = 2 * g.mask + 1;
    for (uint32_t i = 0; i < n; i++) {
        (p[i].raw ? chord : fit)(&p[i]);
        set_node(&nodes[i], &p[i], 0);
        nodes[i].gone = p[i].gone;
    }
    bool more = true;
    for (int round = 0; more && round < MAX_ROUNDS; round++) {
        grid_fill(&g, n, round);
        for (uint32_t i = 0; i < n; i++)
            if (!nodes[i].gone && nodes[i].search)
                find_pairs(&g, p, &nodes[i], rule);
        more = join_best(&g, p, n, round);
    }
}
