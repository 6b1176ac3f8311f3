/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * ring.c: how lanes wait for one another, and the bounded queue between two. One lane puts; taking
 * is open to both, since the putting one drops the oldest when the queue leaks, so the head moves
 * by compare-and-swap. A lane that must wait looks again for some 25 us, then lets others run,
 * since the one it waits for may want its processor, then sleeps; only then is waking it paid for.
 */
#include <errno.h>
#include <sched.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "internal.h"

enum { SPINS = 1000, YIELDS = 2, SLEEP_MS = 50 };
static int spins;

__attribute__((constructor)) static void count_processors(void) {
    spins = sysconf(_SC_NPROCESSORS_ONLN) > 1 ? SPINS : 0;
}

int waiter_init(waiter *w) {
    pthread_condattr_t a;
    pthread_condattr_init(&a);
    pthread_condattr_setclock(&a, CLOCK_MONOTONIC);
    int rc = pthread_mutex_init(&w->mutex, NULL) || pthread_cond_init(&w->cond, &a);
    pthread_condattr_destroy(&a);
    return rc ? ARRIS_E_MEMORY : 0;
}

void waiter_free(waiter *w) {
    pthread_mutex_destroy(&w->mutex);
    pthread_cond_destroy(&w->cond);
}

void waiter_wake(waiter *w) {
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
static void sleep_on(waiter *w, bool (*ready)(const void *), const void *what) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    t.tv_nsec += SLEEP_MS * 1000000;
    t.tv_sec += t.tv_nsec / 1000000000;
    t.tv_nsec %= 1000000000;
    pthread_mutex_lock(&w->mutex);
    atomic_store(&w->waiting, 1);
    if (!ready(what))
        pthread_cond_timedwait(&w->cond, &w->mutex, &t);
    atomic_store_explicit(&w->waiting, 0, memory_order_relaxed);
    pthread_mutex_unlock(&w->mutex);
}

bool waiter_wait(waiter *w, bool (*ready)(const void *), const void *what, const atomic_int *stop) {
    for (int i = 0; i < spins; i++) {
        if (ready(what))
            return true;
        pause_briefly();
    }
    for (int i = 0; i < YIELDS && !ready(what); i++)
        sched_yield();
    while (!ready(what)) {
        if (atomic_load_explicit(stop, memory_order_relaxed))
            return false;
        sleep_on(w, ready, what);
    }
    return true;
}

int ring_init(ring *r, size_t size) {
    size_t bytes = (sizeof *r->put + size * sizeof *r->put->slot + 63) / 64 * 64;
    r->size = size;
    r->put = aligned_alloc(64, bytes);
    if (r->put)
        memset(r->put, 0, bytes);
    return !r->put || waiter_init(&r->not_empty) || waiter_init(&r->not_full) ? ARRIS_E_MEMORY : 0;
}

void ring_free(ring *r) {
    if (!r->put)
        return;
    free(r->put);
    r->put = NULL;
    waiter_free(&r->not_empty);
    waiter_free(&r->not_full);
}

size_t ring_count(const ring *r) {
    size_t head = atomic_load(&r->head);
    return atomic_load(&r->put->tail) - head;
}

static bool has_one(const void *what) {
    return ring_count(what) > 0;
}

typedef struct room {
    const ring *ring;
    size_t limit;
} room;

static bool has_room(const void *what) {
    const room *r = what;
    return ring_count(r->ring) < r->limit;
}

arris_frame *ring_try_take(ring *r) {
    size_t head = atomic_load_explicit(&r->head, memory_order_acquire);
    while (head != atomic_load_explicit(&r->put->tail, memory_order_acquire)) {
        arris_frame *f = atomic_load_explicit(&r->put->slot[head % r->size], memory_order_relaxed);
        if (atomic_compare_exchange_weak(&r->head, &head, head + 1)) {
            waiter_wake(&r->not_full);
            return f;
        }
    }
    return NULL;
}

bool ring_try_put(ring *r, arris_frame *f, size_t limit) {
    if (ring_count(r) >= limit)
        return false;
    size_t tail = atomic_load_explicit(&r->put->tail, memory_order_relaxed);
    atomic_store_explicit(&r->put->slot[tail % r->size], f, memory_order_relaxed);
    atomic_store(&r->put->tail, tail + 1);
    waiter_wake(&r->not_empty);
    return true;
}

arris_frame *ring_take(ring *r, const atomic_int *stop) {
    for (;;) {
        arris_frame *f = ring_try_take(r);
        if (f || !waiter_wait(&r->not_empty, has_one, r, stop))
            return f;
    }
}

bool ring_put(ring *r, arris_frame *f, size_t limit, const atomic_int *stop) {
    while (!ring_try_put(r, f, limit))
        if (!waiter_wait(&r->not_full, has_room, &(room){r, limit}, stop))
            return false;
    return true;
}
