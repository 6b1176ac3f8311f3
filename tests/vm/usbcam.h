/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * usbcam.h: the emulated camera: what its stream (usbcam.c) and its control requests
 * (usbcam_control.c) share.
 */
#ifndef USBCAM_H
#define USBCAM_H

#include <endian.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <time.h>

enum { WAITING = 64, PACKETS = 256, HEADER = 12, EXCESS = 100, PACKET = 1024, OUT_MAX = 4096 };
enum {
    STALL,
    ID,
    SHORT,
    LONG,
    ERROR,
    BAD_HEADER,
    LOST,
    UNPLUG,
    SILENT,
    PAUSE,
    BROKEN,
    FAST,
    OPTIONS
};

typedef struct request { /* that waits for pictures */
    uint32_t number, length, packets;
    uint32_t size[PACKETS]; /* of its packets */
} request;

struct usbcam {
    long option[OPTIONS];
    bool bulk;
    int fd;
    request waiting[WAITING];
    unsigned n_waiting;
    bool streams, halted;
    uint8_t probe[34], exposure_mode;
    uint32_t exposure;
    uint16_t gain, focus;
    int16_t brightness;

    uint32_t number; /* of the picture */
    uint8_t *picture;
    size_t size, sent; /* bytes, of its payload data */
    size_t in_payload; /* bulk: bytes of the payload so far, with its header */
    bool begun, again; /* again: after a stall it begins anew */
    uint8_t id;
    int64_t due;        /* µs */
    bool done[OPTIONS]; /* what was to happen once, or in this picture */
};
extern struct usbcam cam;

static inline int64_t now_us(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000 + t.tv_nsec / 1000;
}

static inline void put32(uint8_t *p, uint32_t v) {
    memcpy(p, &(uint32_t){htole32(v)}, 4);
}

/* Says what is wrong, and exits. */
void die(const char *what);

/* Bytes from the host. False: it is gone. */
bool read_all(void *to, size_t n);

/* Answers a request with a status, 0 or -errno, and with data, or NULL. */
void answer(uint32_t number, int status, const void *data, size_t n);

/* A control request, its data still to be read. */
void on_control(uint32_t number, const uint8_t *setup, uint32_t length);

#endif
