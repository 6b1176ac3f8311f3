/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * format.h: settles with a device what pictures it sends.
 */
#ifndef V4L2_FORMAT_H
#define V4L2_FORMAT_H

#include "camera/pixels.h"
#include "device.h"

enum { FIELDS_AUTO, FIELDS_TOP, FIELDS_BOTTOM, FIELDS_WEAVE };
#define FIELDS_WORDS "auto|top|bottom|weave"

typedef struct wish {
    int32_t pixels;        /* an index of PIXELS_WORDS; 0: any that we know, the best first */
    int32_t width, height; /* px, of the whole frame; 0: as it is set */
    double fps;            /* 0: as it is set */
    int32_t fields;
} wish;

typedef struct format {
    const pixels *pixels;
    int32_t width, height; /* px, of the pictures that are handed on */
    size_t first, stride;  /* bytes: where a picture begins in a buffer, and from row to row */
    size_t bytes;          /* that a whole buffer holds; 0: it depends */
    uint32_t only;         /* V4L2_FIELD_TOP or _BOTTOM: other buffers are passed over; 0: none */
    bool woven;            /* the rows of two fields, exposed one after the other */
    double fps;            /* 0: unknown */
} format;

/* Sets the format and reads back what the device made of it: whatever is not as it was wished is a
 * fault. Returns 0, or ARRIS_E_USAGE, ARRIS_E_INPUT, ARRIS_E_IO. */
int format_settle(const device *d, const wish *w, format *out, fault *f);

/* The sizes of a pixel format as a text, "640x480, 1280x720", cut when it is long. */
void format_sizes(const device *d, uint32_t fourcc, char *text, size_t size);

/* The rates of a size likewise, "30, 15". */
void format_rates(const device *d, uint32_t fourcc, uint32_t width, uint32_t height, char *text,
                  size_t size);

#endif
