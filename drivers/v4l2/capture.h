/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * capture.h: a device's buffers: mapped, queued, filled, lent to frames.
 *
 * A frame may point into a buffer instead of copying it. Such a buffer goes back to the driver when
 * no frame holds it any more; so few are lent that the driver always has some to fill.
 */
#ifndef V4L2_CAPTURE_H
#define V4L2_CAPTURE_H

#include <linux/videodev2.h>

#include "arris_plugin.h"
#include "fault.h"

enum { CAPTURE_LEAST = 4, CAPTURE_MOST = 32 }; /* buffers */

typedef struct capture {
    int fd;
    bool on; /* it streams */
    unsigned n;
    struct {
        uint8_t *data;           /* 64 bytes may be read behind its end */
        size_t length, region;   /* bytes: of the buffer, of the mapping */
        const arris_image *lent; /* to this layer; NULL: to none */
        bool queued;
    } buffer[CAPTURE_MOST];
} capture;

/* Maps `n` buffers or as many as the driver wants, queues them and starts the stream. On failure
 * capture_free must follow too. Returns 0 or ARRIS_E_IO, ARRIS_E_MEMORY. */
int capture_start(capture *c, int fd, unsigned n, fault *f);

/* Waits for a filled buffer, `ms` at most. Returns 1 and *b, 0 when none came, or ARRIS_E_IO when
 * the stream is broken. */
int capture_wait(capture *c, int ms, struct v4l2_buffer *b, fault *f);

/* Gives a buffer back to the driver. Returns 0 or ARRIS_E_IO. */
int capture_queue(capture *c, unsigned index, fault *f);

/* Whether a buffer may be lent now, and the lending: `image` points into it from its byte `first`
 * on, with rows of `stride` bytes. */
bool capture_may_lend(const capture *c);
void capture_lend(capture *c, unsigned index, arris_image *image, size_t first, size_t stride);

/* Gives the lent buffers that no frame holds any more back, among them the one that was lent to
 * `given`, a layer that has just been given anew (NULL: none). Must follow every arris_layer_give.
 * Returns 0 or ARRIS_E_IO. */
int capture_reclaim(capture *c, const arris_stage *s, const arris_image *given, fault *f);

/* Stops the stream; what is lent stays readable. */
void capture_stop(capture *c);

/* Whether a frame holds a buffer. */
bool capture_is_held(const capture *c, const arris_stage *s);

/* Unmaps all; nothing may be held. */
void capture_free(capture *c);

#endif
