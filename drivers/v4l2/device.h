/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * device.h: finds and opens V4L2 capture devices.
 */
#ifndef V4L2_DEVICE_H
#define V4L2_DEVICE_H

#include <linux/videodev2.h>

#include "camera/controls.h"

typedef struct device {
    int fd; /* -1: closed */
    char path[64], card[33], bus[33];
    char serial[64];     /* of the USB device; empty: it has none */
    bool stamps_arrival; /* its stamps say when a frame's first bytes came, whatever their flags */
} device;

/* ioctl that is not interrupted. Returns 0 or -1 with errno. */
int device_ioctl(int fd, unsigned long request, void *argument);

/* Opens the capture device that `wanted` names, by its path (it begins with a slash), its name or
 * its serial number; NULL: the first that there is. Returns 0, or ARRIS_E_INPUT, ARRIS_E_IO. */
int device_open(device *d, const char *wanted, fault *f);

void device_close(device *d);

/* Opens all capture devices in turn, in the order of their numbers, until use(d) returns true; then
 * that one is left open. Returns whether it came to that. */
bool device_search(device *d, bool (*use)(device *d, void *user), void *user);

/* Selects an input (its number or its name), and a standard ("PAL"); NULL leaves what is set. What
 * a digital input receives is taken over as it is. Returns 0, or ARRIS_E_USAGE, ARRIS_E_IO. */
int device_select(const device *d, const char *input, const char *standard, fault *f);

/* Its controls, controls.c; valid as long as *d is. */
controls device_controls(const device *d);

#endif
