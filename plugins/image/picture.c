/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * picture.c: tells PNG, JPEG and PGM apart by their first bytes.
 */
#include "picture.h"

#include <string.h>

typedef struct codec {
    const char *magic;
    int (*info)(const uint8_t *data, size_t n, picture_info *info, fault *f);
    int (*decode)(const uint8_t *data, size_t n, const arris_image *out, fault *f);
} codec;

static const codec codecs[] = {
    {"\x89PNG\r\n\x1a\n", picture_png_info, picture_png_decode},
    {"\xff\xd8\xff", picture_jpeg_info, picture_jpeg_decode},
    {"P5", picture_pgm_info, picture_pgm_decode},
    {"P2", picture_pgm_info, picture_pgm_decode},
};

static const codec *find(const uint8_t *data, size_t n, fault *f) {
    for (size_t i = 0; i < sizeof codecs / sizeof *codecs; i++) {
        size_t len = strlen(codecs[i].magic);
        if (n >= len && memcmp(data, codecs[i].magic, len) == 0)
            return &codecs[i];
    }
    fault_set(f, ARRIS_E_INPUT, NULL, "this is no PNG, JPEG or PGM picture");
    return NULL;
}

int picture_read_info(const uint8_t *data, size_t n, picture_info *info, fault *f) {
    const codec *c = find(data, n, f);
    if (!c)
        return ARRIS_E_INPUT;
    int r = c->info(data, n, info, f);
    if (r < 0)
        return r;
    if (info->width < 1 || info->height < 1 || info->width > PICTURE_MAX_SIDE ||
        info->height > PICTURE_MAX_SIDE)
        return fault_set(f, ARRIS_E_INPUT, "scale it down or cut it",
                         "the picture is %dx%d; the limits are 1x1 and %dx%d", info->width,
                         info->height, PICTURE_MAX_SIDE, PICTURE_MAX_SIDE);
    return 0;
}

int picture_decode(const uint8_t *data, size_t n, const arris_image *out, fault *f) {
    const codec *c = find(data, n, f);
    return c ? c->decode(data, n, out, f) : ARRIS_E_INPUT;
}
