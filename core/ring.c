/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * ring.c: the bounded queue between two lanes. One lane puts; taking is open to both, since the
 * putting one drops the oldest when the queue leaks, so the head moves by compare-and-swap. A lane
 * that must wait looks again for about as long as a switch of threads costs, then sleeps; the
 * other one pays for waking it only when it does.
 */
#include <errno.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

#include "internal.h"

enum { SPINS = 200, SLEEP_MS = 50 };
static int spins;

static int waiter_init(waiter *w) {
    pthread_condattr_t a;
    pthread_condattr_init(&a);
    pthread_condattr_setclock(&a, CLOCK_MONOTONIC);
    int rc = pthread_mutex_init(&w->mutex, NULL) || pthread_cond_init(&w->cond, &a);
    pthread_condattr_destroy(&a);
    return rc ? ARRIS_E_MEMORY : 0;
}

static void wake(waiter *w) {
    if (!atomic_load(&w->waiting)) /* in sequence after what was put or taken */
        return;
    pthread_mutex_lock(&w->mutex);
    pthread_cond_signal(&w->cond);
    pthread_mutex_unlock(&w->mutex);
}

static void pause_briefly(void) {
#if defined(__x86_64__)
    __builtin_ia32_pause();
#elif defined(__aarch64__)
    __asm__ volatile("yield");
#endif
}

/* One sleep of SLEEP_MS at most; the caller looks again after it. */
static void sleep_on(waiter *w, ring *r, bool (*ready)(ring *, size_t), size_t limit) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    t.tv_nsec += SLEEP_MS * 1000000;
    t.tv_sec += t.tv_nsec / 1000000000;
    t.tv_nsec %= 1000000000;
    pthread_mutex_lock(&w->mutex);
    atomic_store(&w->waiting, 1);
    if (!ready(r, limit))
        pthread_cond_timedwait(&w->cond, &w->mutex, &t);
    atomic_store_explicit(&w->waiting, 0, memory_order_relaxed);
    pthread_mutex_unlock(&w->mutex);
}

static bool wait_for(waiter *w, ring *r, bool (*ready)(ring *, size_t), size_t limit,
                     const atomic_int *stop) {
    for (int i = 0; i < spins; i++) {
        if (ready(r, limit))
            return true;
        pause_briefly();
    }
    while (!ready(r, limit)) {
        if (atomic_load_explicit(stop, memory_order_relaxed))
            return false;
        sleep_on(w, r, ready, limit);
    }
    return true;
}

int ring_init(ring *r, size_t size) {
    spins = sysconf(_SC_NPROCESSORS_ONLN) > 1 ? SPINS : 0;
    r->size = size;
    r->slot = calloc(size, sizeof *r->slot);
    return !r->slot || waiter_init(&r->not_empty) || waiter_init(&r->not_full) ? ARRIS_E_MEMORY : 0;
}

void ring_free(ring *r) {
    if (!r->slot)
        return;
    free(r->slot);
    r->slot = NULL;
    pthread_mutex_destroy(&r->not_empty.mutex);
    pthread_cond_destroy(&r->not_empty.cond);
    pthread_mutex_destroy(&r->not_full.mutex);
    pthread_cond_destroy(&r->not_full.cond);
}

size_t ring_count(ring *r) {
    size_t head = atomic_load(&r->head);
    return atomic_load(&r->tail) - head;
}

static bool has_one(ring *r, size_t limit) {
    (void)limit;
    return ring_count(r) > 0;
}

static bool has_room(ring *r, size_t limit) {
    return ring_count(r) < limit;
}

arris_frame *ring_try_take(ring *r) {
    size_t head = atomic_load_explicit(&r->head, memory_order_acquire);
    while (head != atomic_load_explicit(&r->tail, memory_order_acquire)) {
        arris_frame *f = atomic_load_explicit(&r->slot[head % r->size], memory_order_relaxed);
        if (atomic_compare_exchange_weak(&r->head, &head, head + 1)) {
            wake(&r->not_full);
            return f;
        }
    }
    return NULL;
}

bool ring_try_put(ring *r, arris_frame *f, size_t limit) {
    if (!has_room(r, limit))
        return false;
    size_t tail = atomic_load_explicit(&r->tail, memory_order_relaxed);
    atomic_store_explicit(&r->slot[tail % r->size], f, memory_order_relaxed);
    atomic_store(&r->tail, tail + 1);
    wake(&r->not_empty);
    return true;
}

arris_frame *ring_take(ring *r, const atomic_int *stop) {
    for (;;) {
        arris_frame *f = ring_try_take(r);
        if (f || !wait_for(&r->not_empty, r, has_one, 0, stop))
            return f;
    }
}

bool ring_put(ring *r, arris_frame *f, size_t limit, const atomic_int *stop) {
    while (!ring_try_put(r, f, limit))
        if (!wait_for(&r->not_full, r, has_room, limit, stop))
            return false;
    return true;
}
