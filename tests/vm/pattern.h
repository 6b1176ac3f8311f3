/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * pattern.h: numbered grey pictures: what the emulated camera sends, and what is to arrive. The
 * number stands in the top rows as 32 blocks of 8x8, dark or light, which JPEG does not harm.
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

static inline void pattern_draw(uint8_t *grey, uint32_t number) {
    for (int y = 0; y < PATTERN_HEIGHT; y++)
        for (int x = 0; x < PATTERN_WIDTH; x++) {
            uint32_t h = (uint32_t)(x / 2 * 3 + y / 2 * 5) + number * 7;
            grey[y * PATTERN_WIDTH + x] =
                y < 8 && x < 256 ? (number >> x / 8 & 1 ? LIGHT : DARK) : (uint8_t)(h ^ h >> 8);
        }
}

/* The number of a picture with rows of `stride` bytes. */
static inline uint32_t pattern_number(const uint8_t *grey, long stride) {
    uint32_t number = 0;
    for (int i = 0; i < 32; i++)
        number |= (uint32_t)(grey[4 * stride + 8 * i + 4] > (DARK + LIGHT) / 2) << i;
    return number;
}

#endif
