/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * usbcam_control.c: the emulated camera's descriptors and controls, and what it grants of a stream.
 */
#include <errno.h>
#include <linux/usb/video.h>

#include "usbcam.h"
#include "uvc_descriptors.h"

static const char *const strings[] = {"Arris", "Arris test camera", "A0123"};

static size_t string_descriptor(unsigned index, uint8_t *to) {
    if (index == 0)
        return memcpy(to, (const uint8_t[]){4, 3, 9, 4}, 4), 4;
    if (index > 3)
        return 0;
    size_t n = strlen(strings[index - 1]);
    to[0] = (uint8_t)(2 + 2 * n);
    to[1] = 3;
    for (size_t i = 0; i < n; i++) {
        to[2 + 2 * i] = (uint8_t)strings[index - 1][i];
        to[3 + 2 * i] = 0;
    }
    return 2 + 2 * n;
}

static size_t descriptor(unsigned type, unsigned index, uint8_t *to) {
    static const uint8_t device[] = {18,          1,           U16(0x200),  0xef, 2, 1, 64,
                                     U16(0x1d6b), U16(0x0102), U16(0x0100), 1,    2, 3, 1};
    if (type == 1)
        return memcpy(to, device, sizeof device), sizeof device;
    if (type == 2) {
        uvc_bytes b = uvc_configuration(cam.bulk);
        if (cam.option[BROKEN] > 0)
            b.data[cam.option[BROKEN]] = 0xff;
        return memcpy(to, b.data, b.n), b.n;
    }
    return type == 3 ? string_descriptor(index, to) : 0;
}

typedef struct setting {
    uint8_t entity, selector, size;
    void *value;
    uint32_t min, max, step, usual;
} setting;

static const setting settings[] = {
    {CAMERA_TERMINAL_ID, UVC_CT_AE_MODE_CONTROL, 1, &cam.exposure_mode, 1, 1, 9, 8},
    {CAMERA_TERMINAL_ID, UVC_CT_EXPOSURE_TIME_ABSOLUTE_CONTROL, 4, &cam.exposure, 1, 5000, 1, 156},
    {CAMERA_TERMINAL_ID, UVC_CT_FOCUS_ABSOLUTE_CONTROL, 2, &cam.focus, 0, 250, 5, 0},
    {PROCESSING_UNIT_ID, UVC_PU_BRIGHTNESS_CONTROL, 2, &cam.brightness, 0xffc0, 64, 1, 0},
    {PROCESSING_UNIT_ID, UVC_PU_GAIN_CONTROL, 2, &cam.gain, 0, 100, 1, 16},
};

/* The size of a control's answer; -1: a stall. `out` are the bytes that came, when some did. */
static int control(const uint8_t *setup, const uint8_t *out, uint8_t *to) {
    for (const setting *s = settings; s < settings + sizeof settings / sizeof *settings; s++) {
        uint32_t v = setup[1] == UVC_GET_MIN   ? s->min
                     : setup[1] == UVC_GET_MAX ? s->max
                     : setup[1] == UVC_GET_RES ? s->step
                                               : s->usual;
        if (s->entity != setup[5] || s->selector != setup[3])
            continue;
        if (setup[1] == UVC_SET_CUR)
            memcpy(s->value, out, s->size);
        else if (setup[1] == UVC_GET_CUR)
            memcpy(to, s->value, s->size);
        else if (setup[1] == UVC_GET_INFO)
            return to[0] = 3, 1;
        else if (setup[1] == UVC_GET_LEN)
            return to[0] = s->size, to[1] = 0, 2;
        else
            put32(to, v);
        return s->size;
    }
    return -1;
}

static void start_stream(void) {
    cam.streams = true;
    cam.halted = cam.begun = false;
    cam.sent = cam.in_payload = 0;
    cam.due = now_us();
}

/* Probe and commit, selectors 1 and 2: what is asked for is granted, its sizes filled in. */
static int streaming(const uint8_t *setup, const uint8_t *out, uint8_t *to) {
    if (setup[3] != UVC_VS_PROBE_CONTROL && setup[3] != UVC_VS_COMMIT_CONTROL)
        return -1;
    if (setup[1] == UVC_GET_INFO)
        return to[0] = 3, 1;
    if (setup[1] == UVC_GET_LEN)
        return to[0] = sizeof cam.probe, to[1] = 0, 2;
    uint8_t *p = cam.probe;
    if (setup[1] == UVC_SET_CUR)
        memcpy(p, out, sizeof cam.probe);
    p[2] = p[2] >= 1 && p[2] <= 3 ? p[2] : 1;
    p[3] = 1;
    uint32_t interval = (uint32_t)p[4] | (uint32_t)p[5] << 8 | (uint32_t)p[6] << 16,
             size = p[2] == 2 ? PATTERN_PIXELS : 2 * PATTERN_PIXELS;
    put32(p + 4, interval > 0 && interval < 500000 ? 333333 : 666666);
    put32(p + 18, size);
    put32(p + 22, cam.bulk ? size + HEADER + EXCESS : PACKET);
    put32(p + 26, CAMERA_CLOCK);
    memcpy(to, p, sizeof cam.probe);
    if (setup[1] == UVC_SET_CUR && setup[3] == UVC_VS_COMMIT_CONTROL && cam.bulk)
        start_stream();
    return sizeof cam.probe;
}

void on_control(uint32_t number, const uint8_t *setup, uint32_t length) {
    uint8_t out[OUT_MAX] = {0}, to[OUT_MAX] = {0};
    bool in = setup[0] & 0x80;
    int n = -1;
    if (!in && length && (length > sizeof out || !read_all(out, length)))
        die("too much data");
    if ((setup[0] & 0x60) == 0x20) {
        n = setup[4] == 0 && setup[5] ? control(setup, out, to)
            : setup[4] == 1           ? streaming(setup, out, to)
                                      : -1;
    } else if (setup[1] == 6) { /* GET_DESCRIPTOR */
        size_t size = descriptor(setup[3], setup[2], to);
        n = size ? (int)size : -1;
    } else if (setup[1] == 0 || setup[1] == 9) { /* GET_STATUS, SET_CONFIGURATION */
        n = in ? 2 : 0;
    } else if (setup[1] == 11) { /* SET_INTERFACE */
        n = 0;
        if (setup[4] == 1 && setup[2])
            start_stream();
        else if (setup[4] == 1)
            cam.streams = false;
    } else if (setup[1] == 1) { /* CLEAR_FEATURE: the halt */
        cam.halted = false;
        n = 0;
    }
    if (n > (int)length)
        n = (int)length;
    answer(number, n < 0 ? -EPIPE : 0, in && n > 0 ? to : NULL,
           n < 0 ? 0
           : in  ? (size_t)n
                 : length);
}
