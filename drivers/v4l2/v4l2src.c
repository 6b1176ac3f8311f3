/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * v4l2src.c: the stage `v4l2src`: a camera or frame grabber through V4L2.
 *
 * Automatic exposure, gain, focus and zoom are off unless asked for: a lens that moves is another
 * camera model, and grey levels that change by themselves move edges. Whatever goes wrong while it
 * streams (the camera is unplugged, the driver fails, nothing comes) is handled in one way: the
 * device is closed, looked for, opened and set up anew.
 */
#include <stdlib.h>
#include <string.h>

#include "camera/live.h"
#include "capture.h"
#include "format.h"

enum { SLICE = 100 /* ms */ };
static const int64_t incredible = 60000000000; /* ns, between a stamp and now */

struct v4l2src {
    const char *wanted, *input, *standard, *controls;
    wish wish;
    int32_t buffers;
    live live;

    device device;
    format format;
    capture capture;
    pixels_decoder decoder;
    double exposure;       /* ms; 0: unknown */
    int64_t index, heard;  /* of the next frame; ns, when the last one came */
    uint32_t sequence;     /* of the last frame, by the driver */
    bool counting, warned; /* sequence is known; of stamps */
};

/* ---- opening --------------------------------------------------------------------------------- */

/* A camera is looked for by its serial number, which stays when its path changes. */
static const char *sought(const struct v4l2src *v) {
    return *v->device.serial ? v->device.serial : *v->device.path ? v->device.path : v->wanted;
}

static int open_device(arris_stage *s, struct v4l2src *v, format *out, fault *f) {
    device d;
    fault calm;
    int r = device_open(&d, sought(v), f);
    if (r < 0)
        return r;
    v->device = d;
    controls all = device_controls(&d);
    r = device_select(&d, v->input, v->standard, f);
    if (r == 0)
        r = format_settle(&d, &v->wish, out, f);
    if (r == 0 && controls_calm(&all, &calm) < 0)
        arris_warn(s, "%s", calm.text);
    if (r == 0)
        r = controls_set(&all, v->controls, f);
    if (r == 0)
        v->exposure = controls_exposure(&all);
    return r;
}

static int setup(arris_stage *s, void *self, arris_caps *caps) {
    struct v4l2src *v = self;
    fault f;
    v->device.fd = -1;
    int r = open_device(s, v, &v->format, &f);
    if (r < 0)
        return arris_fail(s, r, f.hint, "%s", f.text);
    if (v->format.woven)
        arris_warn(s, "two fields are woven into each frame, exposed one after the other: edges of "
                      "what moves will be torn; use fields=top while the camera moves");
    *caps = (arris_caps){.format = v->format.pixels->format,
                         .width = v->format.width,
                         .height = v->format.height,
                         .fps = v->format.fps};
    return live_setup(s, &v->live, caps);
}

static int reopen(arris_stage *s, struct v4l2src *v, fault *f) {
    format now;
    int r = open_device(s, v, &now, f);
    if (r < 0)
        return r;
    bool same = now.pixels->format == v->format.pixels->format && now.width == v->format.width &&
                now.height == v->format.height;
    v->format = same ? now : v->format;
    return same ? 0
                : fault_set(f, ARRIS_E_IO, NULL, "it sends %dx%d now, not %dx%d", now.width,
                            now.height, v->format.width, v->format.height);
}

/* ---- losing and finding ---------------------------------------------------------------------- */

static int start(arris_stage *s, struct v4l2src *v, fault *f) {
    int r = v->device.fd < 0 ? reopen(s, v, f) : 0;
    if (r == 0)
        r = capture_start(&v->capture, v->device.fd, (unsigned)v->buffers, f);
    v->counting = false;
    v->heard = arris_now();
    return r;
}

/* Frames downstream may still look into the buffers: unmapped are they when it is tried again. */
static void lose(arris_stage *s, struct v4l2src *v, const fault *why) {
    live_lost(s, &v->live, why);
    capture_stop(&v->capture);
}

/* Returns 0 when it streams again, else as live_wait. */
static int find(arris_stage *s, struct v4l2src *v, fault *why) {
    for (;;) {
        int r = live_wait(s, &v->live, why);
        if (r)
            return r;
        if (capture_is_held(&v->capture, s))
            continue;
        capture_free(&v->capture);
        device_close(&v->device);
        if (start(s, v, why) == 0)
            return 0;
        capture_stop(&v->capture);
    }
}

/* ---- frames ---------------------------------------------------------------------------------- */

/* Counts what the driver says it has left out, and tells whether the buffer can be used. Drivers
 * that work in parallel may hand out a frame after a later one, when it has been missed already;
 * some give two fields one number, or begin anew. */
static bool is_good(arris_stage *s, struct v4l2src *v, const struct v4l2_buffer *b) {
    int32_t step = v->counting ? (int32_t)(b->sequence - v->sequence) : 1;
    bool late = step < 0 && step > -CAPTURE_MOST;
    if (v->format.only && b->field != v->format.only)
        return false;
    arris_count(s, "late", late);
    if (late)
        return false;
    int32_t missed = step > 1 ? step - 1 : 0;
    v->sequence = b->sequence;
    v->counting = true;
    v->index += 1 + missed;
    arris_count(s, "missed", (uint64_t)missed);
    bool damaged = b->flags & V4L2_BUF_FLAG_ERROR || b->bytesused < v->format.bytes ||
                   b->bytesused > b->length;
    arris_count(s, "damaged", damaged);
    return !damaged;
}

static bool lends(const struct v4l2src *v) {
    return v->format.pixels->plain && v->format.stride % 64 == 0 && v->format.first % 64 == 0 &&
           capture_may_lend(&v->capture);
}

static int fill(arris_stage *s, struct v4l2src *v, const struct v4l2_buffer *b, arris_frame *frame,
                fault *f) {
    arris_image *image = arris_layer_give(s, frame, ARRIS_IMAGE);
    int r = capture_reclaim(&v->capture, s, image, f);
    if (r < 0)
        return r;
    if (lends(v)) {
        capture_lend(&v->capture, b->index, image, v->format.first, v->format.stride);
        return 0;
    }
    fault damage;
    bool bad = pixels_convert(v->format.pixels, &v->decoder,
                              v->capture.buffer[b->index].data + v->format.first,
                              b->bytesused - v->format.first, v->format.stride, image, &damage);
    arris_count(s, "copied", !bad);
    arris_count(s, "damaged", bad);
    r = capture_queue(&v->capture, b->index, f);
    return r < 0 ? r : bad;
}

/* A stamp of another clock, or from nowhere, is replaced by now: the end of the frame at latest. */
static void date(arris_stage *s, struct v4l2src *v, const struct v4l2_buffer *b,
                 arris_frame *frame) {
    int64_t now = arris_now(),
            stamp = (int64_t)b->timestamp.tv_sec * 1000000000 + b->timestamp.tv_usec * 1000;
    bool monotonic = (b->flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
    bool start = (b->flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
    start = start && !v->device.stamps_arrival;
    bool good = monotonic && llabs(now - stamp) < incredible;
    if (!good && !v->warned)
        arris_warn(s, "the driver's time stamps are not those of this machine's clock: frames are "
                      "dated when they arrive");
    v->warned |= !good;
    arris_count(s, "undated", !good);
    live_frame(&v->live, frame, v->index - 1, good ? stamp : now, good && start, v->exposure);
}

/* Returns 1 when the frame has its image, 0 when none has come yet, or an error. */
static int take(arris_stage *s, struct v4l2src *v, arris_frame *frame, fault *f) {
    struct v4l2_buffer b;
    int r = capture_reclaim(&v->capture, s, NULL, f);
    if (r == 0)
        r = capture_wait(&v->capture, SLICE, &b, f);
    if (r == 0 && (double)(arris_now() - v->heard) > v->live.timeout * 1e6)
        return fault_set(f, ARRIS_E_IO, NULL, "it has sent nothing for %g ms", v->live.timeout);
    if (r <= 0)
        return r;
    v->heard = arris_now();
    if (!is_good(s, v, &b))
        return capture_queue(&v->capture, b.index, f);
    r = fill(s, v, &b, frame, f);
    if (r)
        return r < 0 ? r : 0;
    date(s, v, &b, frame);
    return 1;
}

static int process(arris_stage *s, void *self, arris_frame *frame) {
    struct v4l2src *v = self;
    fault why;
    while (arris_running(s) && !live_done(&v->live)) {
        int r = v->capture.on ? take(s, v, frame, &why) : start(s, v, &why);
        if (r < 0) {
            lose(s, v, &why);
            r = find(s, v, &why);
            if (r)
                return r;
        } else if (r > 0) {
            live_found(s, &v->live);
            return 0;
        }
    }
    return ARRIS_END;
}

static void close_device(arris_stage *s, void *self) {
    (void)s;
    struct v4l2src *v = self;
    capture_stop(&v->capture);
    capture_free(&v->capture);
    device_close(&v->device);
    pixels_decoder_free(&v->decoder);
}

/* ---- the list of devices --------------------------------------------------------------------- */

static void list_inputs(const device *d, FILE *out) {
    struct v4l2_input in = {.index = 0};
    struct v4l2_standard std = {.index = 0};
    for (; device_ioctl(d->fd, VIDIOC_ENUMINPUT, &in) == 0; in.index++)
        fprintf(out, "  input %u: %s\n", in.index, in.name);
    for (; device_ioctl(d->fd, VIDIOC_ENUMSTD, &std) == 0; std.index++)
        fprintf(out, "%s%s", std.index ? ", " : "  standards: ", std.name);
    fputs(std.index ? "\n" : "", out);
}

static void list_formats(const device *d, FILE *out) {
    struct v4l2_fmtdesc e = {.type = V4L2_BUF_TYPE_VIDEO_CAPTURE};
    char sizes[400], rates[200];
    for (; device_ioctl(d->fd, VIDIOC_ENUM_FMT, &e) == 0; e.index++) {
        const pixels *p = pixels_find(e.pixelformat);
        if (!p)
            continue;
        struct v4l2_frmsizeenum size = {.pixel_format = e.pixelformat};
        format_sizes(d, e.pixelformat, sizes, sizeof sizes);
        fprintf(out, "  format %s: %s\n", p->name, sizes);
        for (; device_ioctl(d->fd, VIDIOC_ENUM_FRAMESIZES, &size) == 0 &&
               size.type == V4L2_FRMSIZE_TYPE_DISCRETE;
             size.index++) {
            format_rates(d, e.pixelformat, size.discrete.width, size.discrete.height, rates,
                         sizeof rates);
            fprintf(out, "    %ux%u: %s frames/s\n", size.discrete.width, size.discrete.height,
                    rates);
        }
    }
}

static bool list_one(device *d, void *user) {
    FILE *out = user;
    fprintf(out, "%s: %s, %s%s%s\n", d->path, d->card, d->bus, *d->serial ? ", serial number " : "",
            d->serial);
    list_inputs(d, out);
    list_formats(d, out);
    controls all = device_controls(d);
    controls_list(&all, out);
    return false;
}

static int devices(FILE *out) {
    device d;
    device_search(&d, list_one, out);
    return 0;
}

#define T struct v4l2src
static const arris_prop props[] = {
    ARRIS_P_STRING(T, wanted, "device", NULL,
                   "a path, or the camera's name or serial number; without it the first there is"),
    ARRIS_P_ENUM(T, wish.pixels, "format", "auto", PIXELS_WORDS,
                 "of the camera's pixels; auto: the first of these that it sends in this size"),
    ARRIS_P_INT(T, wish.width, "width", "0", 0, 16384, "px", "of the frames; 0: as it is set"),
    ARRIS_P_INT(T, wish.height, "height", "0", 0, 16384, "px",
                "of whole frames, both fields; 0: as it is set"),
    ARRIS_P_DOUBLE(T, wish.fps, "fps", "0", 0, 10000, "1/s", "0: as it is set"),
    ARRIS_P_ENUM(T, wish.fields, "fields", "auto", FIELDS_WORDS,
                 "of interlaced frames: one field of each, or both woven, which tears what moves; "
                 "auto: top where it is interlaced"),
    ARRIS_P_STRING(T, input, "input", NULL, "of a frame grabber, its number or name"),
    ARRIS_P_STRING(T, standard, "standard", NULL, "of an analogue input: PAL, NTSC, ..."),
    ARRIS_P_INT(T, buffers, "buffers", "8", CAPTURE_LEAST, CAPTURE_MOST, NULL,
                "of the driver; frames in flight hold some of them"),
    LIVE_PROPS(T, live),
    ARRIS_P_STRING(T, controls, "*", NULL,
                   "every control of the camera by its name, as --devices lists them: exposure=80, "
                   "gain=4; automatic exposure, gain, focus and zoom are off unless set"),
};

static const arris_stage_desc stage = {
    .size = sizeof(arris_stage_desc),
    .name = "v4l2src",
    .summary = "a camera or frame grabber through V4L2",
    .example = "v4l2src frames=9 ! fakesink",
    .flags = ARRIS_SOURCE,
    .layers = {.gives = ARRIS_BIT(ARRIS_IMAGE)},
    .self_size = sizeof(struct v4l2src),
    .props = props,
    .n_props = sizeof props / sizeof *props,
    .setup = setup,
    .process = process,
    .close = close_device,
    .devices = devices,
};

ARRIS_PLUGIN("v4l2", "LGPL-2.1-or-later", &stage);
