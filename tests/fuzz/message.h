/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * message.h: any bytes as an LCM message of a type: its fingerprint before them, in memory of just
 * that size. Without the fingerprint chance would never get beyond it.
 */
#ifndef FUZZ_MESSAGE_H
#define FUZZ_MESSAGE_H

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

static inline uint8_t *message_of(int64_t fingerprint, const uint8_t *data, size_t n) {
    uint8_t *m = malloc(n + 8);
    for (int i = 0; i < 8; i++)
        m[i] = (uint8_t)((uint64_t)fingerprint >> (56 - 8 * i));
    if (n)
        memcpy(m + 8, data, n);
    return m;
}

#endif
