/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * camera.c: finds, opens and starts a USB video camera.
 */
#include "camera.h"

#include <linux/usb/video.h>
#include <stdio.h>
#include <string.h>

#include "transfers.h"

enum { CONTROL_MS = 2000, MAX_CONFIGURATION = 1 << 16 };

static int failed(fault *f, const char *what, int r) {
    return fault_set(f, ARRIS_E_IO,
                     r == LIBUSB_ERROR_ACCESS
                         ? "install the udev rule of `make install`, and plug the camera in again"
                     : r == LIBUSB_ERROR_BUSY ? "another program uses it"
                                              : NULL,
                     "%s: %s", what, libusb_strerror(r));
}

/* ---- finding --------------------------------------------------------------------------------- */

static bool is_video(libusb_device *device) {
    struct libusb_config_descriptor *config;
    if (libusb_get_active_config_descriptor(device, &config))
        return false;
    bool video = false;
    for (int i = 0; i < config->bNumInterfaces; i++)
        video |= config->interface[i].num_altsetting > 0 &&
                 config->interface[i].altsetting->bInterfaceClass == LIBUSB_CLASS_VIDEO;
    libusb_free_config_descriptor(config);
    return video;
}

static void read_text(libusb_device_handle *h, uint8_t index, char text[CAMERA_NAME]) {
    int n =
        index ? libusb_get_string_descriptor_ascii(h, index, (uint8_t *)text, CAMERA_NAME - 1) : 0;
    text[n > 0 ? n : 0] = '\0';
}

static void read_names(camera *c, libusb_device *device) {
    struct libusb_device_descriptor d;
    uint8_t port[8];
    libusb_get_device_descriptor(device, &d);
    read_text(c->handle, d.iProduct, c->name);
    read_text(c->handle, d.iSerialNumber, c->serial);
    snprintf(c->id, sizeof c->id, "%04x:%04x", d.idVendor, d.idProduct);
    int n = libusb_get_port_numbers(device, port, sizeof port);
    size_t at = (size_t)snprintf(c->place, sizeof c->place, "%u-", libusb_get_bus_number(device));
    for (int i = 0; i < n && at < sizeof c->place; i++)
        at += (size_t)snprintf(c->place + at, sizeof c->place - at, "%s%u", i ? "." : "", port[i]);
}

/* The raw bytes, as the camera gives them. */
int camera_describe(camera *c, fault *f) {
    static _Thread_local uint8_t data[MAX_CONFIGURATION];
    int n = libusb_get_descriptor(c->handle, LIBUSB_DT_CONFIG, 0, data, 9);
    size_t total = n == 9 ? (size_t)(data[2] | data[3] << 8) : 0;
    if (total > 9)
        n = libusb_get_descriptor(c->handle, LIBUSB_DT_CONFIG, 0, data, (int)total);
    if (n < 9)
        return failed(f, "cannot read the descriptors", n < 0 ? n : LIBUSB_ERROR_IO);
    return uvc_parse(data, (size_t)n, &c->uvc, f);
}

static bool each(camera *c, libusb_device **list, ssize_t n, bool (*use)(camera *c, void *user),
                 void *user, int *refused) {
    for (ssize_t i = 0; i < n; i++) {
        if (!is_video(list[i]))
            continue;
        int r = libusb_open(list[i], &c->handle);
        if (r) {
            c->handle = NULL;
            *refused = r;
            continue;
        }
        read_names(c, list[i]);
        if (use(c, user))
            return true;
        libusb_close(c->handle);
        c->handle = NULL;
    }
    return false;
}

/* libusb may learn of devices only when it begins: so every search is one of its own. */
int camera_search(camera *c, bool (*use)(camera *c, void *user), void *user, fault *f) {
    libusb_device **list;
    int refused = 0;
    *c = (camera){.usb = NULL};
    int r = libusb_init(&c->usb);
    if (r)
        return c->usb = NULL, failed(f, "cannot begin with USB", r);
    ssize_t n = libusb_get_device_list(c->usb, &list);
    bool found = n >= 0 && each(c, list, n, use, user, &refused);
    if (n >= 0)
        libusb_free_device_list(list, 1);
    if (!found && refused)
        return failed(f, "cannot open a camera", refused);
    return found;
}

static bool is_wanted(camera *c, void *user) {
    const char *wanted = user;
    return !wanted || strcmp(c->name, wanted) == 0 || strcmp(c->serial, wanted) == 0 ||
           strcmp(c->id, wanted) == 0;
}

/* ---- opening --------------------------------------------------------------------------------- */

static int claim(camera *c, int which, uint8_t interface, fault *f) {
    int r = libusb_claim_interface(c->handle, interface);
    c->claimed[which] = r == 0;
    return r ? failed(f, "cannot take the camera from the kernel's driver", r) : 0;
}

int camera_open(camera *c, const char *wanted, fault *f) {
    int r = camera_search(c, is_wanted, (void *)wanted, f);
    if (r < 0)
        return r;
    if (r == 0)
        return fault_set(f, ARRIS_E_IO,
                         wanted ? "`arris stages usbsrc --devices` lists the cameras"
                                : "plug one in",
                         wanted ? "there is no USB camera '%s'" : "there is no USB camera", wanted);
    r = camera_describe(c, f);
    if (r < 0)
        return r;
    libusb_set_auto_detach_kernel_driver(c->handle, 1);
    r = claim(c, 0, c->uvc.control, f);
    return r == 0 ? claim(c, 1, c->uvc.streaming, f) : r;
}

/* The streaming interface goes first: the kernel's driver begins with the control interface, and
 * takes both. Released, it has its setting 0 from the kernel, which ends an isochronous stream. */
void camera_close(camera *c) {
    camera_stop(c);
    if (c->claimed[1])
        libusb_release_interface(c->handle, c->uvc.streaming);
    if (c->claimed[0])
        libusb_release_interface(c->handle, c->uvc.control);
    c->claimed[0] = c->claimed[1] = false;
    if (c->handle)
        libusb_close(c->handle);
    if (c->usb)
        libusb_exit(c->usb);
    c->handle = NULL;
    c->usb = NULL;
}

bool camera_control(const camera *c, uint8_t request, uint8_t selector, uint8_t entity,
                    uint8_t interface, uint8_t *data, uint16_t n) {
    uint8_t type = (uint8_t)(LIBUSB_REQUEST_TYPE_CLASS | LIBUSB_RECIPIENT_INTERFACE |
                             (request & 0x80 ? LIBUSB_ENDPOINT_IN : LIBUSB_ENDPOINT_OUT));
    return libusb_control_transfer(c->handle, type, request, (uint16_t)(selector << 8),
                                   (uint16_t)(entity << 8 | interface), data, n, CONTROL_MS) == n;
}

/* ---- probe and commit ------------------------------------------------------------------------ */

static void put32(uint8_t *p, uint32_t v) {
    for (int i = 0; i < 4; i++)
        p[i] = (uint8_t)(v >> 8 * i);
}

static uint32_t get32(const uint8_t *p) {
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

/* `payload` becomes the most bytes of one. The control is 26 bytes long in UVC 1.0, 34 in 1.1, 48
 * in 1.5. */
static int negotiate(const camera *c, const uvc_frame *frame, uint32_t interval, uint32_t *payload,
                     fault *f) {
    uint8_t p[48] = {1 /* the interval is to be kept */};
    uint16_t n = c->uvc.version >= 0x0150 ? 48 : c->uvc.version >= 0x0110 ? 34 : 26;
    uint8_t streaming = c->uvc.streaming;
    p[2] = frame->format;
    p[3] = frame->frame;
    put32(p + 4, interval);
    if (!camera_control(c, UVC_SET_CUR, UVC_VS_PROBE_CONTROL, 0, streaming, p, n) ||
        !camera_control(c, UVC_GET_CUR, UVC_VS_PROBE_CONTROL, 0, streaming, p, n))
        return fault_set(f, ARRIS_E_IO, NULL, "the camera does not answer to what it is asked for");
    if (p[2] != frame->format || p[3] != frame->frame)
        return fault_set(f, ARRIS_E_IO, NULL, "the camera offers another format than %s %ux%u",
                         frame->pixels->name, frame->width, frame->height);
    *payload = get32(p + 22);
    if (!camera_control(c, UVC_SET_CUR, UVC_VS_COMMIT_CONTROL, 0, streaming, p, n))
        return fault_set(f, ARRIS_E_IO, NULL, "the camera does not keep to what it has offered");
    return 0;
}

/* The bulk one, or the isochronous one that just suffices. */
static const uvc_alternate *choose(const camera *c, uint32_t payload) {
    const uvc_alternate *best = NULL;
    for (uint32_t i = 0; i < c->uvc.n_alternates; i++) {
        const uvc_alternate *a = &c->uvc.alternate[i];
        if (a->bulk)
            return a;
        bool enough = a->packet >= payload, best_enough = best && best->packet >= payload;
        if (!best || (enough && (!best_enough || a->packet < best->packet)) ||
            (!enough && !best_enough && a->packet > best->packet))
            best = a;
    }
    return best;
}

/* Not closed: for a device that is gone libusb before 1.0.27 has unlocked what it had not locked
 * (its issue 1199), and would abort. */
static void abandon(camera *c) {
    c->handle = NULL;
    c->claimed[0] = c->claimed[1] = false;
}

int camera_start(camera *c, const uvc_frame *frame, uint32_t interval, fault *f) {
    enum { MOST = 1 << 28 };
    uint32_t payload = 0;
    int r = negotiate(c, frame, interval, &payload, f);
    if (r < 0)
        return r;
    size_t want = frame->pixels->bytes
                      ? pixels_size(frame->pixels, frame->height,
                                    (size_t)frame->width * (size_t)frame->pixels->bytes)
                      : 0;
    size_t most = (size_t)frame->width * frame->height * 2 + 65536; /* of a JPEG */
    if (assembler_init(&c->pictures, want ? want : most, want))
        return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for pictures");
    clock_init(&c->clock, c->uvc.clock);
    c->alternate = choose(c, payload);
    c->payload = payload && payload < MOST ? payload : (uint32_t)c->pictures.size + 12;
    if (c->alternate->setting) /* a bulk camera streams from its commit on */
        r = libusb_set_interface_alt_setting(c->handle, c->uvc.streaming, c->alternate->setting);
    if (r == LIBUSB_ERROR_NO_DEVICE)
        abandon(c);
    if (r)
        return failed(f, "cannot start the stream", r);
    return transfers_start(c, f);
}

int camera_step(camera *c, int ms, fault *f) {
    return transfers_step(c, ms, f);
}

void camera_stop(camera *c) {
    transfers_stop(c);
    if (c->claimed[1] && c->alternate && c->alternate->bulk)
        libusb_clear_halt(c->handle, c->alternate->endpoint);
    c->alternate = NULL;
    assembler_free(&c->pictures);
}
