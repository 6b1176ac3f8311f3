/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * descriptors.c: what a USB video camera says about itself.
 */
#include "descriptors.h"

#include <math.h>
#include <string.h>

enum { /* descriptor types, and the subtypes of the video class */
       INTERFACE = 4,
       ENDPOINT = 5,
       CLASS_INTERFACE = 0x24,
       COMPANION = 0x30,
       VIDEO = 0x0e,
       CONTROL = 1,
       STREAMING = 2,
       HEADER = 1,
       INPUT_TERMINAL = 2,
       PROCESSING_UNIT = 5,
       FORMAT_UNCOMPRESSED = 4,
       FRAME_UNCOMPRESSED = 5,
       FORMAT_MJPEG = 6,
       FRAME_MJPEG = 7,
       CAMERA_TERMINAL = 0x0201,
       BULK = 2,
       ISOCHRONOUS = 1,
       MAX_SIDE = 16384
};

typedef struct parser {
    uvc_camera *c;
    int subclass, number, setting; /* of the interface it is in; subclass 0: of none of ours */
    bool has_control, has_streaming;
    uint8_t endpoint;     /* of the pictures; the interface may have one for stills as well */
    const pixels *pixels; /* of the format it is in; NULL: unknown */
    uint8_t format;
    uvc_alternate *last; /* that a companion would belong to */
} parser;

static uint16_t get16(const uint8_t *p) {
    return (uint16_t)(p[0] | p[1] << 8);
}

static uint32_t get32(const uint8_t *p) {
    return (uint32_t)get16(p) | (uint32_t)get16(p + 2) << 16;
}

/* A bit map of `size` bytes, the first four of them. */
static uint32_t get_bits(const uint8_t *p, unsigned size) {
    uint32_t bits = 0;
    for (unsigned i = 0; i < size && i < 4; i++)
        bits |= (uint32_t)p[i] << 8 * i;
    return bits;
}

/* Formats have GUIDs, of which the first four bytes are a code of four letters or a number. */
static const pixels *pixels_of(const uint8_t *guid) {
    static const struct {
        char guid[5];
        const char *name;
    } known[] = {{"YUY2", "YUYV"}, {"UYVY", "UYVY"}, {"NV12", "NV12"}, {"Y800", "GREY"},
                 {"GREY", "GREY"}, {"Y8  ", "GREY"}, {"Y10 ", "Y10"},  {"Y12 ", "Y12"},
                 {"Y16 ", "Y16"},  {"2\0\0", "GREY"} /* D3DFMT_L8 */};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        for (const pixels *p = pixels_table; p->name && !memcmp(known[i].guid, guid, 4); p++)
            if (strcmp(p->name, known[i].name) == 0)
                return p;
    return NULL;
}

static const pixels *mjpeg(void) {
    return pixels_find((uint32_t)'M' | 'J' << 8 | 'P' << 16 | (uint32_t)'G' << 24);
}

/* ---- interfaces ------------------------------------------------------------------------------ */

static void begin_interface(parser *p, const uint8_t *d, size_t n) {
    p->subclass = 0;
    p->pixels = NULL;
    p->last = NULL;
    if (n < 9 || d[5] != VIDEO)
        return;
    p->number = d[2];
    p->setting = d[3];
    if (d[6] == CONTROL && !p->has_control) {
        p->subclass = CONTROL;
        p->has_control = true;
        p->c->control = d[2];
    } else if (d[6] == STREAMING && p->has_control &&
               (!p->has_streaming || p->c->streaming == d[2] || !p->c->n_frames)) {
        if (!p->has_streaming || p->c->streaming != d[2])
            p->c->n_alternates = p->c->n_frames = 0;
        p->subclass = STREAMING;
        p->has_streaming = true;
        p->c->streaming = d[2];
    }
}

static void endpoint(parser *p, const uint8_t *d, size_t n) {
    p->last = NULL;
    if (p->subclass != STREAMING || n < 7 || !(d[2] & 0x80) || d[2] != p->endpoint ||
        p->c->n_alternates == UVC_ALTERNATES)
        return;
    int kind = d[3] & 3;
    uint32_t size = get16(d + 4), packet = (size & 0x7ff) * (1 + (size >> 11 & 3));
    if ((kind != BULK && kind != ISOCHRONOUS) || packet == 0)
        return;
    p->last = &p->c->alternate[p->c->n_alternates++];
    *p->last = (uvc_alternate){
        .setting = (uint8_t)p->setting, .endpoint = d[2], .bulk = kind == BULK, .packet = packet};
}

/* SuperSpeed says here how much an isochronous endpoint sends in an interval. */
static void companion(parser *p, const uint8_t *d, size_t n) {
    if (p->last && n >= 6 && !p->last->bulk && get16(d + 4))
        p->last->packet = get16(d + 4);
}

/* ---- the class's own ------------------------------------------------------------------------- */

static void control_part(parser *p, const uint8_t *d, size_t n) {
    uvc_camera *c = p->c;
    if (d[2] == HEADER && n >= 12) {
        c->version = get16(d + 3);
        c->clock = get32(d + 7);
    } else if (d[2] == INPUT_TERMINAL && n >= 15 && get16(d + 4) == CAMERA_TERMINAL &&
               n >= 15u + d[14] && !c->terminal) {
        c->terminal = d[3];
        c->terminal_controls = get_bits(d + 15, d[14]);
    } else if (d[2] == PROCESSING_UNIT && n >= 8 && n >= 8u + d[7] && !c->unit) {
        c->unit = d[3];
        c->unit_controls = get_bits(d + 8, d[7]);
    }
}

static bool intervals(uvc_frame *f, const uint8_t *d, size_t n) {
    unsigned count = d[25];
    if (count == 0) { /* a range: least, greatest, step */
        if (n < 38)
            return false;
        f->interval[0] = get32(d + 26);
        f->interval[1] = get32(d + 30);
        f->step = get32(d + 34);
        f->step = f->step ? f->step : 1;
        f->n = 2;
        return f->interval[0] && f->interval[1] >= f->interval[0];
    }
    for (unsigned i = 0; i < count && n >= 30 + 4 * i && f->n < UVC_INTERVALS; i++)
        if (get32(d + 26 + 4 * i))
            f->interval[f->n++] = get32(d + 26 + 4 * i);
    return f->n > 0;
}

static void frame(parser *p, const uint8_t *d, size_t n) {
    if (!p->pixels || n < 26 || p->c->n_frames == UVC_FRAMES)
        return;
    uvc_frame f = {.pixels = p->pixels,
                   .format = p->format,
                   .frame = d[3],
                   .width = get16(d + 5),
                   .height = get16(d + 7),
                   .usual = get32(d + 21)};
    if (!f.width || !f.height || f.width > MAX_SIDE || f.height > MAX_SIDE || !intervals(&f, d, n))
        return;
    f.usual = f.usual ? f.usual : f.interval[0];
    p->c->frame[p->c->n_frames++] = f;
}

static void streaming_part(parser *p, const uint8_t *d, size_t n) {
    bool jpeg = d[2] == FORMAT_MJPEG && n >= 11;
    if (d[2] == HEADER && n >= 7) {
        p->endpoint = d[6];
    } else if (jpeg || (d[2] == FORMAT_UNCOMPRESSED && n >= 27)) {
        p->format = d[3];
        p->pixels = jpeg ? mjpeg() : pixels_of(d + 5);
    } else if ((d[2] == FRAME_UNCOMPRESSED && p->pixels && p->pixels->bytes) ||
               (d[2] == FRAME_MJPEG && p->pixels && !p->pixels->bytes)) {
        frame(p, d, n);
    }
}

static void part(parser *p, const uint8_t *d, size_t n) {
    if (d[1] == INTERFACE)
        begin_interface(p, d, n);
    else if (d[1] == ENDPOINT)
        endpoint(p, d, n);
    else if (d[1] == COMPANION)
        companion(p, d, n);
    else if (d[1] == CLASS_INTERFACE && n >= 4 && p->subclass == CONTROL)
        control_part(p, d, n);
    else if (d[1] == CLASS_INTERFACE && n >= 4 && p->subclass == STREAMING)
        streaming_part(p, d, n);
}

int uvc_parse(const uint8_t *data, size_t n, uvc_camera *c, fault *f) {
    *c = (uvc_camera){.n_frames = 0};
    parser p = {.c = c};
    for (size_t at = 0; at < n; at += data[at]) {
        if (n - at < 2 || data[at] < 2 || data[at] > n - at)
            return fault_set(f, ARRIS_E_INPUT, NULL, "the descriptors are damaged at byte %zu", at);
        part(&p, data + at, data[at]);
    }
    if (!p.has_control || !p.has_streaming)
        return fault_set(f, ARRIS_E_INPUT, NULL, "it is no video camera");
    if (!c->n_frames)
        return fault_set(f, ARRIS_E_INPUT, NULL, "it sends none of the formats %s",
                         strchr(PIXELS_WORDS, '|') + 1);
    if (!c->n_alternates)
        return fault_set(f, ARRIS_E_INPUT, NULL, "it has no endpoint to send pictures by");
    return 0;
}

uint32_t uvc_interval(const uvc_frame *frame, double fps) {
    if (fps <= 0)
        return frame->usual;
    double wanted = 1e7 / fps, least = frame->interval[0];
    if (frame->step) {
        double most = frame->interval[1], steps = round((wanted - least) / frame->step);
        return (uint32_t)(wanted <= least ? least : fmin(most, least + steps * frame->step));
    }
    uint32_t best = frame->interval[0];
    for (uint32_t i = 1; i < frame->n; i++)
        if (fabs(frame->interval[i] - wanted) < fabs(best - wanted))
            best = frame->interval[i];
    return best;
}
