/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * jpeg.c: JPEG through TurboJPEG, which decodes only the luma of a colour picture.
 */
#include <turbojpeg.h>

#include "picture.h"

/* A warning is an error here: what libjpeg fills in for damaged data would be measured as edges. */
enum { STRICT = TJFLAG_STOPONWARNING | TJFLAG_LIMITSCANS };

static int failed(tjhandle h, fault *f) {
    return fault_set(f, ARRIS_E_INPUT, NULL, "the JPEG is damaged or of no usual kind: %s",
                     tjGetErrorStr2(h));
}

static int no_handle(fault *f) {
    return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for the JPEG decoder");
}

int picture_jpeg_info(const uint8_t *data, size_t n, picture_info *info, fault *f) {
    tjhandle h = tjInitDecompress();
    if (!h)
        return no_handle(f);
    int sampling, space;
    *info = (picture_info){.format = ARRIS_GREY8}; /* of 0x0 where there are only tables */
    int r = tjDecompressHeader3(h, data, n, &info->width, &info->height, &sampling, &space);
    if (r < 0)
        r = failed(h, f);
    tjDestroy(h);
    return r;
}

int picture_jpeg_decode(const uint8_t *data, size_t n, const arris_image *out, fault *f) {
    tjhandle h = tjInitDecompress();
    if (!h)
        return no_handle(f);
    int r = tjDecompress2(h, data, n, out->data, out->width, (int)out->stride, out->height,
                          TJPF_GRAY, STRICT);
    if (r < 0)
        r = failed(h, f);
    tjDestroy(h);
    return r;
}
