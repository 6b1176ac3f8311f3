/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * pattern.h: numbered grey pictures: what the emulated camera sends, and what is to arrive. In the
 * top rows stand the number and the middle of the exposure (CLOCK_MONOTONIC, the lower 32 bits of
 * the us), each as 32 blocks of 8x8, dark or light, which JPEG does not harm.
 */
#ifndef PATTERN_H
#define PATTERN_H

#include <stdint.h>

enum {
    PATTERN_WIDTH = 320,
    PATTERN_HEIGHT = 240,
    PATTERN_PIXELS = 320 * 240,
    DARK = 16,
    LIGHT = 235
};

typedef struct pattern {
    uint32_t number, middle;
} pattern;

static inline void pattern_draw(uint8_t *grey, pattern p) {
    for (int y = 0; y < PATTERN_HEIGHT; y++)
        for (int x = 0; x < PATTERN_WIDTH; x++) {
            uint32_t h = (uint32_t)(x / 2 * 3 + y / 2 * 5) + p.number * 7,
                     word = y < 8 ? p.number : p.middle;
            grey[y * PATTERN_WIDTH + x] =
                y < 16 && x < 256 ? (word >> x / 8 & 1 ? LIGHT : DARK) : (uint8_t)(h ^ h >> 8);
        }
}

/* What a picture with rows of `stride` bytes says. */
static inline pattern pattern_read(const uint8_t *grey, long stride) {
    pattern p = {0, 0};
    for (int i = 0; i < 32; i++) {
        p.number |= (uint32_t)(grey[4 * stride + 8 * i + 4] > (DARK + LIGHT) / 2) << i;
        p.middle |= (uint32_t)(grey[12 * stride + 8 * i + 4] > (DARK + LIGHT) / 2) << i;
    }
    return p;
}

#endif
