/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * lcmsrc.c: the stage `lcmsrc`: pictures that come over LCM, or lie in a log of it.
 *
 * The first picture settles size and format for all. The LCM thread copies each into a ring; when
 * that is full the oldest gives way. A log waits instead, so that a replay loses nothing.
 */
#include <lcm/eventlog.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "arris_plugin.h"
#include "camera.h"
#include "link.h"
#include "messages.h"

enum { SLOTS = 4, QUEUE = 8 /* pictures */ };
static const int64_t POLL = 50000000, SILENT = 1000000000; /* ns */

typedef struct slot {
    int64_t index, utime, arrival; /* index: -1: not said */
    uint8_t *data;
} slot;

struct lcmsrc {
    const char *url, *channel, *camera_path;
    double timeout; /* s */

    arris_stage *stage;
    arris_camera camera;
    const arris_camera *known_camera; /* &camera, or NULL */
    lcm_link *link;
    bool log;

    pthread_mutex_t mutex; /* of what follows */
    pthread_cond_t changed;
    enum arris_format format; /* 0: no picture has come yet */
    int32_t width, height;    /* px */
    slot slots[SLOTS];
    uint32_t n, next;                            /* how many are filled; the next to take */
    int64_t heard;                               /* ns, when the last picture came */
    int64_t last, count;                         /* the last index; pictures without one */
    uint64_t malformed, other, overrun, missing; /* since process looked */
};

/* ---- pictures that come in ---------------------------------------------------------------------
 */

static size_t row_bytes(const struct lcmsrc *l) {
    return (size_t)l->width * l->format;
}

/* The format of what follows is that of the first. */
static bool settle_format(struct lcmsrc *l, const arris_image_t *m) {
    l->width = m->width;
    l->height = m->height;
    l->format = m->pixelformat == ARRIS_IMAGE_T_PIXEL_FORMAT_GRAY ? ARRIS_GREY8 : ARRIS_GREY16;
    for (int i = 0; i < SLOTS; i++)
        if (!(l->slots[i].data = malloc(row_bytes(l) * (size_t)l->height)))
            l->format = 0;
    return l->format != 0;
}

static bool is_alike(const struct lcmsrc *l, const arris_image_t *m) {
    enum arris_format format =
        m->pixelformat == ARRIS_IMAGE_T_PIXEL_FORMAT_GRAY ? ARRIS_GREY8 : ARRIS_GREY16;
    return m->width == l->width && m->height == l->height && format == l->format;
}

/* Counts the pictures that the camera has made and we have not got. */
static void follow_index(struct lcmsrc *l, int64_t index) {
    if (index > l->last + 1 && l->last >= 0)
        l->missing += (uint64_t)(index - l->last - 1);
    l->last = index;
}

static void wait_until(struct lcmsrc *l, int64_t ns) {
    struct timespec t = {.tv_sec = ns / 1000000000, .tv_nsec = ns % 1000000000};
    pthread_cond_timedwait(&l->changed, &l->mutex, &t);
}

/* A free slot; NULL when the stream ends. */
static slot *make_room(struct lcmsrc *l) {
    while (l->log && l->n == SLOTS && arris_running(l->stage)) {
        link_set_blocked(l->link, true);
        wait_until(l, arris_now() + POLL);
    }
    link_set_blocked(l->link, false);
    if (l->log && l->n == SLOTS)
        return NULL;
    if (l->n == SLOTS) {
        l->next = (l->next + 1) % SLOTS;
        l->n--;
        l->overrun++;
    }
    return &l->slots[(l->next + l->n) % SLOTS];
}

static void keep(struct lcmsrc *l, const arris_image_t *m, int64_t index, int64_t now) {
    slot *s = make_room(l);
    if (!s)
        return;
    for (int32_t y = 0; y < l->height; y++)
        memcpy(s->data + (size_t)y * row_bytes(l), m->data + (size_t)y * (size_t)m->row_stride,
               row_bytes(l));
    follow_index(l, index);
    s->index = index >= 0 ? index : l->count++;
    s->utime = m->utime;
    s->arrival = now;
    l->n++;
}

static void receive(void *user, const void *data, size_t n) {
    struct lcmsrc *l = user;
    arris_image_t m;
    int64_t index, now = arris_now();
    bool bad = image_read(data, n, &m, &index) != 0;
    pthread_mutex_lock(&l->mutex);
    if (bad)
        l->malformed++;
    else if (l->format ? !is_alike(l, &m) : !settle_format(l, &m))
        l->other++;
    else
        keep(l, &m, index, now);
    if (!bad)
        l->heard = now;
    pthread_cond_broadcast(&l->changed);
    pthread_mutex_unlock(&l->mutex);
}

static void tick(void *user) {
    struct lcmsrc *l = user;
    pthread_mutex_lock(&l->mutex);
    bool silent = !l->log && arris_now() - l->heard > SILENT;
    pthread_mutex_unlock(&l->mutex);
    const char *network = link_trouble(l->link);
    arris_trouble(l->stage, network ? network : silent ? "no pictures come in" : NULL);
}

/* ---- the first picture -------------------------------------------------------------------------
 */

/* A log is looked into for it, since it is played from its beginning only when all listen. */
static void look_into_log(struct lcmsrc *l) {
    lcm_eventlog_t *log = lcm_eventlog_create(link_log(l->link), "r");
    lcm_eventlog_event_t *e = NULL;
    while (log && !l->format && (e = lcm_eventlog_read_next_event(log))) {
        arris_image_t m;
        int64_t index;
        if (strcmp(e->channel, l->channel) == 0 &&
            image_read(e->data, (size_t)e->datalen, &m, &index) == 0)
            settle_format(l, &m);
        lcm_eventlog_free_event(e);
    }
    if (log)
        lcm_eventlog_destroy(log);
}

static int await_first(struct lcmsrc *l, fault *f) {
    int64_t end = arris_now() + (int64_t)(l->timeout * 1e9);
    if (l->log)
        look_into_log(l);
    pthread_mutex_lock(&l->mutex);
    while (!l->log && !l->format && arris_now() < end && arris_running(l->stage))
        wait_until(l, arris_now() + POLL);
    bool found = l->format != 0;
    pthread_mutex_unlock(&l->mutex);
    if (found)
        return 0;
    return fault_set(
        f, ARRIS_E_INPUT, "start the camera first, for example SOURCE ! lcmsink images=every",
        "no picture came on the channel %s%s", l->channel, l->log ? " of the log" : "");
}

static int find_camera(struct lcmsrc *l, fault *f) {
    int r = l->camera_path ? camera_load(l->camera_path, &l->camera, f) : 0;
    if (r < 0 || !l->camera_path)
        return r;
    l->known_camera = &l->camera;
    if (l->camera.width == l->width && l->camera.height == l->height)
        return 0;
    return fault_set(f, ARRIS_E_INPUT, "name the camera that takes them with camera=",
                     "%s is of a camera of %dx%d, and the pictures are %dx%d", l->camera_path,
                     l->camera.width, l->camera.height, l->width, l->height);
}

/* ---- the stage ---------------------------------------------------------------------------------
 */

static int prepare(struct lcmsrc *l, fault *f) {
    pthread_condattr_t attr;
    l->last = -1;
    pthread_mutex_init(&l->mutex, NULL);
    pthread_condattr_init(&attr);
    pthread_condattr_setclock(&attr, CLOCK_MONOTONIC);
    pthread_cond_init(&l->changed, &attr);
    pthread_condattr_destroy(&attr);
    if (!(l->link = link_open(l->url, f)))
        return ARRIS_E_IO;
    l->log = link_log(l->link) != NULL;
    int r = link_subscribe(l->link, l->channel, QUEUE, receive, tick, l, f);
    if (r == 0)
        r = await_first(l, f);
    return r == 0 ? find_camera(l, f) : r;
}

static int setup(arris_stage *s, void *self, arris_caps *caps) {
    struct lcmsrc *l = self;
    fault f;
    l->stage = s;
    int r = prepare(l, &f);
    if (r < 0)
        return arris_fail(s, r, f.hint, "%s", f.text);
    *caps = (arris_caps){
        .format = l->format, .width = l->width, .height = l->height, .camera = l->known_camera};
    arris_set_live(s, !l->log);
    return arris_reserve(s, ARRIS_IMAGE, 0, 0);
}

static void count(arris_stage *s, const char *what, uint64_t *n) {
    if (*n)
        arris_count(s, what, *n);
    *n = 0;
}

/* With the mutex: a picture is there. Otherwise the stream ends. */
static bool await_picture(struct lcmsrc *l) {
    bool ended = false;
    while (!l->n && !ended && arris_running(l->stage)) {
        ended = link_ended(l->link);
        wait_until(l, arris_now() + POLL);
    }
    return l->n > 0 && arris_running(l->stage);
}

static void take(struct lcmsrc *l, arris_image *out, arris_frame *f) {
    const slot *t = &l->slots[l->next];
    for (int32_t y = 0; y < l->height; y++)
        memcpy(out->data + y * out->stride, t->data + (size_t)y * row_bytes(l), row_bytes(l));
    out->camera = l->known_camera;
    arris_frame_set(f, t->index, t->utime);
    arris_frame_set_arrival(f, t->arrival);
    l->next = (l->next + 1) % SLOTS;
    l->n--;
}

static int process(arris_stage *s, void *self, arris_frame *f) {
    struct lcmsrc *l = self;
    link_start(l->link);
    pthread_mutex_lock(&l->mutex);
    bool there = await_picture(l);
    if (there)
        take(l, arris_layer_give(s, f, ARRIS_IMAGE), f);
    count(s, "malformed", &l->malformed);
    count(s, "of another size", &l->other);
    count(s, "overrun", &l->overrun);
    count(s, "missing", &l->missing);
    pthread_cond_broadcast(&l->changed);
    pthread_mutex_unlock(&l->mutex);
    return there ? 0 : ARRIS_END;
}

static void close_lcmsrc(arris_stage *s, void *self) {
    struct lcmsrc *l = self;
    (void)s;
    if (l->link)
        link_unsubscribe(l->link, l);
    link_close(l->link);
    for (int i = 0; i < SLOTS; i++)
        free(l->slots[i].data);
}

#define T struct lcmsrc
static const arris_prop props[] = {
    ARRIS_P_STRING(T, url, "url", NULL,
                   "of the LCM network, or file:///PATH of a log, which is replayed as fast as it "
                   "goes; without it LCM_DEFAULT_URL, or multicast on this machine"),
    ARRIS_P_STRING(T, channel, "channel", "ARRIS_IMAGE", "where the pictures come"),
    ARRIS_P_INFILE(T, camera_path, "camera", NULL, "the camera.json of the camera"),
    ARRIS_P_DOUBLE(T, timeout, "timeout", "10", 0, 3600, "s",
                   "how long it waits for the first picture"),
};

const arris_stage_desc stage_lcmsrc = {
    .size = sizeof(arris_stage_desc),
    .name = "lcmsrc",
    .summary = "pictures that come over LCM (image_t), or lie in a log of it",
    .example = "lcmsrc url=file://run.lcmlog ! fakesink",
    .flags = ARRIS_SOURCE,
    .layers = {.gives = ARRIS_BIT(ARRIS_IMAGE)},
    .self_size = sizeof(struct lcmsrc),
    .props = props,
    .n_props = sizeof props / sizeof *props,
    .setup = setup,
    .process = process,
    .close = close_lcmsrc,
};
