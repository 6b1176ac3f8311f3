/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * camera.h: a USB video camera through libusb, without the kernel's driver, which has it back
 * afterwards. All functions are one thread's; libusb's events are handled in its calls.
 */
#ifndef USB_CAMERA_H
#define USB_CAMERA_H

#include <libusb.h>

#include "assembler.h"
#include "camera/controls.h"
#include "clock.h"
#include "descriptors.h"

enum { CAMERA_TRANSFERS = 8, CAMERA_NAME = 64 };

typedef struct camera {
    libusb_context *usb; /* NULL: closed */
    libusb_device_handle *handle;
    char name[CAMERA_NAME], serial[CAMERA_NAME], id[16], place[32];
    uvc_camera uvc;
    bool claimed[2];

    assembler pictures;
    source_clock clock;
    const uvc_alternate *alternate;
    struct libusb_transfer *transfer[CAMERA_TRANSFERS];
    unsigned in_flight;
    uint32_t payload, so_far; /* bytes, of a bulk payload: the most, and how many have come */
    bool on, stopping, stalled, gone;
    uint64_t stalls; /* of the endpoint, cleared */
} camera;

/* Opens the camera that `wanted` names: its product name, its serial number, or "vendor:product" in
 * hexadecimal; NULL: the first. Returns 0, or ARRIS_E_INPUT, ARRIS_E_IO, ARRIS_E_MEMORY;
 * camera_close may follow in any case. */
int camera_open(camera *c, const char *wanted, fault *f);

/* Negotiates a frame and its interval (100 ns), and starts the stream. Returns 0 or an error. */
int camera_start(camera *c, const uvc_frame *frame, uint32_t interval, fault *f);

/* Handles what comes within `ms`. Returns 0, or ARRIS_E_IO when the camera is gone or the stream
 * cannot go on. */
int camera_step(camera *c, int ms, fault *f);

/* Stops the stream. The pictures that were assembled are lost. */
void camera_stop(camera *c);

/* Gives the camera back to the kernel's driver. */
void camera_close(camera *c);

/* Sends or asks for the n bytes of a class control (USB Video Class 1.1, 4.1), `request` being one
 * of UVC_SET_CUR ... of linux/usb/video.h. False: the camera refuses. */
bool camera_control(const camera *c, uint8_t request, uint8_t selector, uint8_t entity,
                    uint8_t interface, uint8_t *data, uint16_t n);

/* The controls of its terminal and processing unit (4.2.2), controls.c, with the names and values
 * that the kernel's driver gives them, so that a launch line suits both; valid as long as *c is. */
controls camera_controls(const camera *c);

/* Reads c->uvc from an open camera. Returns 0, or ARRIS_E_INPUT, ARRIS_E_IO. camera_open does. */
int camera_describe(camera *c, fault *f);

/* Opens each camera in turn, without taking it from anyone, until use(c) returns true; then it is
 * left open. Returns whether it came to that, or an error. */
int camera_search(camera *c, bool (*use)(camera *c, void *user), void *user, fault *f);

#endif
