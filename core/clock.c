/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * clock.c: time. Stages are timed by the processor's counter where it has one that runs evenly,
 * since clock_gettime alone would cost more than passing a frame on.
 */
#include <time.h>

#include "internal.h"

int64_t arris_now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

uint64_t clock_ticks(void) {
#if defined(__x86_64__)
    return __builtin_ia32_rdtsc();
#elif defined(__aarch64__)
    uint64_t t;
    __asm__ volatile("mrs %0, cntvct_el0" : "=r"(t));
    return t;
#else
    return (uint64_t)arris_now();
#endif
}

static uint64_t first_ticks;
static int64_t first_now;

__attribute__((constructor)) static void clock_begin(void) {
    first_ticks = clock_ticks();
    first_now = arris_now();
}

double clock_ns_per_tick(void) {
    while (arris_now() - first_now < 1000000) /* a millisecond at least, for a ratio of 1e-4 */
        ;
    return (double)(arris_now() - first_now) / (double)(clock_ticks() - first_ticks);
}
