/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * capture.c: a device's buffers.
 */
#include "capture.h"

#include <errno.h>
#include <poll.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "device.h"

enum { KEPT = 3 /* buffers that are never lent */, BEHIND = 64 /* bytes */ };

static struct v4l2_buffer buffer_of(unsigned index) {
    return (struct v4l2_buffer){
        .index = index, .type = V4L2_BUF_TYPE_VIDEO_CAPTURE, .memory = V4L2_MEMORY_MMAP};
}

static int failed(fault *f, const char *what) {
    return fault_set(f, ARRIS_E_IO, NULL, "%s: %s", what, strerror(errno));
}

/* The buffer lies at the beginning of a region that is a page longer where it must be: so what an
 * image promises to be readable behind its last row is. */
static int map(capture *c, unsigned i, fault *f) {
    struct v4l2_buffer b = buffer_of(i);
    size_t page = (size_t)sysconf(_SC_PAGESIZE);
    if (device_ioctl(c->fd, VIDIOC_QUERYBUF, &b))
        return failed(f, "cannot look at a buffer");
    size_t region = (b.length + BEHIND + page - 1) / page * page;
    void *at = mmap(NULL, region, PROT_READ, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (at == MAP_FAILED)
        return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for a buffer of %u bytes", b.length);
    c->buffer[i].data = at;
    c->buffer[i].region = region;
    c->buffer[i].length = b.length;
    c->n = i + 1;
    if (mmap(at, b.length, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_FIXED, c->fd, b.m.offset) ==
        MAP_FAILED)
        return failed(f, "cannot map a buffer");
    return 0;
}

static int map_all(capture *c, unsigned n, fault *f) {
    struct v4l2_requestbuffers r = {
        .count = n, .type = V4L2_BUF_TYPE_VIDEO_CAPTURE, .memory = V4L2_MEMORY_MMAP};
    if (device_ioctl(c->fd, VIDIOC_REQBUFS, &r))
        return failed(f, errno == EBUSY ? "another program uses the camera"
                                        : "the driver refuses to make buffers");
    if (r.count < CAPTURE_LEAST)
        return fault_set(f, ARRIS_E_IO, NULL, "the driver makes %u buffers only", r.count);
    int rc = 0;
    for (unsigned i = 0; rc == 0 && i < r.count && i < CAPTURE_MOST; i++)
        rc = map(c, i, f);
    return rc;
}

int capture_start(capture *c, int fd, unsigned n, fault *f) {
    int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    *c = (capture){.fd = fd};
    int r = map_all(c, n, f);
    for (unsigned i = 0; r == 0 && i < c->n; i++)
        r = capture_queue(c, i, f);
    if (r == 0 && device_ioctl(fd, VIDIOC_STREAMON, &type))
        r = failed(f, "cannot start the stream");
    c->on = r == 0;
    return r;
}

int capture_wait(capture *c, int ms, struct v4l2_buffer *b, fault *f) {
    struct pollfd p = {.fd = c->fd, .events = POLLIN};
    int r = poll(&p, 1, ms);
    if (r == 0 || (r < 0 && errno == EINTR))
        return 0;
    *b = buffer_of(0);
    if (r > 0 && device_ioctl(c->fd, VIDIOC_DQBUF, b) == 0) {
        if (b->index >= c->n)
            return fault_set(f, ARRIS_E_IO, NULL, "the driver hands out a buffer %u of %u",
                             b->index, c->n);
        c->buffer[b->index].queued = false;
        return 1;
    }
    if (r > 0 && errno == EAGAIN)
        return 0;
    return failed(f, "the stream is broken");
}

int capture_queue(capture *c, unsigned index, fault *f) {
    struct v4l2_buffer b = buffer_of(index);
    c->buffer[index].lent = NULL;
    if (device_ioctl(c->fd, VIDIOC_QBUF, &b))
        return failed(f, "the driver does not take a buffer back");
    c->buffer[index].queued = true;
    return 0;
}

bool capture_may_lend(const capture *c) {
    unsigned queued = 0;
    for (unsigned i = 0; i < c->n; i++)
        queued += c->buffer[i].queued;
    return queued >= KEPT;
}

void capture_lend(capture *c, unsigned index, arris_image *image, size_t first, size_t stride) {
    c->buffer[index].lent = image;
    image->data = c->buffer[index].data + first;
    image->stride = (ptrdiff_t)stride;
}

int capture_reclaim(capture *c, const arris_stage *s, const arris_image *given, fault *f) {
    int r = 0;
    for (unsigned i = 0; r == 0 && i < c->n; i++) {
        const arris_image *lent = c->buffer[i].lent;
        if (lent && (lent == given || !arris_layer_held(s, ARRIS_IMAGE, lent)))
            r = capture_queue(c, i, f);
    }
    return r;
}

void capture_stop(capture *c) {
    int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    if (c->on)
        device_ioctl(c->fd, VIDIOC_STREAMOFF, &type);
    c->on = false;
}

bool capture_is_held(const capture *c, const arris_stage *s) {
    for (unsigned i = 0; i < c->n; i++)
        if (c->buffer[i].lent && arris_layer_held(s, ARRIS_IMAGE, c->buffer[i].lent))
            return true;
    return false;
}

void capture_free(capture *c) {
    for (unsigned i = 0; i < c->n; i++)
        munmap(c->buffer[i].data, c->buffer[i].region);
    c->n = 0;
}
