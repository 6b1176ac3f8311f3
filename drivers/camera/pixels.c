/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * pixels.c: camera pixels to grey, many at a time. Samples of more than 8 bits come with the
 * low byte first, which is how the machines that we run on have them too.
 */
#include "pixels.h"

#include <string.h>
#include <turbojpeg.h>

#include "edges/path.h"

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "16 bit samples need their bytes turned");

enum { LANES = 16 };
typedef uint8_t bytes16 __attribute__((vector_size(LANES)));
typedef uint16_t words16 __attribute__((vector_size(2 * LANES)));

/* ---- rows ------------------------------------------------------------------------------------ */

static void row_grey8(const uint8_t *in, uint8_t *out, int32_t width) {
    memcpy(out, in, (size_t)width);
}

static void row_grey16(const uint8_t *in, uint8_t *out, int32_t width) {
    memcpy(out, in, 2 * (size_t)width);
}

/* The luma of 4:2:2: the lower or the upper byte of each word. */
static inline void row_422(const uint8_t *in, uint8_t *out, int32_t width, int shift) {
    int32_t x = 0;
    for (; x + LANES <= width; x += LANES) {
        words16 w;
        memcpy(&w, in + 2 * x, sizeof w);
        bytes16 y = __builtin_convertvector(w >> shift & 0xff, bytes16);
        memcpy(out + x, &y, sizeof y);
    }
    for (; x < width; x++)
        out[x] = in[2 * x + shift / 8];
}

static void row_yuyv(const uint8_t *in, uint8_t *out, int32_t width) {
    row_422(in, out, width, 0);
}

static void row_uyvy(const uint8_t *in, uint8_t *out, int32_t width) {
    row_422(in, out, width, 8);
}

/* Of `bits` bits; what a camera leaves in the upper ones is cut off. */
static inline void row_deep(const uint8_t *in, uint8_t *out, int32_t width, int bits) {
    int left = 16 - bits, right = 2 * bits - 16;
    int32_t x = 0;
    for (; x + LANES <= width; x += LANES) {
        words16 w;
        memcpy(&w, in + 2 * x, sizeof w);
        w = w << left;
        w |= w >> (right + left);
        memcpy(out + 2 * x, &w, sizeof w);
    }
    for (; x < width; x++) {
        uint16_t w;
        memcpy(&w, in + 2 * x, sizeof w);
        w = (uint16_t)(w << left);
        w |= (uint16_t)(w >> (right + left));
        memcpy(out + 2 * x, &w, sizeof w);
    }
}

static void row_y10(const uint8_t *in, uint8_t *out, int32_t width) {
    row_deep(in, out, width, 10);
}

static void row_y12(const uint8_t *in, uint8_t *out, int32_t width) {
    row_deep(in, out, width, 12);
}

/* 0.299 R + 0.587 G + 0.114 B in 16 bits of fraction, as libjpeg has it. */
INLINE void luma(const uint8_t *restrict in, uint8_t *restrict out, int32_t width) {
    for (int32_t x = 0; x < width; x++)
        out[x] = (uint8_t)((19595u * in[3 * x] + 38470u * in[3 * x + 1] + 7471u * in[3 * x + 2] +
                            32768u) >>
                           16);
}

AVX2_PATH static void luma_avx2(const uint8_t *in, uint8_t *out, int32_t width) {
    luma(in, out, width);
}

static void row_rgb3(const uint8_t *in, uint8_t *out, int32_t width) {
    if (path_available(PATH_AVX2))
        luma_avx2(in, out, width);
    else
        luma(in, out, width);
}

/* ---- the table ------------------------------------------------------------------------------- */

#define CODE(a, b, c, d)                                                                           \
    ((uint32_t)(a) | (uint32_t)(b) << 8 | (uint32_t)(c) << 16 | (uint32_t)(d) << 24)

const pixels pixels_table[] = {
    {"GREY", CODE('G', 'R', 'E', 'Y'), ARRIS_GREY8, 1, 2, true, row_grey8},
    {"Y16", CODE('Y', '1', '6', ' '), ARRIS_GREY16, 2, 2, true, row_grey16},
    {"Y12", CODE('Y', '1', '2', ' '), ARRIS_GREY16, 2, 2, false, row_y12},
    {"Y10", CODE('Y', '1', '0', ' '), ARRIS_GREY16, 2, 2, false, row_y10},
    {"NV12", CODE('N', 'V', '1', '2'), ARRIS_GREY8, 1, 3, true, row_grey8},
    {"YUYV", CODE('Y', 'U', 'Y', 'V'), ARRIS_GREY8, 2, 2, false, row_yuyv},
    {"UYVY", CODE('U', 'Y', 'V', 'Y'), ARRIS_GREY8, 2, 2, false, row_uyvy},
    {"RGB3", CODE('R', 'G', 'B', '3'), ARRIS_GREY8, 3, 2, false, row_rgb3},
    {"MJPEG", CODE('M', 'J', 'P', 'G'), ARRIS_GREY8, 0, 0, false, NULL},
    {.name = NULL},
};

const pixels *pixels_find(uint32_t fourcc) {
    for (const pixels *p = pixels_table; p->name; p++)
        if (p->fourcc == fourcc)
            return p;
    return NULL;
}

size_t pixels_size(const pixels *p, int32_t height, size_t stride) {
    return stride * (size_t)height * (size_t)p->lines / 2;
}

/* ---- pictures -------------------------------------------------------------------------------- */

/* A warning is an error here: what libjpeg fills in for damaged data would be measured as edges. */
static int decode_jpeg(pixels_decoder *d, const uint8_t *data, size_t n, const arris_image *out,
                       fault *f) {
    int width, height, sampling, space;
    if (!d->jpeg && !(d->jpeg = tjInitDecompress()))
        return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for the JPEG decoder");
    if (tjDecompressHeader3(d->jpeg, data, n, &width, &height, &sampling, &space) < 0)
        return fault_set(f, ARRIS_E_INPUT, NULL, "no JPEG: %s", tjGetErrorStr2(d->jpeg));
    if (width != out->width || height != out->height)
        return fault_set(f, ARRIS_E_INPUT, NULL, "a JPEG of %dx%d, not %dx%d", width, height,
                         out->width, out->height);
    if (tjDecompress2(d->jpeg, data, n, out->data, width, (int)out->stride, height, TJPF_GRAY,
                      TJFLAG_STOPONWARNING | TJFLAG_LIMITSCANS) < 0)
        return fault_set(f, ARRIS_E_INPUT, NULL, "a damaged JPEG: %s", tjGetErrorStr2(d->jpeg));
    return 0;
}

int pixels_convert(const pixels *p, pixels_decoder *d, const uint8_t *data, size_t n, size_t stride,
                   const arris_image *out, fault *f) {
    if (!p->bytes)
        return decode_jpeg(d, data, n, out, f);
    size_t row = (size_t)out->width * (size_t)p->bytes;
    size_t need = stride * (size_t)(out->height - 1) + row;
    if (stride < row || n < need)
        return fault_set(f, ARRIS_E_INPUT, NULL, "%zu bytes of %zu", n, need);
    for (int32_t y = 0; y < out->height; y++)
        p->row(data + (size_t)y * stride, out->data + y * out->stride, out->width);
    return 0;
}

void pixels_decoder_free(pixels_decoder *d) {
    if (d->jpeg)
        tjDestroy(d->jpeg);
    d->jpeg = NULL;
}
