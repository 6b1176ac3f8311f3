/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * graph.c: settles and checks the whole graph, upstream first; sets the stages up; cuts the graph
 * into lanes; and sizes the pools by how many frames can be in flight.
 */
#include <stdlib.h>
#include <string.h>

#include "internal.h"

/* ---- layers ---------------------------------------------------------------------------------- */

typedef struct givers {
    uint32_t layer;
    char text[200];
} givers;

static void collect_giver(const arris_stage_desc *d, const char *plugin, void *user) {
    (void)plugin;
    givers *g = user;
    size_t n = strlen(g->text);
    if (d->layers.gives & g->layer)
        snprintf(g->text + n, sizeof g->text - n, "%s%s", n ? ", " : "", d->name);
}

static int missing(const arris_stage *s, arris_error *err) {
    uint32_t layers = s->layers.needs & ~s->have;
    char names[100], hint[400];
    givers g = {.layer = layers & (~layers + 1)};
    layer_names(g.layer, names, sizeof names);
    registry_each(collect_giver, &g);
    if (*g.text)
        snprintf(hint, sizeof hint, "put a stage that gives it before: %s", g.text);
    else
        snprintf(hint, sizeof hint, "no stage that is installed gives it");
    return error_at(err, &s->at, 0, ARRIS_E_RECIPE, hint,
                    "%s needs the layer '%s', which nothing before it gives", s->name, names);
}

static int settle(arris_stage *s, arris_error *err) {
    s->have = s->in ? s->in->have | s->in->layers.gives : 0;
    s->layers = s->desc->layers;
    int rc = s->desc->settle ? s->desc->settle(s, s->self, &s->layers) : 0;
    if (rc)
        return err->code ? rc : error_at(err, &s->at, 0, rc, NULL, "%s refused", s->name);
    return s->layers.needs & ~s->have ? missing(s, err) : 0;
}

static int set_up(arris_stage *s, arris_error *err) {
    if (s->in)
        s->caps = s->in->caps;
    s->was_set_up = true;
    int rc = s->desc->setup ? s->desc->setup(s, s->self, &s->caps) : 0;
    if (rc)
        return err->code ? rc : error_at(err, &s->at, 0, rc, NULL, "%s: setup failed", s->name);
    for (uint32_t set = s->layers.gives; set; set &= set - 1)
        if (!s->pools[__builtin_ctz(set)].reserved)
            return error_at(err, &s->at, 0, ARRIS_E_INTERNAL,
                            "a stage calls arris_reserve in setup",
                            "%s gives the layer '%s' and has not reserved it", s->name,
                            layer_name(__builtin_ctz(set)));
    return 0;
}

int arris_reserve(arris_stage *s, enum arris_layer layer, size_t n, size_t m) {
    if (layer >= ARRIS_MAX_LAYERS || !(s->layers.gives & ARRIS_BIT(layer)))
        return arris_fail(s, ARRIS_E_INTERNAL, NULL, "it reserves a layer that it does not give");
    s->pools[layer].n = n;
    s->pools[layer].m = m;
    s->pools[layer].reserved = true;
    return 0;
}

size_t arris_capacity(const arris_stage *s, enum arris_layer layer, size_t *m) {
    while (arris_has(s, layer)) {
        s = s->in;
        if (!(s->layers.gives & ARRIS_BIT(layer)))
            continue;
        if (m)
            *m = s->pools[layer].m;
        return s->pools[layer].n;
    }
    return 0;
}

bool arris_has(const arris_stage *s, enum arris_layer layer) {
    return layer < ARRIS_MAX_LAYERS && (s->have & ARRIS_BIT(layer));
}

bool arris_wanted(const arris_stage *s, enum arris_layer layer) {
    for (size_t i = 0; i < s->n_out; i++) {
        const arris_layers *l = &s->out[i]->layers;
        if ((l->needs | l->wants) & ARRIS_BIT(layer))
            return true;
        if (!(l->gives & ARRIS_BIT(layer)) && arris_wanted(s->out[i], layer))
            return true;
    }
    return false;
}

void arris_set_live(arris_stage *s, bool live) {
    s->live = live;
}

/* ---- lanes ----------------------------------------------------------------------------------- */

static const queue_props *queue_of(const arris_stage *s) {
    return s->desc == &stage_queue ? s->self : NULL;
}

/* A live source never waits: before anything that may block, its frames go into a leaky queue. */
static int imply_queue(arris_pipeline *p, arris_error *err) {
    arris_stage *first = p->stage[0], *next = first->n_out ? first->out[0] : NULL;
    const queue_props *there = next ? queue_of(next) : NULL;
    bool wanted = first->live || (first->desc->flags & ARRIS_AHEAD);
    if (!next || !wanted || (there && (!first->live || there->leaky != LEAKY_NO)))
        return 0;
    arris_stage *q = stage_new(p, &stage_queue, &first->at, err);
    if (!q || stage_link(q, next, err))
        return err->code;
    ((queue_props *)q->self)->leaky = first->live ? LEAKY_OLDEST : LEAKY_NO;
    q->implied = true;
    q->in = first;
    first->out[0] = q;
    q->caps = first->caps;
    q->have = first->have | first->layers.gives;
    memmove(&p->stage[2], &p->stage[1], (p->n_stages - 2) * sizeof *p->stage);
    p->stage[1] = q;
    return 0;
}

static int make_lanes(arris_pipeline *p, arris_error *err) {
    p->lanes = calloc(p->n_stages, sizeof *p->lanes);
    if (!p->lanes)
        return error_set(err, ARRIS_E_MEMORY, NULL, "out of memory");
    for (size_t i = 0; i < p->n_stages; i++) {
        arris_stage *s = p->stage[i];
        if (s->n_out == 0 && p->n_leaves++ == 0)
            p->first_leaf = s;
        if (s->in && s->desc != &stage_queue) {
            s->lane = s->in->lane;
            continue;
        }
        s->lane = &p->lanes[p->n_lanes];
        *s->lane = (lane){.pipeline = p, .number = (int)p->n_lanes++, .head = s};
        if (s->in && ring_init(&s->ring, (size_t)queue_of(s)->max_frames + 1))
            return error_set(err, ARRIS_E_MEMORY, NULL, "out of memory");
    }
    return 0;
}

/* ---- pools ----------------------------------------------------------------------------------- */

/* How many frames can hold what `s` gives: one in its lane, and behind every queue downstream those
 * that wait, the last one, and one in the lane. */
static size_t in_flight(const arris_stage *s) {
    size_t n = 1;
    for (size_t i = 0; i < s->n_out; i++) {
        const queue_props *q = queue_of(s->out[i]);
        n += in_flight(s->out[i]) - 1 + (q ? (size_t)q->max_frames + 2 : 0);
    }
    return n;
}

static int make_pools(arris_pipeline *p, arris_error *err) {
    size_t shells = 0;
    for (size_t i = 0; i < p->n_stages; i++) {
        arris_stage *s = p->stage[i];
        shells += s->n_out > 1 ? s->n_out : 0;
        for (uint32_t set = s->layers.gives; set; set &= set - 1) {
            enum arris_layer layer = (enum arris_layer)__builtin_ctz(set);
            layer_pool *l = &s->pools[layer];
            size_t n = in_flight(s) + 1 + loops_hold(s, layer),
                   size = layer_size(layer, &s->caps, l->n, l->m);
            if (!size || pool_init(&l->pool, n, size))
                return error_at(err, &s->at, 0, ARRIS_E_MEMORY, NULL,
                                "%s: no memory for %zu layers '%s' of %zu bytes", s->name, n,
                                layer_name(layer), size);
            for (size_t k = 0; k < n; k++)
                layer_init(layer, l->pool.item[k].data, &s->caps, l->n, l->m);
        }
    }
    /* a branch of a tee has a frame of its own: as many as if every queue held its own */
    size_t n = in_flight(p->stage[0]) + p->n_lanes + shells + 1;
    return pool_init(&p->frames, n, sizeof(arris_frame))
               ? error_set(err, ARRIS_E_MEMORY, NULL, "out of memory")
               : 0;
}

int arris_check(arris_pipeline *p, arris_error *err) {
    arris_error ignored;
    int rc = p->lanes || p->stage[0]->was_set_up
                 ? error_set(err, ARRIS_E_USAGE, NULL, "a pipeline is checked once")
                 : 0;
    if (rc)
        return rc;
    p->setup_error = err ? err : &ignored;
    memset(p->setup_error, 0, sizeof *p->setup_error);
    for (size_t i = 0; rc == 0 && i < p->n_stages; i++)
        rc = settle(p->stage[i], p->setup_error);
    if (rc == 0)
        rc = loops_make(p, p->setup_error);
    for (size_t i = 0; rc == 0 && i < p->n_stages; i++)
        rc = set_up(p->stage[i], p->setup_error);
    if (rc == 0)
        rc = imply_queue(p, p->setup_error);
    if (rc == 0)
        rc = make_lanes(p, p->setup_error);
    if (rc == 0)
        rc = make_pools(p, p->setup_error);
    p->setup_error = NULL;
    p->checked = rc == 0;
    return rc;
}
