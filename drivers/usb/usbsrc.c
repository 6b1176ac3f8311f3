/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * usbsrc.c: the stage `usbsrc`: a USB video camera through libusb, without the kernel's driver.
 *
 * A frame is dated by the camera's own clock where it sends it, else by its first payload. Stalls
 * and damaged pictures are got over in the stream; when that fails, or the camera is unplugged or
 * silent, it is closed, looked for, and set up anew.
 */
#include <math.h>
#include <string.h>

#include "camera.h"
#include "camera/live.h"

enum { SLICE = 100 /* ms */ };

struct usbsrc {
    const char *wanted, *controls;
    int32_t pixels, width, height;
    double fps;
    live live;

    camera camera;
    char sought[CAMERA_NAME]; /* the serial number of the camera, or its vendor and product */
    uvc_frame frame;          /* as chosen */
    uint32_t interval;        /* 100 ns */
    pixels_decoder decoder;
    double exposure; /* ms; 0: unknown */
    int64_t heard;   /* ns, when the last picture came */
    int64_t index;   /* of the next frame */
    assembler_counts told;
    uint64_t stalls; /* told */
};

/* ---- opening --------------------------------------------------------------------------------- */

static bool suits(const struct usbsrc *u, const uvc_frame *m) {
    return (!u->pixels || m->pixels == &pixels_table[u->pixels - 1]) &&
           (!u->width || m->width == u->width) && (!u->height || m->height == u->height);
}

/* The first that suits, of the best pixels. */
static const uvc_frame *choose(const struct usbsrc *u) {
    const uvc_frame *best = NULL;
    for (const uvc_frame *m = u->camera.uvc.frame; m < u->camera.uvc.frame + u->camera.uvc.n_frames;
         m++)
        if (suits(u, m) && (!best || m->pixels < best->pixels))
            best = m;
    return best;
}

static int settle_frame(struct usbsrc *u, fault *f) {
    const uvc_frame *m = choose(u);
    if (!m)
        return fault_set(f, ARRIS_E_USAGE, "`arris stages usbsrc --devices` lists what it sends",
                         "%s sends no pictures of that format and size", u->camera.name);
    u->frame = *m;
    u->interval = uvc_interval(m, u->fps);
    double fps = 1e7 / u->interval;
    if (u->fps > 0 && fabs(fps - u->fps) > 0.01 * u->fps)
        return fault_set(f, ARRIS_E_USAGE, "`arris stages usbsrc --devices` lists the rates",
                         "%s sends %.4g frames/s at this size, not %.4g", u->camera.name, fps,
                         u->fps);
    return 0;
}

static int open_camera(arris_stage *s, struct usbsrc *u, fault *f) {
    controls all = camera_controls(&u->camera);
    fault calm;
    int r = camera_open(&u->camera, *u->sought ? u->sought : u->wanted, f);
    if (r == 0)
        r = settle_frame(u, f);
    if (r == 0 && controls_calm(&all, &calm) < 0)
        arris_warn(s, "%s", calm.text);
    if (r == 0)
        r = controls_set(&all, u->controls, f);
    if (r == 0)
        u->exposure = controls_exposure(&all);
    return r;
}

static int setup(arris_stage *s, void *self, arris_caps *caps) {
    struct usbsrc *u = self;
    fault f;
    int r = open_camera(s, u, &f);
    if (r < 0)
        return arris_fail(s, r, f.hint, "%s", f.text);
    snprintf(u->sought, sizeof u->sought, "%s",
             *u->camera.serial ? u->camera.serial : u->camera.id);
    *caps = (arris_caps){.format = u->frame.pixels->format,
                         .width = u->frame.width,
                         .height = u->frame.height,
                         .fps = 1e7 / u->interval};
    return live_setup(s, &u->live, caps);
}

/* The camera is opened anew unless this is the first time. */
static int start(arris_stage *s, struct usbsrc *u, fault *f) {
    uvc_frame before = u->frame;
    int r = u->camera.usb ? 0 : open_camera(s, u, f);
    if (r == 0 && (u->frame.width != before.width || u->frame.height != before.height ||
                   u->frame.pixels->format != before.pixels->format)) {
        r = fault_set(f, ARRIS_E_IO, NULL, "it sends %ux%u now, not %ux%u", u->frame.width,
                      u->frame.height, before.width, before.height);
        u->frame = before;
    }
    if (r == 0)
        r = camera_start(&u->camera, &u->frame, u->interval, f);
    u->told = (assembler_counts){0};
    u->stalls = 0;
    u->heard = arris_now();
    return r;
}

/* Returns 0 when it streams again, else as live_wait. */
static int find(arris_stage *s, struct usbsrc *u, fault *why) {
    live_lost(s, &u->live, why);
    for (;;) {
        camera_close(&u->camera);
        int r = live_wait(s, &u->live, why);
        if (r)
            return r;
        if (start(s, u, why) == 0)
            return 0;
    }
}

/* ---- frames ---------------------------------------------------------------------------------- */

static void count(arris_stage *s, struct usbsrc *u) {
    const assembler_counts *c = &u->camera.pictures.counts;
    assembler_counts *t = &u->told;
    arris_count(s, "flagged", c->flagged - t->flagged);
    arris_count(s, "short", c->shorter - t->shorter);
    arris_count(s, "overlong", c->longer - t->longer);
    arris_count(s, "wrong id", c->wrong_id - t->wrong_id);
    arris_count(s, "overrun", c->dropped - t->dropped);
    arris_count(s, "stalls", u->camera.stalls - u->stalls);
    *t = *c;
    u->stalls = u->camera.stalls;
}

/* Returns 1 when the frame has its image, or 0 when the picture is damaged. */
static int fill(arris_stage *s, struct usbsrc *u, const picture *p, arris_frame *frame) {
    fault damage;
    int64_t stamp = p->arrived;
    size_t stride = (size_t)u->frame.width * (size_t)u->frame.pixels->bytes;
    arris_image *image = arris_layer_give(s, frame, ARRIS_IMAGE);
    int64_t index = u->index++;
    if (pixels_convert(u->frame.pixels, &u->decoder, p->data, p->n, stride, image, &damage)) {
        arris_count(s, "damaged", 1);
        return 0;
    }
    bool start = p->has_pts && clock_date(&u->camera.clock, p->pts, p->arrived, &stamp);
    live_frame(&u->live, frame, index, start ? stamp : p->arrived, start, u->exposure);
    return 1;
}

/* Returns 1 when the frame has its image, 0 when none has come yet, or an error. */
static int take(arris_stage *s, struct usbsrc *u, arris_frame *frame, fault *f) {
    int r = 0;
    if (!assembler_oldest(&u->camera.pictures))
        r = camera_step(&u->camera, SLICE, f);
    count(s, u);
    const picture *p = assembler_oldest(&u->camera.pictures);
    if (!p && r == 0 && (double)(arris_now() - u->heard) > u->live.timeout * 1e6)
        return fault_set(f, ARRIS_E_IO, NULL, "it has sent nothing for %g ms", u->live.timeout);
    if (!p)
        return r;
    u->heard = arris_now();
    r = fill(s, u, p, frame);
    assembler_next(&u->camera.pictures);
    return r;
}

static int process(arris_stage *s, void *self, arris_frame *frame) {
    struct usbsrc *u = self;
    fault why;
    while (arris_running(s) && !live_done(&u->live)) {
        int r = u->camera.on ? take(s, u, frame, &why) : start(s, u, &why);
        if (r < 0) {
            r = find(s, u, &why);
            if (r)
                return r;
        } else if (r > 0) {
            live_found(s, &u->live);
            return 0;
        }
    }
    return ARRIS_END;
}

static void close_camera(arris_stage *s, void *self) {
    (void)s;
    struct usbsrc *u = self;
    camera_close(&u->camera);
    pixels_decoder_free(&u->decoder);
}

/* ---- the list of devices --------------------------------------------------------------------- */

static void list_frames(const uvc_camera *c, FILE *out) {
    for (const uvc_frame *m = c->frame; m < c->frame + c->n_frames; m++) {
        fprintf(out, "  format %s: %ux%u, ", m->pixels->name, m->width, m->height);
        for (uint32_t i = 0; i < m->n; i++)
            fprintf(out, "%s%.4g", !i ? "" : m->step ? " down to " : ", ", 1e7 / m->interval[i]);
        fputs(" frames/s\n", out);
    }
}

static bool list_one(camera *c, void *user) {
    controls all = camera_controls(c);
    FILE *out = user;
    fault f;
    fprintf(out, "%s: %s, at %s%s%s\n", c->id, c->name, c->place,
            *c->serial ? ", serial number " : "", c->serial);
    if (camera_describe(c, &f) < 0) {
        fprintf(out, "  %s\n", f.text);
        return false;
    }
    list_frames(&c->uvc, out);
    controls_list(&all, out);
    return false;
}

static int devices(FILE *out) {
    camera c;
    fault f;
    int r = camera_search(&c, list_one, out, &f);
    if (r < 0)
        fprintf(out, "%s\n", f.text);
    camera_close(&c);
    return r < 0 ? r : 0;
}

#define T struct usbsrc
static const arris_prop props[] = {
    ARRIS_P_STRING(T, wanted, "device", NULL,
                   "the camera's name, its serial number or vendor:product; without it the first "
                   "there is"),
    ARRIS_P_ENUM(T, pixels, "format", "auto", PIXELS_WORDS,
                 "of the camera's pixels; auto: the first of these that it sends in this size"),
    ARRIS_P_INT(T, width, "width", "0", 0, 16384, "px", "of the pictures; 0: the first there is"),
    ARRIS_P_INT(T, height, "height", "0", 0, 16384, "px", "of the pictures; 0: the first there is"),
    ARRIS_P_DOUBLE(T, fps, "fps", "0", 0, 10000, "1/s", "0: what the camera does by itself"),
    LIVE_PROPS(T, live),
    ARRIS_P_STRING(T, controls, "*", NULL,
                   "every control of the camera by its name, as --devices lists them: exposure=80, "
                   "gain=4; automatic exposure and focus are off unless set"),
};

static const arris_stage_desc stage = {
    .size = sizeof(arris_stage_desc),
    .name = "usbsrc",
    .summary = "a USB video camera, without the kernel's driver",
    .example = "usbsrc frames=9 ! fakesink",
    .flags = ARRIS_SOURCE,
    .layers = {.gives = ARRIS_BIT(ARRIS_IMAGE)},
    .self_size = sizeof(struct usbsrc),
    .props = props,
    .n_props = sizeof props / sizeof *props,
    .setup = setup,
    .process = process,
    .close = close_camera,
    .devices = devices,
};

ARRIS_PLUGIN("usb", "LGPL-2.1-or-later", &stage);
