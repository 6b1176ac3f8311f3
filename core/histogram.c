/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * histogram.c: log-linear buckets, 16 to the octave, so a quantile is within 6 % of the truth. One
 * thread writes, with plain stores; any may read.
 */
#include "internal.h"

static uint64_t middle_of(unsigned bucket) {
    if (bucket < 16)
        return bucket;
    unsigned shift = bucket / 16 - 1;
    return ((uint64_t)(16 + bucket % 16) << shift) + ((1ull << shift) >> 1);
}

uint64_t histogram_count(const histogram *h) {
    uint64_t n = 0;
    for (unsigned i = 0; i < HISTOGRAM_BUCKETS; i++)
        n += atomic_load_explicit(&h->bucket[i], memory_order_relaxed);
    return n;
}

uint64_t histogram_quantile(const histogram *h, double q) {
    uint64_t rank = (uint64_t)(q * (double)histogram_count(h)), max = atomic_load(&h->max);
    uint64_t seen = 0;
    for (unsigned i = 0; i < HISTOGRAM_BUCKETS; i++) {
        seen += atomic_load_explicit(&h->bucket[i], memory_order_relaxed);
        if (seen > rank)
            return middle_of(i) < max ? middle_of(i) : max;
    }
    return max;
}
