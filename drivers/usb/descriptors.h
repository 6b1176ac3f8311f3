/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * descriptors.h: what a USB video camera says about itself, from its raw configuration descriptor.
 * (USB 2.0, section 9.6; USB Video Class 1.1, section 3 and the payloads' own documents.)
 */
#ifndef USB_DESCRIPTORS_H
#define USB_DESCRIPTORS_H

#include "camera/pixels.h"
#include "fault.h"

enum { UVC_FRAMES = 128, UVC_ALTERNATES = 32, UVC_INTERVALS = 16 };

/* One size in one pixel format. */
typedef struct uvc_frame {
    const pixels *pixels;
    uint8_t format, frame;               /* the camera's indices */
    uint16_t width, height;              /* px, 1 to 16384 */
    uint32_t usual;                      /* interval, 100 ns, not 0 */
    uint32_t n, interval[UVC_INTERVALS]; /* those that there are, none of them 0; */
    uint32_t step;                       /* or, when not 0, from interval[0] to [1] by this */
} uvc_frame;

/* A setting of the streaming interface that has an endpoint. */
typedef struct uvc_alternate {
    uint8_t setting, endpoint;
    bool bulk;
    uint32_t packet; /* bytes, in one (micro)frame, not 0 */
} uvc_alternate;

typedef struct uvc_camera {
    uint8_t control, streaming; /* the interfaces' numbers */
    uint16_t version;           /* 0x0110: UVC 1.1 */
    uint32_t clock;             /* Hz, of the camera's time stamps; 0: unknown */
    uint8_t terminal, unit;     /* ids of camera terminal and processing unit; 0: none */
    uint32_t terminal_controls, unit_controls; /* bits of the controls that they have */
    uint32_t n_frames, n_alternates;
    uvc_frame frame[UVC_FRAMES]; /* only those whose pixels we know */
    uvc_alternate alternate[UVC_ALTERNATES];
} uvc_camera;

/* Parses the n bytes of a configuration descriptor: the first video control interface and the first
 * streaming interface with pictures that we know. Nothing in it is trusted; a part that is too
 * short or does not fit is passed over. Returns 0, or ARRIS_E_INPUT when it is no camera or its
 * descriptors are not even a list. Any thread. */
int uvc_parse(const uint8_t *data, size_t n, uvc_camera *c, fault *f);

/* The frame's interval nearest to 1/fps, 100 ns; fps 0: the usual one. */
uint32_t uvc_interval(const uvc_frame *frame, double fps);

#endif
