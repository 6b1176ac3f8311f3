/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * fuzz_decode.c: any bytes as a picture, decoded into memory of just its size. A PNG's checksums
 * are put right first, or nothing but them would be tested.
 */
#include <stdlib.h>
#include <string.h>

#include "image/picture.h"

enum { MOST = 1 << 18 /* pixels, so that an input takes little time */ };

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n);

static void put_crc(uint8_t *p, size_t n) {
    uint32_t crc = ~0u;
    for (size_t k = 0; k < n; k++) {
        crc ^= p[k];
        for (int bit = 0; bit < 8; bit++)
            crc = crc >> 1 ^ (crc & 1 ? 0xedb88320u : 0);
    }
    for (int k = 0; k < 4; k++)
        p[n + (size_t)k] = (uint8_t)(~crc >> (24 - 8 * k));
}

/* A chunk is its length, its name, that many bytes, and a checksum of both. */
static void mend_png(uint8_t *p, size_t n) {
    for (size_t at = 8, len; at + 12 <= n; at += 12 + len) {
        len = (size_t)p[at] << 24 | (size_t)p[at + 1] << 16 | (size_t)p[at + 2] << 8 | p[at + 3];
        if (len > n - at - 12)
            return;
        put_crc(p + at + 4, len + 4);
    }
}

static void decode(const uint8_t *data, size_t n) {
    picture_info info;
    fault f;
    if (picture_read_info(data, n, &info, &f) || (int64_t)info.width * info.height > MOST)
        return;
    size_t stride = (size_t)info.width * info.format;
    arris_image out = {.format = info.format,
                       .width = info.width,
                       .height = info.height,
                       .stride = (ptrdiff_t)stride,
                       .data = malloc(stride * (size_t)info.height)};
    picture_decode(data, n, &out, &f);
    free(out.data);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n) {
    uint8_t *copy = malloc(n ? n : 1);
    memcpy(copy, data, n);
    if (n > 8 && copy[0] == 0x89)
        mend_png(copy, n);
    decode(copy, n);
    free(copy);
    return 0;
}
