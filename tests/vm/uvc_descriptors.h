/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * uvc_descriptors.h: the emulated camera's descriptors, as UVC 1.1 lays them out: YUY2, GREY and
 * MJPEG of 320x240 at 15 and 30 frames/s, bulk or isochronous. Also what test_usb and the fuzzer
 * begin with.
 */
#ifndef UVC_DESCRIPTORS_H
#define UVC_DESCRIPTORS_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "pattern.h"

enum {
    UVC_MAX_CONFIGURATION = 512,
    CAMERA_TERMINAL_ID = 1,
    PROCESSING_UNIT_ID = 2,
    CAMERA_CLOCK = 1000000 /* Hz */
};
#define U16(v) (uint8_t)((v)&0xff), (uint8_t)((v) >> 8 & 0xff)
#define U32(v) U16(v), U16((v) >> 16)
#define GUID(a, b, c, d) a, b, c, d, 0, 0, 0x10, 0, 0x80, 0, 0, 0xaa, 0, 0x38, 0x9b, 0x71

typedef struct uvc_bytes {
    uint8_t data[UVC_MAX_CONFIGURATION];
    size_t n;
} uvc_bytes;

static inline void uvc_add(uvc_bytes *b, const uint8_t *part, size_t n) {
    memcpy(b->data + b->n, part, n);
    b->n += n;
}
#define UVC_ADD(b, ...)                                                                            \
    uvc_add(b, (const uint8_t[]){__VA_ARGS__}, sizeof((const uint8_t[]){__VA_ARGS__}))

static inline void uvc_add_frame(uvc_bytes *b, uint8_t subtype, uint32_t bytes) {
    UVC_ADD(b, 34, 0x24, subtype, 1, 0, U16(PATTERN_WIDTH), U16(PATTERN_HEIGHT),
            U32(8 * bytes * 15), U32(8 * bytes * 30), U32(bytes), U32(666666), 2, U32(333333),
            U32(666666));
}

static inline uvc_bytes uvc_configuration(int bulk) {
    uvc_bytes b = {.n = 0};
    UVC_ADD(&b, 9, 2, 0, 0, 2, 1, 0, 0x80, 250); /* the configuration */
    UVC_ADD(&b, 8, 11, 0, 2, 14, 3, 0, 0);       /* both interfaces are one function */
    UVC_ADD(&b, 9, 4, 0, 0, 0, 14, 1, 0, 0);     /* video control, its header: */
    UVC_ADD(&b, 13, 0x24, 1, U16(0x110), U16(13 + 18 + 11 + 9), U32(CAMERA_CLOCK), 1, 1);
    /* automatic exposure, exposure time, focus; brightness, gain */
    UVC_ADD(&b, 18, 0x24, 2, CAMERA_TERMINAL_ID, U16(0x201), 0, 0, U16(0), U16(0), U16(0), 3, 0x2a,
            0, 0);
    UVC_ADD(&b, 11, 0x24, 5, PROCESSING_UNIT_ID, CAMERA_TERMINAL_ID, U16(0), 2, 0x01, 0x02, 0);
    UVC_ADD(&b, 9, 0x24, 3, 3, U16(0x101), 0, PROCESSING_UNIT_ID, 0);
    UVC_ADD(&b, 9, 4, 1, 0, (uint8_t)(bulk != 0), 14, 2, 0, 0); /* video streaming, its header: */
    UVC_ADD(&b, 16, 0x24, 1, 3, U16(16 + 27 + 34 + 27 + 34 + 11 + 34), 0x81, 0, 3, 0, 0, 0, 1, 0, 0,
            0);
    UVC_ADD(&b, 27, 0x24, 4, 1, 1, GUID('Y', 'U', 'Y', '2'), 16, 1, 0, 0, 0, 0);
    uvc_add_frame(&b, 5, 2 * PATTERN_PIXELS);
    UVC_ADD(&b, 27, 0x24, 4, 2, 1, GUID('Y', '8', '0', '0'), 8, 1, 0, 0, 0, 0);
    uvc_add_frame(&b, 5, PATTERN_PIXELS);
    UVC_ADD(&b, 11, 0x24, 6, 3, 1, 1, 1, 0, 0, 0, 0);
    uvc_add_frame(&b, 7, 2 * PATTERN_PIXELS);
    if (bulk) {
        UVC_ADD(&b, 7, 5, 0x81, 2, U16(512), 0);
    } else {
        UVC_ADD(&b, 9, 4, 1, 1, 1, 14, 2, 0, 0);
        UVC_ADD(&b, 7, 5, 0x81, 5, U16(512), 1);
        UVC_ADD(&b, 9, 4, 1, 2, 1, 14, 2, 0, 0);
        UVC_ADD(&b, 7, 5, 0x81, 5, U16(1024), 1);
    }
    b.data[2] = (uint8_t)b.n;
    b.data[3] = (uint8_t)(b.n >> 8);
    return b;
}

#endif
