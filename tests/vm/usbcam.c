/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * usbcam.c: a USB video camera in user space, plugged into the kernel's virtual host controller
 * (vhci-hcd) over USB/IP: a real device to uvcvideo and to libusb. It sends numbered pictures
 * (pattern.h) when they are exposed, loses none however late it is asked for them, and misbehaves
 * as it is told:
 *
 *     usbcam bulk|iso [WHAT=EVERY]... [unplug=AT] [silent=AT] [pause=MS] [broken=BYTE] [fast=1]
 *
 * Every EVERY-th picture (of those that are not 0) is: `stall` cut off by a stall of the endpoint
 * and sent anew after it, `id` without a toggled FID, `short` or `long` by 100 bytes, `error`
 * flagged, `header` has a payload with a damaged header, `lost` a packet that did not come. Before
 * picture AT it is unplugged for MS, or silent until it is started anew; with `broken`, that byte
 * of its configuration descriptor is 0xff; with `fast` it sends as fast as it is asked.
 */
#include <endian.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <turbojpeg.h>
#include <unistd.h>

#include "pattern.h"
#include "usbcam.h"

enum { SUBMIT = 1, UNLINK = 2, RET_SUBMIT = 3, RET_UNLINK = 4, HIGH_SPEED = 3 };

static const char *const words[OPTIONS] = {"stall", "id",     "short",  "long",  "error",  "header",
                                           "lost",  "unplug", "silent", "pause", "broken", "fast"};

typedef struct usbip { /* all in network order */
    uint32_t command, number, device, direction, endpoint;
    uint32_t a, b, c, d, e; /* SUBMIT: flags, length, start frame, packets, interval */
    uint8_t setup[8];
} usbip;

typedef struct usbip_packet {
    uint32_t offset, length, actual, status;
} usbip_packet;

struct usbcam cam;

void die(const char *what) {
    fprintf(stderr, "usbcam: %s: %s\n", what, strerror(errno));
    exit(1);
}

/* ---- the wire -------------------------------------------------------------------------------- */

bool read_all(void *to, size_t n) {
    for (size_t at = 0; at < n;) {
        ssize_t r = read(cam.fd, (char *)to + at, n - at);
        if (r <= 0)
            return false;
        at += (size_t)r;
    }
    return true;
}

static void write_all(const void *from, size_t n) {
    for (size_t at = 0; at < n;) {
        ssize_t r = send(cam.fd, (const char *)from + at, n - at, MSG_NOSIGNAL);
        if (r <= 0)
            die("the host is gone");
        at += (size_t)r;
    }
}

void answer(uint32_t number, int status, const void *data, size_t n) {
    usbip r = {.command = htobe32(RET_SUBMIT),
               .number = htobe32(number),
               .a = htobe32((uint32_t)status),
               .b = htobe32((uint32_t)n)};
    write_all(&r, sizeof r);
    if (data && n)
        write_all(data, n);
}

static void plug_in(void) {
    int pair[2];
    char line[64];
    if (socketpair(AF_UNIX, SOCK_STREAM, 0, pair))
        die("no socket");
    int fd = open("/sys/devices/platform/vhci_hcd.0/attach", O_WRONLY);
    int n = snprintf(line, sizeof line, "0 %d 65538 %d", pair[1], HIGH_SPEED);
    for (int tries = 500; write(fd, line, (size_t)n) != n; usleep(20000))
        if (!tries--) /* until what was plugged in before is gone */
            die("cannot attach to vhci_hcd");
    close(fd);
    close(pair[1]);
    cam.fd = pair[0];
    cam.n_waiting = 0;
    cam.streams = cam.halted = cam.begun = false;
}

/* ---- pictures -------------------------------------------------------------------------------- */

static bool is_turn(int what) {
    long every = cam.option[what];
    return every > 0 && cam.number && cam.number % (uint32_t)every == 0;
}

static bool once(int what) {
    bool first = !cam.done[what];
    cam.done[what] = true;
    return first;
}

/* us */
static int64_t exposure(void) {
    return cam.option[FAST] > 0 ? 0 : 100 * (int64_t)cam.exposure;
}

static void encode(const uint8_t *grey) {
    static tjhandle jpeg;
    unsigned long n = 2 * PATTERN_PIXELS;
    jpeg = jpeg ? jpeg : tjInitCompress();
    if (tjCompress2(jpeg, grey, PATTERN_WIDTH, 0, PATTERN_HEIGHT, TJPF_GRAY, &cam.picture, &n,
                    TJSAMP_GRAY, 90, TJFLAG_NOREALLOC))
        die("cannot encode");
    cam.size = n;
}

static void begin_picture(void) {
    static uint8_t grey[PATTERN_PIXELS];
    bool yuyv = cam.probe[2] < 2;
    pattern_draw(grey, (pattern){cam.number, (uint32_t)(cam.due + exposure() / 2)});
    cam.size = (yuyv ? 2 : 1) * PATTERN_PIXELS;
    if (cam.probe[2] == 3)
        encode(grey);
    for (size_t i = 0; i < PATTERN_PIXELS && cam.probe[2] != 3; i++) {
        cam.picture[yuyv ? 2 * i : i] = grey[i];
        if (yuyv)
            cam.picture[2 * i + 1] = (uint8_t)(i * 11); /* colour, which must not matter */
    }
    if (is_turn(SHORT))
        cam.size -= EXCESS;
    if (is_turn(LONG))
        memset(cam.picture + cam.size, 0x55, EXCESS), cam.size += EXCESS;
    cam.id ^= cam.again || !is_turn(ID);
    cam.begun = true;
    cam.sent = cam.in_payload = 0;
    cam.done[ERROR] = cam.done[BAD_HEADER] = cam.done[LOST] = false;
}

static void end_picture(void) {
    cam.begun = cam.again = cam.done[STALL] = false;
    cam.number++;
    cam.due += cam.option[FAST] > 0 ? 1000 : cam.probe[4] == (333333 & 0xff) ? 33333 : 66667;
    cam.due = cam.due < now_us() ? now_us() : cam.due;
}

/* A payload's header; its data is the last of the picture or not. */
static void write_header(uint8_t *p, bool last) {
    bool middle = cam.sent >= cam.size / 3;
    p[0] = is_turn(BAD_HEADER) && (middle || cam.bulk) && once(BAD_HEADER) ? 1 : HEADER;
    p[1] = (uint8_t)(0x80 | 0x04 | 0x08 | cam.id | (last ? 2 : 0));
    if (is_turn(ERROR) && (middle || last) && once(ERROR))
        p[1] |= 0x40;
    put32(p + 2, (uint32_t)cam.due);
    put32(p + 6, (uint32_t)now_us());
    p[10] = p[11] = 0;
}

/* One payload a picture: the request gets as much of it as it has room for. */
static void fill_bulk(const request *r) {
    static uint8_t data[1 << 20];
    size_t n = 0;
    bool middle = cam.sent > cam.size / 3 || r->length > cam.size;
    if (is_turn(STALL) && middle && once(STALL)) {
        cam.halted = cam.again = true;
        cam.begun = false;
        answer(r->number, -EPIPE, NULL, 0);
        return;
    }
    if (cam.in_payload == 0)
        write_header(data, true), n = HEADER;
    size_t most = r->length < sizeof data ? r->length : sizeof data,
           part = cam.size - cam.sent < most - n ? cam.size - cam.sent : most - n;
    memcpy(data + n, cam.picture + cam.sent, part);
    cam.sent += part;
    cam.in_payload += n + part;
    answer(r->number, 0, data, n + part);
    if (cam.sent == cam.size && n + part < r->length)
        end_picture();
}

/* A payload a packet. */
static void fill_packets(const request *r) {
    static uint8_t data[PACKETS * PACKET];
    usbip_packet p[PACKETS];
    uint32_t n = 0, offset = 0;
    for (uint32_t i = 0; i < r->packets; i++) {
        uint32_t size = r->size[i] < PACKET ? r->size[i] : PACKET, actual = 0, status = 0;
        if (cam.begun && size > HEADER) {
            size_t left = cam.size - cam.sent;
            uint32_t part = left < size - HEADER ? (uint32_t)left : size - HEADER;
            bool lost = is_turn(LOST) && cam.sent > cam.size / 2 && once(LOST);
            write_header(data + n, part == left);
            memcpy(data + n + HEADER, cam.picture + cam.sent, part);
            cam.sent += part;
            actual = lost ? 0 : HEADER + part;
            status = lost ? (uint32_t)-EILSEQ : 0;
            if (cam.sent == cam.size)
                end_picture();
        }
        p[i] =
            (usbip_packet){htobe32(offset), htobe32(r->size[i]), htobe32(actual), htobe32(status)};
        n += actual;
        offset += r->size[i];
    }
    usbip h = {.command = htobe32(RET_SUBMIT),
               .number = htobe32(r->number),
               .b = htobe32(n),
               .d = htobe32(r->packets)};
    write_all(&h, sizeof h);
    write_all(data, n);
    write_all(p, r->packets * sizeof *p);
}

static void replug(void) {
    usleep(300000); /* what was sent is to arrive first */
    close(cam.fd);
    usleep((useconds_t)cam.option[PAUSE] * 1000);
    plug_in();
}

/* Answers one request that waits, when there is something to send. False: nothing to do now. */
static bool send_some(void) {
    if (!cam.n_waiting || !cam.streams)
        return false;
    if (cam.halted) {
        answer(cam.waiting[0].number, -EPIPE, NULL, 0);
    } else {
        if (!cam.begun && now_us() < cam.due + exposure())
            return false;
        if (!cam.begun && cam.number == (uint32_t)cam.option[UNPLUG] && once(UNPLUG))
            return replug(), false;
        if (!cam.begun && cam.number == (uint32_t)cam.option[SILENT] && once(SILENT))
            return cam.due = INT64_MAX / 2, false;
        if (!cam.begun)
            begin_picture();
        if (cam.waiting[0].packets)
            fill_packets(&cam.waiting[0]);
        else
            fill_bulk(&cam.waiting[0]);
    }
    memmove(cam.waiting, cam.waiting + 1, --cam.n_waiting * sizeof *cam.waiting);
    return true;
}

/* ---- what the host wants --------------------------------------------------------------------- */

static void on_submit(const usbip *m) {
    uint32_t number = be32toh(m->number), packets = be32toh(m->d);
    if (be32toh(m->endpoint) == 0) {
        on_control(number, m->setup, be32toh(m->b));
        return;
    }
    if (cam.n_waiting == WAITING)
        die("too many requests");
    request *r = &cam.waiting[cam.n_waiting++];
    *r = (request){
        .number = number, .length = be32toh(m->b), .packets = packets == UINT32_MAX ? 0 : packets};
    if (r->packets > PACKETS)
        die("too many packets");
    usbip_packet p;
    for (uint32_t i = 0; i < r->packets; i++) {
        if (!read_all(&p, sizeof p))
            die("the host is gone");
        r->size[i] = be32toh(p.length);
    }
}

/* A request that still waits is forgotten; one that was answered is gone already. */
static void on_unlink(const usbip *m) {
    uint32_t which = be32toh(m->a);
    int status = 0;
    for (unsigned i = 0; i < cam.n_waiting; i++)
        if (cam.waiting[i].number == which) {
            memmove(cam.waiting + i, cam.waiting + i + 1,
                    (--cam.n_waiting - i) * sizeof *cam.waiting);
            status = -ECONNRESET;
            break;
        }
    usbip r = {.command = htobe32(RET_UNLINK), .number = m->number, .a = htobe32((uint32_t)status)};
    write_all(&r, sizeof r);
}

static void serve(void) {
    for (;;) {
        struct pollfd p = {.fd = cam.fd, .events = POLLIN};
        bool more = send_some();
        p.fd = cam.fd;
        if (poll(&p, 1, more ? 0 : 2) <= 0)
            continue;
        usbip m;
        if (!read_all(&m, sizeof m))
            exit(0);
        if (be32toh(m.command) == SUBMIT)
            on_submit(&m);
        else if (be32toh(m.command) == UNLINK)
            on_unlink(&m);
    }
}

int main(int argc, char **argv) {
    cam.option[UNPLUG] = cam.option[SILENT] = -1;
    cam.bulk = argc > 1 && strcmp(argv[1], "bulk") == 0;
    for (int i = 2; i < argc; i++) {
        int k = 0;
        size_t n = strcspn(argv[i], "=");
        while (k < OPTIONS && (strlen(words[k]) != n || memcmp(words[k], argv[i], n) != 0))
            k++;
        if (k == OPTIONS || !argv[i][n])
            return fprintf(stderr, "usbcam: what is '%s'?\n", argv[i]), 2;
        cam.option[k] = atol(argv[i] + n + 1);
    }
    cam.picture = malloc(2 * PATTERN_PIXELS + EXCESS);
    if (!cam.picture)
        return 1;
    cam.exposure_mode = 8;
    cam.exposure = 156;
    cam.gain = 16;
    plug_in();
    serve();
}
