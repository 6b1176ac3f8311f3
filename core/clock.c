/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * clock.c: time.
 */
#include <time.h>

#include "internal.h"

int64_t arris_now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
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
