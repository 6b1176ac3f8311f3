/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * bus.c: messages from the lanes to the pipeline's owner: a ring under a lock. When nobody takes
 * them the newest are counted and lost, but never the first error.
 */
#include <errno.h>
#include <time.h>

#include "internal.h"

int bus_init(bus *b) {
    pthread_condattr_t a;
    pthread_condattr_init(&a);
    pthread_condattr_setclock(&a, CLOCK_MONOTONIC);
    int rc = pthread_mutex_init(&b->mutex, NULL) || pthread_cond_init(&b->cond, &a);
    pthread_condattr_destroy(&a);
    return rc ? ARRIS_E_MEMORY : 0;
}

void bus_free(bus *b) {
    pthread_mutex_destroy(&b->mutex);
    pthread_cond_destroy(&b->cond);
}

/* Of the newest and `m` one is lost. */
static void lose_one(bus *b, const arris_message *m) {
    arris_message *newest = &b->message[(b->head + b->n - 1) % BUS_MESSAGES];
    if (m->severity == ARRIS_ERROR && newest->severity != ARRIS_ERROR)
        *newest = *m;
    b->lost++;
}

void bus_post(bus *b, const arris_message *m) {
    pthread_mutex_lock(&b->mutex);
    if (b->n < BUS_MESSAGES)
        b->message[(b->head + b->n++) % BUS_MESSAGES] = *m;
    else
        lose_one(b, m);
    pthread_cond_signal(&b->cond);
    pthread_mutex_unlock(&b->mutex);
}

void bus_end(bus *b) {
    pthread_mutex_lock(&b->mutex);
    b->ended = true;
    pthread_cond_signal(&b->cond);
    pthread_mutex_unlock(&b->mutex);
}

enum arris_wait_result arris_wait(arris_pipeline *p, arris_message *m, int timeout_ms) {
    bus *b = &p->bus;
    enum arris_wait_result result = ARRIS_WAIT_TIMEOUT;
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    t.tv_sec += timeout_ms / 1000;
    t.tv_nsec += timeout_ms % 1000 * 1000000L;
    t.tv_sec += t.tv_nsec / 1000000000;
    t.tv_nsec %= 1000000000;
    pthread_mutex_lock(&b->mutex);
    while (!b->n && !b->ended && !atomic_load(&p->abort))
        if (pthread_cond_timedwait(&b->cond, &b->mutex, &t) == ETIMEDOUT)
            break;
    if (b->n) {
        *m = b->message[b->head];
        b->head = (b->head + 1) % BUS_MESSAGES;
        b->n--;
        result = ARRIS_WAIT_MESSAGE;
    } else if (b->lost) {
        *m = (arris_message){.severity = ARRIS_WARNING, .frame = -1};
        snprintf(m->text, sizeof m->text, "%llu messages were lost", (unsigned long long)b->lost);
        b->lost = 0;
        result = ARRIS_WAIT_MESSAGE;
    } else if (b->ended || atomic_load(&p->abort)) {
        result = ARRIS_WAIT_ENDED;
    }
    pthread_mutex_unlock(&b->mutex);
    return result;
}
