/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * pixels.h: the pixel formats of cameras, and how each becomes grey. One table for all drivers.
 *
 * Luma is taken as the camera sends it; RGB becomes Rec. 601 luma by the formula that decodes
 * pictures from files. 10 and 12 bits are spread over the 16 by repeating their upper bits.
 */
#ifndef PIXELS_H
#define PIXELS_H

#include "fault.h"

typedef struct pixels {
    const char *name;         /* as users write it: "YUYV" */
    uint32_t fourcc;          /* as V4L2 and UVC's GUIDs have it, the first letter lowest */
    enum arris_format format; /* of the grey image */
    int32_t bytes;            /* of a pixel in a row of its (first) plane; 0: compressed */
    int32_t lines;            /* twice the rows that all planes have per row of the picture */
    bool plain;               /* its rows are those of the grey image as they are */
    void (*row)(const uint8_t *in, uint8_t *out, int32_t width);
} pixels;

/* In the order of preference: without loss and cheapest first; the last has name NULL. */
extern const pixels pixels_table[];

/* "GREY|Y10|..." after "auto|", for property tables: word i is pixels_table[i - 1]. */
#define PIXELS_WORDS "auto|GREY|Y16|Y12|Y10|NV12|YUYV|UYVY|RGB3|MJPEG"

/* NULL when we know no such format. Any thread. */
const pixels *pixels_find(uint32_t fourcc);

/* Bytes that a picture takes with `stride` bytes a row; 0: compressed, so as many as it takes. */
size_t pixels_size(const pixels *p, int32_t height, size_t stride);

/* What decodes compressed pictures; one a stream. */
typedef struct pixels_decoder {
    void *jpeg; /* NULL until it is needed */
} pixels_decoder;

/* Converts the n bytes at `data`, rows of `stride` bytes, into `out`, whose size is the picture's
 * and whose format is p->format. One thread at a time per decoder. Returns 0, or ARRIS_E_INPUT when
 * bytes are missing or damaged, or ARRIS_E_MEMORY; then the pixels mean nothing. */
int pixels_convert(const pixels *p, pixels_decoder *d, const uint8_t *data, size_t n, size_t stride,
                   const arris_image *out, fault *f);

void pixels_decoder_free(pixels_decoder *d);

#endif
