/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * parts.c: stages for the tests of the drivers. `seen` looks at every byte of the numbered pictures
 * of usbcam and tells which came, and how far their dates are from the truth. `digest` tells what
 * its last picture was. `vividloop` puts a recording out at vivid's video output, and
 * lets what comes back in at its input pass when it is the picture that was put out, bit for bit;
 * only then the next one goes out. So nothing depends on how fast the machine is.
 */
#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <time.h>
#include <turbojpeg.h>
#include <unistd.h>

#include "arris_plugin.h"
#include "bytes.h"
#include "image/picture.h"
#include "pattern.h"

/* ---- seen ------------------------------------------------------------------------------------ */

enum { SEEN_DATES = 99 };

struct seen {
    bool jpeg;
    uint64_t wrong, again;
    int32_t off[SEEN_DATES]; /* us, of a date to the truth */
    int n_dates;
    uint32_t first, last; /* of the run of numbers it is in */
    bool any;
    char text[4096];
    size_t at;
};

static void add_run(struct seen *n) {
    size_t left = sizeof n->text - n->at;
    int w = n->first == n->last ? snprintf(n->text + n->at, left, " %u", n->first)
                                : snprintf(n->text + n->at, left, " %u-%u", n->first, n->last);
    n->at += (size_t)w < left ? (size_t)w : 0;
}

/* As a camera that encodes, and a driver that decodes. */
static void through_jpeg(uint8_t *grey) {
    tjhandle c = tjInitCompress(), d = tjInitDecompress();
    uint8_t *data = NULL;
    unsigned long n = 0;
    if (tjCompress2(c, grey, PATTERN_WIDTH, 0, PATTERN_HEIGHT, TJPF_GRAY, &data, &n, TJSAMP_GRAY,
                    90, 0) ||
        tjDecompress2(d, data, n, grey, PATTERN_WIDTH, 0, PATTERN_HEIGHT, TJPF_GRAY, 0))
        abort();
    tjFree(data);
    tjDestroy(c);
    tjDestroy(d);
}

static bool is_right(const struct seen *n, const arris_image *im, pattern p) {
    uint8_t grey[PATTERN_PIXELS];
    pattern_draw(grey, p);
    if (n->jpeg)
        through_jpeg(grey);
    for (int y = 0; y < PATTERN_HEIGHT; y++)
        if (memcmp(im->data + y * im->stride, grey + y * PATTERN_WIDTH, PATTERN_WIDTH) != 0)
            return false;
    return true;
}

static int seen_process(arris_stage *s, void *self, arris_frame *f) {
    struct seen *n = self;
    const arris_image *im = arris_layer_get(f, ARRIS_IMAGE);
    struct timespec wall;
    if (im->width != PATTERN_WIDTH || im->height != PATTERN_HEIGHT || im->format != ARRIS_GREY8)
        return arris_fail(s, ARRIS_E_INPUT, NULL, "not pictures of usbcam");
    pattern p = pattern_read(im->data, im->stride);
    uint32_t number = p.number;
    n->wrong += !is_right(n, im, p);
    clock_gettime(CLOCK_REALTIME, &wall);
    int64_t ahead = (int64_t)wall.tv_sec * 1000000 + (wall.tv_nsec - arris_now()) / 1000;
    if (n->n_dates < SEEN_DATES)
        n->off[n->n_dates++] = (int32_t)((uint32_t)(arris_frame_utime(f) - ahead) - p.middle);
    if (n->any && number != n->last + 1) {
        n->again += number <= n->last;
        add_run(n);
    }
    if (!n->any || number != n->last + 1)
        n->first = number;
    n->last = number;
    n->any = true;
    return 0;
}

static int by_value(const void *a, const void *b) {
    return *(const int32_t *)a < *(const int32_t *)b ? -1 : 1;
}

static int seen_finish(arris_stage *s, void *self, arris_frame *f) {
    (void)s, (void)f;
    struct seen *n = self;
    if (n->any)
        add_run(n);
    qsort(n->off, (size_t)n->n_dates, sizeof *n->off, by_value);
    printf("seen%s; %llu wrong, %llu out of order, dates %d ms off\n", n->text,
           (unsigned long long)n->wrong, (unsigned long long)n->again,
           n->off[n->n_dates / 2] / 1000);
    return 0;
}

static const arris_prop seen_table[] = {
    ARRIS_P_BOOL(struct seen, jpeg, "jpeg", "false", "whether they were JPEGs on the way"),
};
static const arris_stage_desc seen = {
    .size = sizeof(arris_stage_desc),
    .name = "seen",
    .summary = "tells which of usbcam's pictures came",
    .flags = ARRIS_SINK,
    .layers = {.needs = ARRIS_BIT(ARRIS_IMAGE)},
    .self_size = sizeof(struct seen),
    .props = seen_table,
    .n_props = 1,
    .process = seen_process,
    .finish = seen_finish,
};

/* ---- digest ---------------------------------------------------------------------------------- */

struct digest {
    int32_t pause; /* ms, after each */
    bool any;
    uint32_t hash;
    int32_t width, height;
    uint32_t rows[2]; /* the sums of the even and of the odd ones */
};

/* Of 16 bits the upper 8: so it is the same in all formats. */
static int digest_process(arris_stage *s, void *self, arris_frame *f) {
    (void)s;
    struct digest *d = self;
    const arris_image *im = arris_layer_get(f, ARRIS_IMAGE);
    int step = im->format == ARRIS_GREY16 ? 2 : 1;
    if (!d->any)
        printf("streams\n"), fflush(stdout);
    *d = (struct digest){d->pause, true, 2166136261, im->width, im->height, {0, 0}};
    for (int y = 0; y < im->height; y++)
        for (int x = 0; x < im->width; x++) {
            uint8_t grey = im->data[y * im->stride + step * x + step - 1];
            d->hash = (d->hash ^ grey) * 16777619; /* FNV-1a */
            d->rows[y & 1] += grey;
        }
    nanosleep(&(struct timespec){.tv_nsec = d->pause * 1000000l}, NULL);
    return 0;
}

static int digest_finish(arris_stage *s, void *self, arris_frame *f) {
    (void)s, (void)f;
    struct digest *d = self;
    uint32_t half = d->any ? (uint32_t)(d->width * d->height) / 2 : 1; /* pixels */
    printf("digest %08x, %dx%d, rows %u %u\n", d->hash, d->width, d->height, d->rows[0] / half,
           d->rows[1] / half);
    return 0;
}

static const arris_prop digest_table[] = {
    ARRIS_P_INT(struct digest, pause, "pause", "0", 0, 999, "ms", "after each picture"),
};
static const arris_stage_desc digest = {
    .size = sizeof(arris_stage_desc),
    .name = "digest",
    .summary = "tells what the last picture was",
    .flags = ARRIS_SINK,
    .layers = {.needs = ARRIS_BIT(ARRIS_IMAGE)},
    .self_size = sizeof(struct digest),
    .props = digest_table,
    .n_props = 1,
    .process = digest_process,
    .finish = digest_finish,
};

/* ---- vividloop ------------------------------------------------------------------------------- */

enum { WIDTH = 640, HEIGHT = 480, BUFFERS = 4, PATIENCE = 600 /* frames */ };

struct vividloop {
    const char *location, *device;
    int fd;
    int32_t frames;
    uint8_t *grey; /* all pictures */
    uint8_t *buffer[BUFFERS];
    int32_t next;     /* the picture that is out */
    unsigned strange; /* frames since it was put out that are not it */
};

static int load(struct vividloop *v, fault *f) {
    char path[4096];
    bytes file = {.data = NULL};
    int r = 0;
    v->grey = malloc((size_t)v->frames * WIDTH * HEIGHT);
    for (int32_t i = 0; r == 0 && i < v->frames; i++) {
        arris_image im = {ARRIS_GREY8, WIDTH, HEIGHT, WIDTH, NULL, v->grey + i * WIDTH * HEIGHT};
        snprintf(path, sizeof path, "%s/%04d.pgm", v->location, i);
        r = bytes_read(&file, path, 1 << 24, f);
        if (r == 0)
            r = picture_decode(file.data, file.n, &im, f);
    }
    free(file.data);
    return r;
}

static struct v4l2_buffer buffer_of(unsigned index) {
    return (struct v4l2_buffer){.index = index,
                                .type = V4L2_BUF_TYPE_VIDEO_OUTPUT,
                                .memory = V4L2_MEMORY_MMAP,
                                .field = V4L2_FIELD_NONE};
}

static bool open_output(struct vividloop *v) {
    struct v4l2_format m = {.type = V4L2_BUF_TYPE_VIDEO_OUTPUT};
    struct v4l2_requestbuffers r = {
        .count = BUFFERS, .type = V4L2_BUF_TYPE_VIDEO_OUTPUT, .memory = V4L2_MEMORY_MMAP};
    v->fd = open(v->device, O_RDWR | O_NONBLOCK | O_CLOEXEC);
    if (v->fd < 0 || ioctl(v->fd, VIDIOC_G_FMT, &m))
        return false;
    m.fmt.pix.width = WIDTH;
    m.fmt.pix.height = HEIGHT;
    m.fmt.pix.pixelformat = V4L2_PIX_FMT_RGB24;
    m.fmt.pix.field = V4L2_FIELD_NONE;
    m.fmt.pix.bytesperline = 0;
    if (ioctl(v->fd, VIDIOC_S_FMT, &m) || m.fmt.pix.width != WIDTH || m.fmt.pix.height != HEIGHT ||
        ioctl(v->fd, VIDIOC_REQBUFS, &r) || r.count < BUFFERS)
        return false;
    for (unsigned i = 0; i < BUFFERS; i++) {
        struct v4l2_buffer b = buffer_of(i);
        if (ioctl(v->fd, VIDIOC_QUERYBUF, &b))
            return false;
        v->buffer[i] = mmap(NULL, b.length, PROT_READ | PROT_WRITE, MAP_SHARED, v->fd, b.m.offset);
        if (v->buffer[i] == MAP_FAILED)
            return false;
    }
    return true;
}

/* The last buffer that is queued stays out until there is another. */
static bool put_out(struct vividloop *v, int32_t i) {
    struct v4l2_buffer b = buffer_of((unsigned)i % BUFFERS), done = buffer_of(0);
    while (ioctl(v->fd, VIDIOC_DQBUF, &done) == 0)
        ;
    for (size_t k = 0; k < WIDTH * HEIGHT; k++)
        memset(v->buffer[i % BUFFERS] + 3 * k, v->grey[i * WIDTH * HEIGHT + k], 3);
    b.bytesused = 3 * WIDTH * HEIGHT;
    int type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
    return ioctl(v->fd, VIDIOC_QBUF, &b) == 0 && (i || ioctl(v->fd, VIDIOC_STREAMON, &type) == 0);
}

static int loop_setup(arris_stage *s, void *self, arris_caps *caps) {
    struct vividloop *v = self;
    fault f;
    if (caps->width != WIDTH || caps->height != HEIGHT)
        return arris_fail(s, ARRIS_E_INPUT, NULL, "not 640x480");
    int r = load(v, &f);
    if (r < 0)
        return arris_fail(s, r, f.hint, "%s", f.text);
    if (!open_output(v))
        return arris_fail(s, ARRIS_E_IO, NULL, "cannot set up %s: %s", v->device, strerror(errno));
    return 0;
}

static unsigned differences(const struct vividloop *v, const arris_image *im) {
    const uint8_t *grey = v->grey + v->next * WIDTH * HEIGHT;
    unsigned n = 0;
    for (int y = 0; y < HEIGHT; y++)
        if (memcmp(im->data + y * im->stride, grey + y * WIDTH, WIDTH) != 0)
            for (int x = 0; x < WIDTH; x++)
                n += im->data[y * im->stride + x] != grey[y * WIDTH + x];
    return n;
}

static int loop_process(arris_stage *s, void *self, arris_frame *f) {
    struct vividloop *v = self;
    const arris_image *im = arris_layer_get(f, ARRIS_IMAGE);
    if (v->next == v->frames)
        return ARRIS_DROP;
    if (v->next == 0 && v->strange == 0 && !put_out(v, 0))
        return arris_fail(s, ARRIS_E_IO, NULL, "cannot put out: %s", strerror(errno));
    unsigned n = differences(v, im);
    if (n && ++v->strange > PATIENCE)
        return arris_fail(s, ARRIS_E_INPUT, NULL, "picture %d comes back with %u other pixels",
                          v->next, n);
    if (n)
        return ARRIS_DROP;
    arris_frame_set(f, v->next, arris_frame_utime(f));
    v->strange = 1;
    if (++v->next == v->frames)
        kill(getpid(), SIGINT); /* as a user ends a stream */
    else if (!put_out(v, v->next))
        return arris_fail(s, ARRIS_E_IO, NULL, "cannot put out: %s", strerror(errno));
    return 0;
}

static void loop_close(arris_stage *s, void *self) {
    (void)s;
    struct vividloop *v = self;
    printf("vividloop: %d of %d came back bit for bit\n", v->next, v->frames);
    free(v->grey);
    if (v->fd > 0)
        close(v->fd);
}

static const arris_prop loop_table[] = {
    ARRIS_P_INFILE(struct vividloop, location, "location", NULL, "the folder of pad's pictures"),
    ARRIS_P_INT(struct vividloop, frames, "frames", "120", 1, 1000, NULL, "how many there are"),
    ARRIS_P_STRING(struct vividloop, device, "device", NULL, "vivid's output"),
};
static const arris_stage_desc vividloop = {
    .size = sizeof(arris_stage_desc),
    .name = "vividloop",
    .summary = "puts a recording out at vivid, and passes what comes back",
    .layers = {.needs = ARRIS_BIT(ARRIS_IMAGE)},
    .self_size = sizeof(struct vividloop),
    .props = loop_table,
    .n_props = sizeof loop_table / sizeof *loop_table,
    .setup = loop_setup,
    .process = loop_process,
    .close = loop_close,
};

ARRIS_PLUGIN("vmparts", "LGPL-2.1-or-later", &seen, &digest, &vividloop);
