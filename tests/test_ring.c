/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_ring.c: what lanes share: the ring between two threads, pools, histograms, the bus.
 */
#include <math.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "internal.h"

enum { MANY = 1000000, FRAMES = 64 };

/* ---- the ring -------------------------------------------------------------------------------- */

static struct {
    ring ring;
    size_t limit;
    bool leaky;
    atomic_int stop;
    arris_frame frame[FRAMES]; /* reused in turn, as those of a pool */
    atomic_int busy[FRAMES];   /* in the ring, or with the one who took it */
    uint64_t dropped;
} s;

static void release(arris_frame *f) {
    atomic_store_explicit(&s.busy[f - s.frame], 0, memory_order_release);
}

/* Frames are numbered by `seq`, which is written without any lock: the ring orders it. */
static void *producer(void *arg) {
    (void)arg;
    for (uint64_t i = 0, at = 0; i < MANY; i++) {
        while (atomic_load_explicit(&s.busy[at], memory_order_acquire))
            at = (at + 1) % FRAMES;
        arris_frame *f = &s.frame[at];
        atomic_store_explicit(&s.busy[at], 1, memory_order_relaxed);
        f->seq = i;
        if (!s.leaky && !ring_put(&s.ring, f, s.limit, &s.stop))
            return NULL;
        while (s.leaky && !ring_try_put(&s.ring, f, s.limit)) {
            arris_frame *oldest = ring_try_take(&s.ring);
            if (oldest) {
                s.dropped++;
                release(oldest);
            }
        }
    }
    return NULL;
}

static void ring_begin(size_t limit, bool leaky) {
    memset(&s, 0, sizeof s);
    s.limit = limit;
    s.leaky = leaky;
    assert_int_equal(ring_init(&s.ring, limit + 1), 0);
}

/* A million, or what passes in 10 s: with one processor for all each costs two switches. */
static void frames_come_in_order(void **state) {
    (void)state;
    for (size_t limit = 1; limit <= 32; limit *= 32) {
        pthread_t t;
        arris_frame *f;
        uint64_t next = 0;
        ring_begin(limit, false);
        assert_int_equal(pthread_create(&t, NULL, producer, NULL), 0);
        for (int64_t end = arris_now() + 10000000000; next < MANY && arris_now() < end; next++) {
            assert_non_null(f = ring_take(&s.ring, &s.stop));
            assert_true(f->seq == next);
            release(f);
        }
        atomic_store(&s.stop, 1);
        pthread_join(t, NULL);
        for (; (f = ring_try_take(&s.ring)); next++)
            assert_true(f->seq == next);
        assert_true(next > 100);
        assert_int_equal(ring_count(&s.ring), 0);
        ring_free(&s.ring);
    }
}

/* What arrives is in order, what is missing was dropped, and the newest always arrives. */
static void a_leaky_ring_loses_the_oldest(void **state) {
    (void)state;
    pthread_t t;
    ring_begin(2, true);
    assert_int_equal(pthread_create(&t, NULL, producer, NULL), 0);
    uint64_t taken = 0, next = 0;
    while (next < MANY) {
        arris_frame *f = ring_take(&s.ring, &s.stop);
        assert_true(f->seq >= next);
        next = f->seq + 1;
        taken++;
        release(f);
    }
    pthread_join(t, NULL);
    assert_true(taken + s.dropped == MANY);
    assert_int_equal(ring_count(&s.ring), 0);
    ring_free(&s.ring);
}

static void limits(void **state) {
    (void)state;
    ring_begin(2, false);
    assert_null(ring_try_take(&s.ring));
    for (int round = 0; round < 5; round++) { /* around the end of the slots */
        assert_true(ring_try_put(&s.ring, &s.frame[0], 2));
        assert_true(ring_try_put(&s.ring, &s.frame[1], 2));
        assert_false(ring_try_put(&s.ring, &s.frame[2], 2));
        assert_true(ring_try_put(&s.ring, &s.frame[2], 3)); /* the last one's place */
        assert_int_equal(ring_count(&s.ring), 3);
        for (int i = 0; i < 3; i++)
            assert_ptr_equal(ring_try_take(&s.ring), &s.frame[i]);
        assert_int_equal(ring_count(&s.ring), 0);
    }
    ring_free(&s.ring);
    ring_free(&s.ring); /* once more does nothing */
}

static void *taker(void *arg) {
    *(arris_frame **)arg = ring_take(&s.ring, &s.stop);
    return NULL;
}

static void *putter(void *arg) {
    *(bool *)arg = ring_put(&s.ring, &s.frame[1], 1, &s.stop);
    return NULL;
}

static void waiting_has_a_way_out(void **state) {
    (void)state;
    pthread_t t;
    arris_frame *f = &s.frame[5];
    ring_begin(1, false);
    pthread_create(&t, NULL, taker, &f);
    while (!atomic_load(&s.ring.not_empty.waiting)) /* it sleeps */
        ;
    atomic_store(&s.stop, 1);
    pthread_join(t, NULL);
    assert_null(f);

    bool put = true;
    atomic_store(&s.stop, 0);
    assert_true(ring_try_put(&s.ring, &s.frame[0], 1));
    pthread_create(&t, NULL, putter, &put);
    while (!atomic_load(&s.ring.not_full.waiting))
        ;
    atomic_store(&s.stop, 1);
    pthread_join(t, NULL);
    assert_false(put);
    ring_free(&s.ring);
}

static void who_sleeps_is_woken(void **state) {
    (void)state;
    pthread_t t;
    arris_frame *f = NULL;
    bool put = false;
    ring_begin(1, false);
    pthread_create(&t, NULL, taker, &f);
    while (!atomic_load(&s.ring.not_empty.waiting))
        ;
    assert_true(ring_try_put(&s.ring, &s.frame[3], 1));
    pthread_join(t, NULL);
    assert_ptr_equal(f, &s.frame[3]);
    assert_true(ring_try_put(&s.ring, &s.frame[0], 1));
    pthread_create(&t, NULL, putter, &put);
    while (!atomic_load(&s.ring.not_full.waiting))
        ;
    assert_ptr_equal(ring_try_take(&s.ring), &s.frame[0]);
    pthread_join(t, NULL);
    assert_true(put);
    ring_free(&s.ring);
}

/* ---- the pool -------------------------------------------------------------------------------- */

static pool numbers;

/* Each thread owns what it takes: nobody else writes to it meanwhile. */
static void *taker_of_numbers(void *arg) {
    uint64_t *faults = arg;
    for (uint64_t i = 0; i < MANY / 4; i++) {
        pool_item *a = pool_take(&numbers), *b = pool_take(&numbers);
        *(uint64_t *)a->data = *(uint64_t *)b->data = (uintptr_t)arg + i;
        pool_ref(a);
        pool_unref(b);
        *faults += *(uint64_t *)a->data != (uintptr_t)arg + i;
        pool_unref(a);
        *faults += *(uint64_t *)a->data != (uintptr_t)arg + i; /* one reference is left */
        pool_unref(a);
    }
    return NULL;
}

static void pools_are_shared(void **state) {
    (void)state;
    pthread_t t[3];
    uint64_t faults[3] = {0};
    assert_int_equal(pool_init(&numbers, 6, 100), 0);
    for (int i = 0; i < 3; i++)
        pthread_create(&t[i], NULL, taker_of_numbers, &faults[i]);
    for (int i = 0; i < 3; i++) {
        pthread_join(t[i], NULL);
        assert_int_equal(faults[i], 0);
    }
    for (size_t i = 0; i < numbers.n; i++)
        assert_int_equal(atomic_load(&numbers.item[i].refs), 0);
    pool_free(&numbers);
}

static void pools_give_every_item_once(void **state) {
    (void)state;
    pool p = {0};
    pool_item *item[7];
    assert_int_equal(pool_init(&p, 7, 130), 0);
    for (int i = 0; i < 7; i++) {
        item[i] = pool_take(&p);
        assert_int_equal((uintptr_t)item[i]->data % 64, 0);
        for (size_t k = 0; k < 130; k++)
            assert_int_equal(((char *)item[i]->data)[k], 0);
        memset(item[i]->data, i + 1, 130);
    }
    for (int i = 0; i < 7; i++)
        for (size_t k = 0; k < 130; k++)
            assert_int_equal(((char *)item[i]->data)[k], i + 1);
    pool_unref(item[4]);
    assert_ptr_equal(pool_take(&p), item[4]);
    pool_free(&p);
    assert_int_equal(pool_init(&p, 64, SIZE_MAX / 64), ARRIS_E_MEMORY);
    assert_int_equal(pool_init(&p, 2, SIZE_MAX - 10), ARRIS_E_MEMORY);
}

static void an_empty_pool_aborts(void **state) {
    (void)state;
    pool p = {0};
    int status;
    assert_int_equal(pool_init(&p, 1, 8), 0);
    pool_take(&p);
    pid_t child = fork();
    if (child == 0) {
        signal(SIGABRT, SIG_DFL);
        if (!freopen("/dev/null", "w", stderr))
            _exit(1);
        pool_take(&p);
        _exit(0);
    }
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFSIGNALED(status) && WTERMSIG(status) == SIGABRT);
    pool_free(&p);
}

/* ---- histograms ------------------------------------------------------------------------------ */

static int by_value(const void *a, const void *b) {
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

static uint64_t random_bits(void) {
    static uint64_t x = 88172645463325252ull;
    x ^= x << 13;
    x ^= x >> 7;
    return x ^= x << 17;
}

/* Against the sorted values themselves, over all sizes of numbers. */
static void quantiles(void **state) {
    (void)state;
    enum { N = 20001 };
    static uint64_t value[N];
    static histogram h;
    for (unsigned bits = 1; bits <= 64; bits++) {
        memset(&h, 0, sizeof h);
        for (int i = 0; i < N; i++) {
            value[i] = random_bits() >> (64 - bits) >> (random_bits() % bits / 2);
            histogram_add(&h, value[i]);
        }
        qsort(value, N, sizeof *value, by_value);
        for (double q = 0; q <= 1; q += 0.01) {
            size_t rank = (size_t)(q * N);
            double exact = (double)value[rank < N ? rank : N - 1];
            double got = (double)histogram_quantile(&h, q);
            if (exact < 16)
                assert_true(got == exact);
            else
                assert_true(fabs(got - exact) <= exact / 32 + 1);
        }
        assert_true(histogram_quantile(&h, 1) == value[N - 1]);
        assert_int_equal(histogram_count(&h), N);
        assert_true(atomic_load(&h.max) == value[N - 1]);
    }
}

static void histograms_at_their_ends(void **state) {
    (void)state;
    static histogram h;
    assert_int_equal(histogram_quantile(&h, 0.5), 0);
    histogram_add(&h, UINT64_MAX);
    assert_true(histogram_quantile(&h, 0.5) > UINT64_MAX / 32 * 31);
    for (int i = 0; i < 9; i++)
        histogram_add(&h, 0);
    assert_int_equal(histogram_quantile(&h, 0.5), 0);
    assert_int_equal(histogram_quantile(&h, 0.89), 0);
    assert_true(histogram_quantile(&h, 0.9) > UINT64_MAX / 32 * 31);
}

/* ---- the bus --------------------------------------------------------------------------------- */

static arris_pipeline *p;

static int bus_begin(void **state) {
    (void)state;
    p = arris_parse("fakesrc ! fakesink", NULL);
    return p ? 0 : -1;
}

static int bus_finish(void **state) {
    (void)state;
    arris_free(p);
    return 0;
}

static void post(enum arris_severity severity, long long number) {
    bus_post(&p->bus, &(arris_message){.severity = severity, .frame = number});
}

static void messages_come_in_order(void **state) {
    (void)state;
    arris_message m;
    assert_int_equal(arris_wait(p, &m, 1), ARRIS_WAIT_TIMEOUT);
    for (int round = 0; round < 3; round++) {
        for (int i = 0; i < BUS_MESSAGES - 10; i++)
            post(ARRIS_INFO, i);
        for (int i = 0; i < BUS_MESSAGES - 10; i++) {
            assert_int_equal(arris_wait(p, &m, 0), ARRIS_WAIT_MESSAGE);
            assert_int_equal(m.frame, i);
        }
    }
    post(ARRIS_WARNING, 7);
    bus_end(&p->bus);
    assert_int_equal(arris_wait(p, &m, 0), ARRIS_WAIT_MESSAGE); /* what was said before the end */
    assert_int_equal(m.frame, 7);
    assert_int_equal(arris_wait(p, &m, 1000), ARRIS_WAIT_ENDED);
    assert_int_equal(arris_wait(p, &m, 1000), ARRIS_WAIT_ENDED);
}

/* A flood of warnings is cut and counted, but what ended the stream is always told. */
static void a_flood_hides_no_error(void **state) {
    (void)state;
    arris_message m;
    int errors = 0, kept = 0;
    for (int i = 0; i < 3 * BUS_MESSAGES; i++)
        post(ARRIS_WARNING, i);
    post(ARRIS_ERROR, 12345);
    post(ARRIS_WARNING, 1);
    bus_end(&p->bus);
    while (arris_wait(p, &m, 0) == ARRIS_WAIT_MESSAGE && m.frame >= 0) {
        errors += m.severity == ARRIS_ERROR && m.frame == 12345;
        kept++;
    }
    assert_int_equal(errors, 1);
    assert_int_equal(kept, BUS_MESSAGES);
    assert_string_equal(m.text, "130 messages were lost"); /* 194 were posted, 64 kept */
    assert_int_equal(arris_wait(p, &m, 0), ARRIS_WAIT_ENDED);
}

static void *post_later(void *arg) {
    usleep(20000);
    post(ARRIS_INFO, 3);
    return arg;
}

static void waiting_is_woken(void **state) {
    (void)state;
    pthread_t t;
    arris_message m;
    pthread_create(&t, NULL, post_later, NULL);
    assert_int_equal(arris_wait(p, &m, 600000), ARRIS_WAIT_MESSAGE);
    pthread_join(t, NULL);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frames_come_in_order),
        cmocka_unit_test(a_leaky_ring_loses_the_oldest),
        cmocka_unit_test(limits),
        cmocka_unit_test(waiting_has_a_way_out),
        cmocka_unit_test(who_sleeps_is_woken),
        cmocka_unit_test(pools_are_shared),
        cmocka_unit_test(pools_give_every_item_once),
        cmocka_unit_test(an_empty_pool_aborts),
        cmocka_unit_test(quantiles),
        cmocka_unit_test(histograms_at_their_ends),
        cmocka_unit_test_setup_teardown(messages_come_in_order, bus_begin, bus_finish),
        cmocka_unit_test_setup_teardown(a_flood_hides_no_error, bus_begin, bus_finish),
        cmocka_unit_test_setup_teardown(waiting_is_woken, bus_begin, bus_finish),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
