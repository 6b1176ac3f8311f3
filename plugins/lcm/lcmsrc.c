/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * lcmsrc.c: the stage `lcmsrc`: pictures that come over LCM, or lie in a log of it.
 *
 * The first picture settles size and format for all, or camera= and format= do. The LCM thread
 * copies each into a ring (pictures.h); when that is full the oldest gives way. A log waits
 * instead, so that a replay loses nothing.
 */
#include <lcm/eventlog.h>
#include <pthread.h>
#include <string.h>
#include <time.h>

#include "arris_plugin.h"
#include "camera.h"
#include "link.h"
#include "pictures.h"

enum { QUEUE = 8 /* pictures */, ANY = 0 };
static const int64_t POLL = 50000000, SILENT = 1000000000; /* ns */

struct lcmsrc {
    const char *url, *channel, *camera_path;
    double timeout; /* s */
    int32_t format; /* ANY, or an enum arris_format */

    arris_stage *stage;
    arris_camera camera;
    const arris_camera *known_camera; /* &camera, or NULL */
    lcm_link *link;
    bool log;

    pthread_mutex_t mutex; /* of what follows */
    pthread_cond_t changed;
    pictures in;
};

/* ---- pictures that come in ------------------------------------------------------------------- */

static void wait_until(struct lcmsrc *l, int64_t ns) {
    struct timespec t = {.tv_sec = ns / 1000000000, .tv_nsec = ns % 1000000000};
    pthread_cond_timedwait(&l->changed, &l->mutex, &t);
}

/* A log waits until there is room. */
static void await_room(struct lcmsrc *l) {
    while (l->in.n == PICTURES_ROOM && arris_running(l->stage)) {
        link_set_blocked(l->link, true);
        wait_until(l, arris_now() + POLL);
    }
    link_set_blocked(l->link, false);
}

static void receive(void *user, const void *data, size_t n) {
    struct lcmsrc *l = user;
    pthread_mutex_lock(&l->mutex);
    if (l->log)
        await_room(l);
    pictures_receive(&l->in, data, n, arris_now());
    pthread_cond_broadcast(&l->changed);
    pthread_mutex_unlock(&l->mutex);
}

static void tick(void *user) {
    struct lcmsrc *l = user;
    pthread_mutex_lock(&l->mutex);
    bool silent = !l->log && arris_now() - l->in.heard > SILENT;
    pthread_mutex_unlock(&l->mutex);
    const char *network = link_trouble(l->link);
    arris_trouble(l->stage, network ? network : silent ? "no pictures come in" : NULL);
}

/* ---- the first picture ----------------------------------------------------------------------- */

/* A log is looked into for it, since it is played from its beginning only when all listen. */
static void look_into_log(struct lcmsrc *l) {
    lcm_eventlog_t *log = lcm_eventlog_create(link_log(l->link), "r");
    lcm_eventlog_event_t *e = NULL;
    while (log && !l->in.format && (e = lcm_eventlog_read_next_event(log))) {
        if (strcmp(e->channel, l->channel) == 0)
            pictures_settle_by(&l->in, e->data, (size_t)e->datalen);
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
    while (!l->log && !l->in.format && arris_now() < end && arris_running(l->stage))
        wait_until(l, arris_now() + POLL);
    bool found = l->in.format != 0;
    pthread_mutex_unlock(&l->mutex);
    if (found)
        return 0;
    return fault_set(
        f, ARRIS_E_INPUT, "start the camera first, for example SOURCE ! lcmsink images=every",
        "no picture came on the channel %s%s", l->channel, l->log ? " of the log" : "");
}

static int load_camera(struct lcmsrc *l, fault *f) {
    int r = l->camera_path ? camera_load(l->camera_path, &l->camera, f) : 0;
    if (r < 0 || !l->camera_path)
        return r;
    l->known_camera = &l->camera;
    if (l->format != ANY &&
        !pictures_settle(&l->in, l->camera.width, l->camera.height, (enum arris_format)l->format))
        return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for the pictures");
    return 0;
}

static int check_camera(const struct lcmsrc *l, fault *f) {
    const arris_camera *c = l->known_camera;
    if (!c || (c->width == l->in.width && c->height == l->in.height))
        return 0;
    return fault_set(f, ARRIS_E_INPUT, "name the camera that takes them with camera=",
                     "%s is of a camera of %dx%d, and the pictures are %dx%d", l->camera_path,
                     c->width, c->height, l->in.width, l->in.height);
}

/* ---- the stage ------------------------------------------------------------------------------- */

static int prepare(struct lcmsrc *l, fault *f) {
    pthread_condattr_t attr;
    pictures_begin(&l->in);
    l->in.heard = arris_now();
    pthread_mutex_init(&l->mutex, NULL);
    pthread_condattr_init(&attr);
    pthread_condattr_setclock(&attr, CLOCK_MONOTONIC);
    pthread_cond_init(&l->changed, &attr);
    pthread_condattr_destroy(&attr);
    int r = load_camera(l, f);
    if (r < 0)
        return r;
    if (!(l->link = link_open(l->url, f)))
        return ARRIS_E_IO;
    l->log = link_log(l->link) != NULL;
    r = link_subscribe(l->link, l->channel, QUEUE, receive, tick, l, f);
    if (r == 0 && !l->in.format)
        r = await_first(l, f);
    return r == 0 ? check_camera(l, f) : r;
}

static int setup(arris_stage *s, void *self, arris_caps *caps) {
    struct lcmsrc *l = self;
    fault f;
    l->stage = s;
    int r = prepare(l, &f);
    if (r < 0)
        return arris_fail(s, r, f.hint, "%s", f.text);
    *caps = (arris_caps){.format = l->in.format,
                         .width = l->in.width,
                         .height = l->in.height,
                         .camera = l->known_camera};
    arris_set_live(s, !l->log);
    return arris_reserve(s, ARRIS_IMAGE, 0, 0);
}

static void count(arris_stage *s, const char *what, uint64_t *n) {
    if (*n)
        arris_count(s, what, *n);
    *n = 0;
}

/* With the mutex: waits for a picture; NULL: the stream ends. */
static const picture_slot *await_picture(struct lcmsrc *l) {
    for (bool ended = false; !l->in.n && !ended && arris_running(l->stage);) {
        ended = link_ended(l->link);
        wait_until(l, arris_now() + POLL);
    }
    return arris_running(l->stage) ? pictures_take(&l->in) : NULL;
}

static void write_frame(const struct lcmsrc *l, const picture_slot *from, arris_image *out,
                        arris_frame *f) {
    size_t row = pictures_row(&l->in);
    for (int32_t y = 0; y < l->in.height; y++)
        memcpy(out->data + y * out->stride, from->data + (size_t)y * row, row);
    out->camera = l->known_camera;
    arris_frame_set(f, from->index, from->utime);
    arris_frame_set_arrival(f, from->arrival);
}

static int process(arris_stage *s, void *self, arris_frame *f) {
    struct lcmsrc *l = self;
    link_start(l->link);
    pthread_mutex_lock(&l->mutex);
    const picture_slot *next = await_picture(l);
    if (next)
        write_frame(l, next, arris_layer_give(s, f, ARRIS_IMAGE), f);
    count(s, "malformed", &l->in.malformed);
    count(s, "of another size", &l->in.other);
    count(s, "overrun", &l->in.overrun);
    count(s, "missing", &l->in.missing);
    pthread_cond_broadcast(&l->changed);
    pthread_mutex_unlock(&l->mutex);
    return next ? 0 : ARRIS_END;
}

static void close_lcmsrc(arris_stage *s, void *self) {
    struct lcmsrc *l = self;
    (void)s;
    if (l->link)
        link_unsubscribe(l->link, l);
    link_close(l->link);
    pictures_free(&l->in);
}

#define T struct lcmsrc
static const arris_prop props[] = {
    ARRIS_P_STRING(T, url, "url", NULL,
                   "of the LCM network, or file:///PATH of a log, which is replayed as fast as it "
                   "goes; without it LCM_DEFAULT_URL, or multicast on this machine"),
    ARRIS_P_STRING(T, channel, "channel", "ARRIS_IMAGE", "where the pictures come"),
    ARRIS_P_INFILE(T, camera_path, "camera", NULL, "the camera.json of the camera"),
    ARRIS_P_ENUM(T, format, "format", "any", "any|grey8|grey16",
                 "any: that of the first picture, which it waits for before it starts, as for the "
                 "size when there is no camera="),
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
