/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * loop.c: feedback: a layer that is made downstream, handed back to a stage that asks for it. A
 * loop runs from the asker to the nearest giver downstream. Every frame that enters it leaves one
 * thing behind, in a slot of its own: the giver's layer, or a mark where it was dropped; so the
 * asker can wait for just the one that it needs. A frame that is dropped early may leave before
 * those ahead of it.
 */
#include "internal.h"

static arris_stage *nearest_giver(const arris_stage *s, enum arris_layer layer) {
    for (size_t i = 0; i < s->n_out; i++) {
        if (s->out[i]->layers.gives & ARRIS_BIT(layer))
            return s->out[i];
        arris_stage *giver = nearest_giver(s->out[i], layer);
        if (giver)
            return giver;
    }
    return NULL;
}

static int make(arris_pipeline *p, arris_stage *asker, enum arris_layer layer, arris_error *err) {
    arris_stage *giver = nearest_giver(asker, layer);
    if (!giver)
        return 0;
    if (p->n_loops == MAX_LOOPS)
        return error_at(err, &asker->at, 0, ARRIS_E_RECIPE, NULL, "more than %d feedback loops",
                        MAX_LOOPS);
    loop *l = &p->loop[p->n_loops];
    *l = (loop){.asker = asker, .giver = giver, .layer = layer};
    if (waiter_init(&l->waiter))
        return error_set(err, ARRIS_E_MEMORY, NULL, "out of memory");
    for (arris_stage *s = giver;; s = s->in) {
        if (s->desc == &stage_queue && ((queue_props *)s->self)->leaky != LEAKY_NO)
            return error_at(err, &s->at, 0, ARRIS_E_RECIPE, "put it before or behind them",
                            "a leaky queue may not stand between %s and %s, which hands '%s' back",
                            asker->name, giver->name, layer_name(layer));
        s->inside |= 1u << p->n_loops;
        if (s == asker)
            break;
    }
    p->n_loops++;
    return 0;
}

int loops_make(arris_pipeline *p, arris_error *err) {
    int rc = 0;
    for (size_t i = 0; i < p->n_stages; i++)
        for (uint32_t set = p->stage[i]->layers.asks; rc == 0 && set; set &= set - 1)
            rc = make(p, p->stage[i], (enum arris_layer)__builtin_ctz(set), err);
    return rc;
}

void loops_free(arris_pipeline *p) {
    for (size_t i = 0; i < p->n_loops; i++)
        waiter_free(&p->loop[i].waiter);
}

/* One more than the delay: the one that is read stands while the next is written. */
static size_t slots(const loop *l) {
    return (size_t)l->asker->delay + 1;
}

size_t loops_hold(const arris_stage *giver, enum arris_layer layer) {
    size_t n = 0;
    for (size_t i = 0; i < giver->pipeline->n_loops; i++) {
        const loop *l = &giver->pipeline->loop[i];
        n += l->giver == giver && l->layer == layer ? slots(l) : 0;
    }
    return n;
}

typedef struct awaited {
    const atomic_ullong *posted;
    uint64_t number;
} awaited;

static bool is_posted(const void *what) {
    const awaited *a = what;
    return atomic_load(a->posted) == a->number + 1;
}

/* Waits until a frame has left the loop. False: the pipeline is aborted. */
static bool await(loop *l, uint64_t number) {
    awaited a = {&l->slot[number % slots(l)].posted, number};
    return waiter_wait(&l->waiter, is_posted, &a, &l->asker->pipeline->abort);
}

/* A frame waits for the one whose slot it will take, in case the asker did not. */
void loops_enter(arris_stage *s, arris_frame *f) {
    for (uint32_t set = s->inside; set; set &= set - 1) {
        int i = __builtin_ctz(set);
        loop *l = &s->pipeline->loop[i];
        if (l->asker != s)
            continue;
        if (l->entered >= slots(l))
            await(l, l->entered - slots(l));
        f->number[i] = l->entered++;
    }
}

static void leave(loop *l, arris_frame *f, uint64_t number, bool gone) {
    pool_item **item = &l->slot[number % slots(l)].item;
    if (*item)
        pool_unref(*item);
    *item = gone ? NULL : f->layer[l->layer];
    if (*item)
        pool_ref(*item);
    atomic_store(&l->slot[number % slots(l)].posted, number + 1);
    waiter_wake(&l->waiter);
}

void loops_leave(arris_stage *s, arris_frame *f, bool gone) {
    for (uint32_t set = s->inside; set; set &= set - 1) {
        int i = __builtin_ctz(set);
        loop *l = &s->pipeline->loop[i];
        if (gone || l->giver == s)
            leave(l, f, f->number[i], gone);
    }
}

/* ---- the asker's side ------------------------------------------------------------------------ */

static loop *loop_of(const arris_stage *s, enum arris_layer layer) {
    for (size_t i = 0; i < s->pipeline->n_loops; i++)
        if (s->pipeline->loop[i].asker == s && s->pipeline->loop[i].layer == layer)
            return &s->pipeline->loop[i];
    return NULL;
}

void arris_set_delay(arris_stage *s, int frames) {
    s->delay = frames < 1 ? 1 : frames > MAX_DELAY ? MAX_DELAY : frames;
}

bool arris_has_feedback(const arris_stage *s, enum arris_layer layer) {
    return loop_of(s, layer) != NULL;
}

const void *arris_feedback(arris_stage *s, enum arris_layer layer) {
    loop *l = loop_of(s, layer);
    uint64_t delay = (uint64_t)s->delay;
    if (!l || l->entered <= delay) /* the present frame has entered already */
        return NULL;
    uint64_t number = l->entered - 1 - delay;
    const pool_item *item = await(l, number) ? l->slot[number % slots(l)].item : NULL;
    return item ? item->data : NULL;
}
