/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * pool.c: equal buffers with a count of references, taken and released by any lane without a lock.
 */
#include <stdlib.h>
#include <string.h>

#include "internal.h"

int pool_init(pool *p, size_t n, size_t size) {
    size = (size + 63) / 64 * 64;
    p->n = n;
    p->item = aligned_alloc(64, n * sizeof *p->item);
    p->memory = size && n <= SIZE_MAX / size ? aligned_alloc(64, n * size) : NULL;
    if (!p->item || !p->memory) {
        pool_free(p);
        return ARRIS_E_MEMORY;
    }
    memset(p->item, 0, n * sizeof *p->item);
    memset(p->memory, 0, n * size);
    for (size_t i = 0; i < n; i++)
        p->item[i].data = (char *)p->memory + i * size;
    return 0;
}

void pool_free(pool *p) {
    free(p->item);
    free(p->memory);
    *p = (pool){0};
}

/* The only free item may be taken before one who looks comes to it, and another be released where
 * he has been: so he may have to go round more than once. */
pool_item *pool_take(pool *p) {
    enum { ROUNDS = 1000 };
    size_t at = atomic_load_explicit(&p->hint, memory_order_relaxed);
    for (size_t k = 0; k < p->n * ROUNDS; k++) {
        at = at + 1 < p->n ? at + 1 : 0;
        int none = 0;
        if (atomic_compare_exchange_strong_explicit(&p->item[at].refs, &none, 1,
                                                    memory_order_acquire, memory_order_relaxed)) {
            atomic_store_explicit(&p->hint, at, memory_order_relaxed);
            return &p->item[at];
        }
    }
    fprintf(stderr, "arris: internal error: a pool of %zu buffers is empty\n", p->n);
    abort();
}

void pool_ref(pool_item *i) {
    atomic_fetch_add_explicit(&i->refs, 1, memory_order_relaxed);
}

void pool_unref(pool_item *i) {
    atomic_fetch_sub_explicit(&i->refs, 1, memory_order_release);
}
