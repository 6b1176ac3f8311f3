/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * histogram.c: log-linear buckets, 16 to the octave, so a quantile is within 6 % of the truth. One
 * thread writes, with plain stores; any may read.
 */
#include "internal.h"

static unsigned bucket_of(uint64_t v) {
    if (v < 16)
        return (unsigned)v;
    unsigned octave = 63 - (unsigned)__builtin_clzll(v);
    return (octave - 3) * 16 + (unsigned)(v >> (octave - 4) & 15);
}

static uint64_t middle_of(unsigned bucket) {
    if (bucket < 16)
        return bucket;
    unsigned shift = bucket / 16 - 1;
    return ((uint64_t)(16 + bucket % 16) << shift) + ((1ull << shift) >> 1);
}

static void add(atomic_ullong *to, uint64_t n) {
    atomic_store_explicit(to, atomic_load_explicit(to, memory_order_relaxed) + n,
                          memory_order_relaxed);
}

void histogram_add(histogram *h, uint64_t ticks) {
    add(&h->bucket[bucket_of(ticks)], 1);
    add(&h->n, 1);
    add(&h->sum, ticks);
    if (ticks > atomic_load_explicit(&h->max, memory_order_relaxed))
        atomic_store_explicit(&h->max, ticks, memory_order_relaxed);
}

uint64_t histogram_quantile(const histogram *h, double q) {
    uint64_t rank = (uint64_t)(q * (double)atomic_load(&h->n)), max = atomic_load(&h->max);
    uint64_t seen = 0;
    for (unsigned i = 0; i < HISTOGRAM_BUCKETS; i++) {
        seen += atomic_load_explicit(&h->bucket[i], memory_order_relaxed);
        if (seen > rank)
            return middle_of(i) < max ? middle_of(i) : max;
    }
    return max;
}
