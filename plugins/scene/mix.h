/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * mix.h: chance that is the same in every run: any number of any sequence, without a state.
 */
#ifndef MIX_H
#define MIX_H

#include <math.h>
#include <stdint.h>

/* 64 good bits from any number: the finaliser of splitmix64 (Steele, Lea and Flood 2014). */
static inline uint64_t mix(uint64_t z) {
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    return z ^ (z >> 31);
}

/* Number i of the sequence that the seed names. */
static inline uint64_t mix_at(uint64_t seed, uint64_t i) {
    return mix(seed + (i + 1) * 0x9e3779b97f4a7c15);
}

/* Number i of a sequence of standard normal numbers (Box and Muller 1958). */
static inline double mix_normal(uint64_t seed, uint64_t i) {
    double a = (double)((mix_at(seed, 2 * i) >> 11) + 1) / 9007199254740993.;
    double b = (double)(mix_at(seed, 2 * i + 1) >> 11) / 9007199254740992.;
    return sqrt(-2 * log(a)) * cos(2 * M_PI * b);
}

#endif
