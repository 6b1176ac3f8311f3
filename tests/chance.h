/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * chance.h: random numbers for the tests, the same in every run from the same `seed`, which is not
 * to be 0.
 */
#ifndef CHANCE_H
#define CHANCE_H

#include <math.h>
#include <stdint.h>

static uint64_t seed = 1;

/* Uniform in 0..1 (xorshift64*), and normal with sigma 1 (Box and Muller). */
static inline double uniform(void) {
    seed ^= seed >> 12, seed ^= seed << 25, seed ^= seed >> 27;
    return (double)((seed * 2685821657736338717u) >> 11) / 9007199254740992.0;
}

static inline double normal(void) {
    double r = sqrt(-2 * log(1 - uniform()));
    return r * cos(2 * M_PI * uniform());
}

#endif
