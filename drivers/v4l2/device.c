/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * device.c: finds and opens V4L2 capture devices.
 */
#include "device.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/ioctl.h>
#include <unistd.h>

enum { MAX_DEVICES = 64 };

int device_ioctl(int fd, unsigned long request, void *argument) {
    int r;
    do
        r = ioctl(fd, request, argument);
    while (r < 0 && errno == EINTR);
    return r;
}

/* An attribute of the USB device that the node belongs to: the interface's parent. */
static void read_serial(device *d) {
    char path[160];
    snprintf(path, sizeof path, "/sys/class/video4linux/%s/device/../serial",
             strrchr(d->path, '/') + 1);
    FILE *f = fopen(path, "r");
    if (f && fgets(d->serial, sizeof d->serial, f))
        d->serial[strcspn(d->serial, "\n")] = '\0';
    if (f)
        fclose(f);
}

/* uvcvideo flags its stamps as the start of the exposure. Unless it is told to use the camera's
 * clock, they are when the first bytes came, and so after the exposure. */
static bool stamps_arrival(const char *driver) {
    FILE *f = strcmp(driver, "uvcvideo") == 0
                  ? fopen("/sys/module/uvcvideo/parameters/hwtimestamps", "r")
                  : NULL;
    int c = f ? fgetc(f) : 'Y';
    if (f)
        fclose(f);
    return c == 'N' || c == '0';
}

static int open_path(device *d, const char *path, fault *f) {
    struct v4l2_capability cap;
    *d = (device){.fd = open(path, O_RDWR | O_NONBLOCK | O_CLOEXEC)};
    snprintf(d->path, sizeof d->path, "%s", path);
    if (d->fd < 0)
        return fault_set(f, ARRIS_E_IO,
                         errno == EACCES ? "become a member of the group 'video'" : NULL,
                         "cannot open %s: %s", path, strerror(errno));
    if (device_ioctl(d->fd, VIDIOC_QUERYCAP, &cap) == 0) {
        uint32_t caps =
            cap.capabilities & V4L2_CAP_DEVICE_CAPS ? cap.device_caps : cap.capabilities;
        snprintf(d->card, sizeof d->card, "%s", (const char *)cap.card);
        snprintf(d->bus, sizeof d->bus, "%s", (const char *)cap.bus_info);
        read_serial(d);
        d->stamps_arrival = stamps_arrival((const char *)cap.driver);
        if (caps & V4L2_CAP_VIDEO_CAPTURE && caps & V4L2_CAP_STREAMING)
            return 0;
    }
    device_close(d);
    return fault_set(f, ARRIS_E_INPUT, "`arris stages v4l2src --devices` lists the cameras",
                     "%s is no camera", path);
}

void device_close(device *d) {
    if (d->fd >= 0)
        close(d->fd);
    d->fd = -1;
}

bool device_search(device *d, bool (*use)(device *d, void *user), void *user) {
    fault ignored;
    char path[32];
    for (int i = 0; i < MAX_DEVICES; i++) {
        snprintf(path, sizeof path, "/dev/video%d", i);
        if (open_path(d, path, &ignored))
            continue;
        if (use(d, user))
            return true;
        device_close(d);
    }
    return false;
}

static bool is_wanted(device *d, void *user) {
    const char *wanted = user;
    return !wanted || strcmp(d->card, wanted) == 0 || strcmp(d->serial, wanted) == 0;
}

int device_open(device *d, const char *wanted, fault *f) {
    if (wanted && *wanted == '/')
        return open_path(d, wanted, f);
    if (device_search(d, is_wanted, (void *)wanted))
        return 0;
    return wanted ? fault_set(f, ARRIS_E_IO, "`arris stages v4l2src --devices` lists the cameras",
                              "there is no camera of the name or serial number '%s'", wanted)
                  : fault_set(f, ARRIS_E_IO,
                              "plug one in, or name its device with device=", "there is no camera");
}

/* ---- inputs ---------------------------------------------------------------------------------- */

static int select_input(const device *d, const char *input, fault *f) {
    struct v4l2_input in = {.index = 0};
    char *end;
    unsigned long number = strtoul(input, &end, 10);
    bool named = end == input || *end;
    for (; device_ioctl(d->fd, VIDIOC_ENUMINPUT, &in) == 0; in.index++) {
        if (named ? strcasecmp((const char *)in.name, input) : in.index != number)
            continue;
        int index = (int)in.index;
        if (device_ioctl(d->fd, VIDIOC_S_INPUT, &index) == 0)
            return 0;
        return fault_set(f, ARRIS_E_IO, NULL, "cannot select the input '%s': %s", input,
                         strerror(errno));
    }
    return fault_set(f, ARRIS_E_USAGE, "`arris stages v4l2src --devices` lists the inputs",
                     "%s has no input '%s'", d->card, input);
}

static int select_standard(const device *d, const char *standard, fault *f) {
    struct v4l2_standard std = {.index = 0};
    for (; device_ioctl(d->fd, VIDIOC_ENUMSTD, &std) == 0; std.index++) {
        if (strcasecmp((const char *)std.name, standard) != 0)
            continue;
        if (device_ioctl(d->fd, VIDIOC_S_STD, &std.id) == 0)
            return 0;
        return fault_set(f, ARRIS_E_IO, NULL, "cannot select the standard '%s': %s", standard,
                         strerror(errno));
    }
    return fault_set(f, ARRIS_E_USAGE, "`arris stages v4l2src --devices` lists the standards",
                     "%s has no standard '%s' at this input", d->card, standard);
}

int device_select(const device *d, const char *input, const char *standard, fault *f) {
    struct v4l2_dv_timings timings;
    int r = input ? select_input(d, input, f) : 0;
    if (r == 0 && standard)
        r = select_standard(d, standard, f);
    memset(&timings, 0, sizeof timings);
    if (r == 0 && device_ioctl(d->fd, VIDIOC_QUERY_DV_TIMINGS, &timings) == 0 &&
        device_ioctl(d->fd, VIDIOC_S_DV_TIMINGS, &timings) < 0)
        return fault_set(f, ARRIS_E_IO, NULL, "cannot take the timings of the digital input: %s",
                         strerror(errno));
    return r;
}
