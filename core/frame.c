/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * frame.c: a frame, the layers that it carries by reference, and a stage's dealings with both.
 */
#include <string.h>

#include "internal.h"

arris_frame *frame_take(arris_pipeline *p) {
    pool_item *item = pool_take(&p->frames);
    arris_frame *f = item->data; /* its layers are NULL: so frame_release leaves them */
    f->item = item;
    f->index = f->utime = 0;
    f->last = f->timed = false;
    f->carries = f->given = 0;
    return f;
}

arris_frame *frame_shell(arris_frame *f, arris_pipeline *p) {
    arris_frame *g = frame_take(p);
    pool_item *item = g->item;
    *g = *f;
    g->item = item;
    for (uint32_t set = g->carries; set; set &= set - 1)
        pool_ref(g->layer[__builtin_ctz(set)]);
    return g;
}

void frame_settle(arris_frame *f) {
    for (uint32_t set = f->given; set; set &= set - 1) {
        int i = __builtin_ctz(set);
        if (f->old[i])
            pool_unref(f->old[i]);
        f->old[i] = NULL;
    }
    f->given = 0;
}

void frame_release(arris_frame *f) {
    for (uint32_t set = f->carries; set; set &= set - 1) {
        pool_unref(f->layer[__builtin_ctz(set)]);
        f->layer[__builtin_ctz(set)] = NULL;
    }
    pool_unref(f->item);
}

uint64_t arris_frame_seq(const arris_frame *f) {
    return f->seq;
}

int64_t arris_frame_utime(const arris_frame *f) {
    return f->utime;
}

int64_t arris_frame_index(const arris_frame *f) {
    return f->index;
}

void arris_frame_set(arris_frame *f, int64_t index, int64_t utime) {
    f->index = index;
    f->utime = utime;
    f->start = arris_now();
}

int64_t arris_frame_arrival(const arris_frame *f) {
    return f->start;
}

void arris_frame_set_arrival(arris_frame *f, int64_t when) {
    f->start = when;
}

const void *arris_layer_get(const arris_frame *f, enum arris_layer layer) {
    return layer < ARRIS_MAX_LAYERS && f->layer[layer] ? f->layer[layer]->data : NULL;
}

bool arris_layer_held(const arris_stage *s, enum arris_layer layer, const void *given) {
    const pool *p = &s->pools[layer].pool;
    for (size_t i = 0; i < p->n; i++)
        if (p->item[i].data == given)
            return atomic_load_explicit(&p->item[i].refs, memory_order_acquire) > 0;
    return false;
}

void *arris_layer_give(arris_stage *s, arris_frame *f, enum arris_layer layer) {
    uint32_t bit = ARRIS_BIT(layer);
    if (!(f->given & bit)) {
        pool_item *item = pool_take(&s->pools[layer].pool);
        layer_reset(layer, item->data);
        f->old[layer] = f->layer[layer];
        f->layer[layer] = item;
        f->given |= bit;
        f->carries |= bit;
    }
    return f->layer[layer]->data;
}
