/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * transfers.c: the stream's transfers.
 */
#include "transfers.h"

#include <stdlib.h>

#include "arris_plugin.h"

enum {
    PACKETS = 32,          /* of an isochronous transfer */
    MOST_BULK = 256 << 10, /* bytes of a bulk transfer */
    STOP_MS = 5000
};

/* ---- what comes ------------------------------------------------------------------------------ */

static void begin(camera *c, const uint8_t *data, size_t n, int64_t now) {
    assembler_begin(&c->pictures, data, n, now);
    if (c->pictures.has_clock)
        clock_note(&c->clock, c->pictures.stc, now);
}

static void take_packets(camera *c, struct libusb_transfer *t, int64_t now) {
    for (int i = 0; i < t->num_iso_packets; i++) {
        const struct libusb_iso_packet_descriptor *p = &t->iso_packet_desc[i];
        if (p->status != LIBUSB_TRANSFER_COMPLETED) {
            assembler_gap(&c->pictures);
        } else if (p->actual_length && p->actual_length <= p->length) {
            begin(c, libusb_get_iso_packet_buffer_simple(t, (unsigned)i), p->actual_length, now);
            assembler_end(&c->pictures);
        }
    }
}

/* A payload may take several transfers; it ends with a short one, or at its greatest size. */
static void take_bulk(camera *c, const struct libusb_transfer *t, int64_t now) {
    size_t n = (size_t)t->actual_length;
    if (c->so_far)
        assembler_more(&c->pictures, t->buffer, n);
    else if (n)
        begin(c, t->buffer, n, now);
    c->so_far += (uint32_t)n;
    if (t->actual_length < t->length || c->so_far >= c->payload) {
        if (c->so_far)
            assembler_end(&c->pictures);
        c->so_far = 0;
    }
}

static void LIBUSB_CALL on_transfer(struct libusb_transfer *t) {
    camera *c = t->user_data;
    c->in_flight--;
    if (c->stopping)
        return;
    switch (t->status) {
    case LIBUSB_TRANSFER_COMPLETED:
        if (t->num_iso_packets)
            take_packets(c, t, arris_now());
        else
            take_bulk(c, t, arris_now());
        break;
    case LIBUSB_TRANSFER_STALL:
        c->stalled = true;
        assembler_gap(&c->pictures);
        return; /* all are submitted anew once the stall is cleared */
    case LIBUSB_TRANSFER_NO_DEVICE:
        c->gone = true;
        return;
    default:
        assembler_gap(&c->pictures);
        c->so_far = 0;
        break;
    }
    int r = libusb_submit_transfer(t);
    c->in_flight += r == 0;
    c->gone |= r == LIBUSB_ERROR_NO_DEVICE;
}

/* ---- their life ------------------------------------------------------------------------------ */

static int submit_all(camera *c, fault *f) {
    for (int i = 0; i < CAMERA_TRANSFERS; i++) {
        int r = libusb_submit_transfer(c->transfer[i]);
        if (r)
            return fault_set(f, ARRIS_E_IO, NULL, "cannot ask for pictures: %s",
                             libusb_strerror(r));
        c->in_flight++;
    }
    return 0;
}

static bool make(camera *c, int i) {
    const uvc_alternate *a = c->alternate;
    uint32_t most = c->payload < MOST_BULK ? c->payload : MOST_BULK;
    size_t size =
        a->bulk ? (most + a->packet - 1) / a->packet * a->packet : (size_t)a->packet * PACKETS;
    struct libusb_transfer *t = libusb_alloc_transfer(a->bulk ? 0 : PACKETS);
    uint8_t *buffer = malloc(size);
    c->transfer[i] = t;
    if (!t || !buffer) {
        free(buffer);
        return false;
    }
    if (a->bulk) {
        libusb_fill_bulk_transfer(t, c->handle, a->endpoint, buffer, (int)size, on_transfer, c, 0);
    } else {
        libusb_fill_iso_transfer(t, c->handle, a->endpoint, buffer, (int)size, PACKETS, on_transfer,
                                 c, 0);
        libusb_set_iso_packet_lengths(t, a->packet);
    }
    t->flags = LIBUSB_TRANSFER_FREE_BUFFER;
    return true;
}

int transfers_start(camera *c, fault *f) {
    c->stopping = c->stalled = c->gone = false;
    c->so_far = 0;
    for (int i = 0; i < CAMERA_TRANSFERS; i++)
        if (!make(c, i))
            return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for transfers");
    int r = submit_all(c, f);
    c->on = r == 0;
    return r;
}

static void wait_for(camera *c, int ms) {
    struct timeval t = {.tv_sec = ms / 1000, .tv_usec = ms % 1000 * 1000};
    libusb_handle_events_timeout_completed(c->usb, &t, NULL);
}

/* Waits until none is on its way. */
static bool drain(camera *c) {
    int64_t end = arris_now() + (int64_t)STOP_MS * 1000000;
    c->stopping = true;
    for (int i = 0; i < CAMERA_TRANSFERS; i++)
        if (c->transfer[i])
            libusb_cancel_transfer(c->transfer[i]);
    while (c->in_flight && arris_now() < end)
        wait_for(c, 100);
    return c->in_flight == 0;
}

static int clear_stall(camera *c, fault *f) {
    if (!drain(c))
        return fault_set(f, ARRIS_E_IO, NULL, "the transfers do not come back");
    int r = libusb_clear_halt(c->handle, c->alternate->endpoint);
    if (r)
        return fault_set(f, ARRIS_E_IO, NULL, "the stream has stalled for good: %s",
                         libusb_strerror(r));
    c->stalls++;
    c->stopping = c->stalled = false;
    c->so_far = 0;
    return submit_all(c, f);
}

int transfers_step(camera *c, int ms, fault *f) {
    wait_for(c, ms);
    if (c->gone)
        return fault_set(f, ARRIS_E_IO, NULL, "it has been unplugged");
    if (c->stalled)
        return clear_stall(c, f);
    return c->in_flight ? 0 : fault_set(f, ARRIS_E_IO, NULL, "no transfer is on its way any more");
}

/* Transfers that do not come back are not freed: the kernel may still write into them. */
void transfers_stop(camera *c) {
    bool idle = c->usb == NULL || drain(c);
    for (int i = 0; i < CAMERA_TRANSFERS; i++) {
        if (c->transfer[i] && idle)
            libusb_free_transfer(c->transfer[i]);
        c->transfer[i] = NULL;
    }
    c->on = false;
}
