/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * segmenter.c: chains are split, the pieces joined, and the lines measured (segmenter.h).
 */
#include "segmenter.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "follow.h"
#include "merge.h"
#include "split.h"

#define SHORTEST 5.0       /* px: a shorter piece joins nothing */
#define CORRELATED 3.5     /* points that a Gaussian of 1 px makes one: 2 sqrt(pi) sigma */
#define ROUNDING (1. / 12) /* px², of a coordinate */
#define LEAST_SCATTER 1e-6 /* px² */
#define FAR 1e6            /* px: no coordinate is beyond */

enum { MOST = 32768 };

struct segmenter {
    segmenter_params p;
    int width, height;
    uint32_t max_pieces, max_chain;
    uint32_t n, lost; /* pieces */
    piece *pieces;
    int32_t heads[PIECE_HEADS];
    piece_node *nodes;
    uint32_t *corner;      /* of one chain */
    arris_edge_point *raw; /* one chain, rounded to pixels */
    refitter *refitter;
    support support;
    const arris_guide *guide; /* of frame number */
    uint64_t frame, searched; /* searched: the last one with edges */
};

size_t segmenter_max(int width, int height) {
    size_t n = (size_t)width * height / 96;
    return 64 + (n < MOST ? n : MOST);
}

segmenter *segmenter_new(int width, int height, const segmenter_params *p) {
    segmenter *s = calloc(1, sizeof *s);
    if (!s)
        return NULL;
    size_t pixels = (size_t)width * height;
    s->p = *p;
    s->width = width, s->height = height;
    s->max_pieces = (uint32_t)(4 * segmenter_max(width, height));
    s->max_chain = (uint32_t)(pixels / 2 + 64);
    s->pieces = malloc(s->max_pieces * sizeof *s->pieces);
    s->nodes = malloc(s->max_pieces * sizeof *s->nodes);
    s->corner = malloc(s->max_chain * sizeof *s->corner);
    s->raw = p->mode == SEGMENTER_THESIS ? malloc(s->max_chain * sizeof *s->raw) : NULL;
    s->refitter = refitter_new(width, height);
    s->searched = UINT64_MAX;
    if (support_init(&s->support, width, height) || !s->refitter || !s->pieces || !s->nodes ||
        !s->corner || (p->mode == SEGMENTER_THESIS && !s->raw)) {
        segmenter_free(s);
        return NULL;
    }
    return s;
}

void segmenter_free(segmenter *s) {
    if (!s)
        return;
    refitter_free(s->refitter);
    support_free(&s->support);
    free(s->pieces);
    free(s->nodes);
    free(s->corner);
    free(s->raw);
    free(s);
}

void segmenter_portable(segmenter *s) {
    refitter_portable(s->refitter);
}

void segmenter_guide(segmenter *s, const arris_guide *guide, uint64_t frame) {
    s->guide = guide;
    s->frame = frame;
}

/* ---- pieces --------------------------------------------------------------------------------- */

static const arris_edge_point *rounded(segmenter *s, const arris_edge_point *p, uint32_t n) {
    for (uint32_t i = 0; i < n; i++) {
        s->raw[i] = p[i];
        s->raw[i].x = rintf(p[i].x);
        s->raw[i].y = rintf(p[i].y);
    }
    return s->raw;
}

static void add_chain(segmenter *s, const arris_edge_point *p, uint32_t n, uint32_t chain) {
    bool raw = s->p.mode == SEGMENTER_THESIS;
    if (raw)
        p = rounded(s, p, n);
    uint32_t corners = split_chain(p, n, s->p.tol, raw, s->corner);
    for (uint32_t k = 0; k + 1 < corners; k++) {
        uint32_t a = s->corner[k], b = s->corner[k + 1];
        float dx = p[b].x - p[a].x, dy = p[b].y - p[a].y;
        if (!raw && dx * dx + dy * dy < (float)(SHORTEST * SHORTEST))
            continue;
        piece *q = &s->pieces[s->n];
        if (s->n == s->max_pieces) {
            s->lost++;
            continue;
        }
        piece_make(q, p + a, b - a + 1, chain, raw);
        s->n += fabs(q->x1) < FAR && fabs(q->y1) < FAR && fabs(q->x2) < FAR && fabs(q->y2) < FAR &&
                isfinite(q->xx + q->yy + q->gx + q->gy);
    }
}

static void find_pieces(segmenter *s, const arris_edges *edges) {
    s->n = s->lost = 0;
    for (uint32_t i = 0; i < edges->n_chains; i++) {
        const arris_chain *c = &edges->chain[i];
        if (c->n >= 2)
            add_chain(s, edges->point + c->first, c->n < s->max_chain ? c->n : s->max_chain, i);
    }
    piece_rule rule = {sin(s->p.angtol), s->p.linkrad,
                       s->p.mode == SEGMENTER_THESIS ? INFINITY : s->p.tol / 2};
    piece_merge(s->pieces, s->n, &rule, s->heads, s->nodes);
}

/* ---- lines ---------------------------------------------------------------------------------- */

/* Line through the points, with a covariance from how they scatter. A chord has the errors of its
 * two ends, and the distances from it those of both; points on a line share theirs with neighbours.
 */
static void from_points(const piece *p, double length, arris_segment *out) {
    double scatter = piece_scatter(p), var;
    *out = (arris_segment){.x1 = p->x1, .y1 = p->y1, .x2 = p->x2, .y2 = p->y2};
    if (p->raw) {
        bool aligned = fmin(fabs(p->x2 - p->x1), fabs(p->y2 - p->y1)) < 1.5; /* rounded alike */
        var = fmax(0.3 * scatter, aligned ? ROUNDING : 0);
        out->cov[2] = 4 * var / (length * length);
    } else {
        var = CORRELATED * (scatter + LEAST_SCATTER) / fmax(1, p->n - 2 * CORRELATED);
        out->cov[2] = var / fmax(piece_spread(p), 1);
    }
    out->cov[0] = var;
}

/* Whether the picture can be looked at, and through whose lens: *seen_by, NULL for none. */
static bool look(const segmenter *s, const arris_edges *edges, const arris_image *image,
                 const arris_camera **seen_by) {
    *seen_by = NULL;
    if (!image || s->p.mode == SEGMENTER_THESIS || image->width > s->width ||
        image->height > s->height)
        return false;
    const arris_camera *from = image->camera, *to = edges->camera;
    if (!from || !to || arris_camera_same(from, to))
        return true;
    arris_camera ideal = arris_camera_ideal(from);
    *seen_by = from;
    return arris_camera_same(&ideal, to);
}

static void measure(segmenter *s, const piece *p, float noise, bool look, arris_segments *out) {
    double length = (p->x2 - p->x1) * p->dx + (p->y2 - p->y1) * p->dy;
    arris_segment found;
    if (!(length >= s->p.min_length))
        return;
    if (look) {
        refit_start start = {.line = {p->x1, p->y1, p->dx, p->dy, length},
                             .gradient = (p->gy * p->dx - p->gx * p->dy) / p->n,
                             .noise = (double)noise};
        if (!refit(s->refitter, &start, &found))
            return;
    } else {
        from_points(p, length, &found);
    }
    found.chain = p->chain;
    if (out->n < out->max)
        out->item[out->n++] = found;
    else
        out->lost++;
}

void segmenter_run(segmenter *s, const arris_edges *edges, const arris_image *image,
                   arris_segments *out) {
    const arris_camera *camera;
    bool seen = look(s, edges, image, &camera), guided = s->guide && s->guide->n > 0;
    out->n = out->lost = 0;
    out->camera = edges->camera;
    if (guided && s->guide->searched != s->searched)
        return; /* nobody knows what is beside the lines */
    if (seen)
        refitter_look(s->refitter, image, guided ? NULL : edges, camera);
    if (seen && guided)
        follow(&s->support, s->guide, image, edges->camera, (double)edges->noise, s->p.min_length,
               s->refitter, out);
    if (guided)
        return;
    s->searched = s->frame;
    find_pieces(s, edges);
    out->lost = s->lost;
    refitter_set_lens(s->refitter, camera);
    for (uint32_t i = 0; i < s->n; i++)
        if (!s->pieces[i].gone)
            measure(s, &s->pieces[i], edges->noise, seen, out);
}
