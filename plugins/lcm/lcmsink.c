/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * lcmsink.c: the stage `lcmsink`: tells whoever listens on LCM what the pipeline has: lines as they
 * change, segments, the verdict, its status, pictures.
 *
 * Every second the lines are told whole, for those who came late or lost a message, and at the end
 * once more. The status is sent by the LCM thread, so it goes on when no frame comes.
 */
#include <pthread.h>
#include <string.h>

#include "arris_plugin.h"
#include "lcmtypes/arris_lines_t.h"
#include "outbox.h"

enum { LINES, SEGMENTS, VERDICT, PREVIEW, IMAGES, CONTENTS };
static const double WHOLE = 1; /* s, from one whole set of lines to the next */

struct lcmsink {
    const char *url, *prefix, *pipeline;
    double rate[CONTENTS]; /* 1/s; 0: never; -1: with every frame */
    double status;         /* 1/s; 0: never */

    arris_stage *stage;
    lcm_link *link;
    outbox *out;
    book book;
    int64_t due[CONTENTS], whole; /* ns, when each is to be sent next */
    stamp last;                   /* the newest frame's */

    pthread_mutex_t mutex; /* of what follows: the LCM thread's, and at the end ours */
    int64_t told;          /* ns, when the last status was sent */
    uint64_t frames;       /* as it had them */
    const char *trouble;   /* as it had it */
};

/* ---- status ---------------------------------------------------------------------------------- */

static void send_status(struct lcmsink *k, bool ended) {
    arris_progress p = arris_stage_progress(k->stage);
    int64_t now = arris_now();
    bool due = (double)(now - k->told) * 1e-9 * k->status > 0.95 || p.trouble != k->trouble;
    if (!ended && (!due || p.seconds <= 0))
        return;
    double fps = k->told ? (double)(p.frames - k->frames) / ((double)(now - k->told) * 1e-9) : 0;
    k->told = now;
    k->frames = p.frames;
    k->trouble = p.trouble;
    outbox_status(k->out, k->stage, k->pipeline, fps, ended);
}

static void tick(void *user) {
    struct lcmsink *k = user;
    arris_trouble(k->stage, link_trouble(k->link));
    pthread_mutex_lock(&k->mutex);
    if (k->status > 0)
        send_status(k, false);
    pthread_mutex_unlock(&k->mutex);
}

/* ---- what comes with frames ------------------------------------------------------------------ */

/* Whether a content is to be sent with this frame; counts the time to the next from now. */
static bool is_due(struct lcmsink *k, int content) {
    double rate = k->rate[content];
    int64_t now = arris_now();
    if (rate == 0 || (rate > 0 && now < k->due[content]))
        return false;
    if (rate > 0) {
        int64_t period = (int64_t)(1e9 / rate), next = k->due[content] + period;
        k->due[content] = next > now ? next : now + period;
    }
    return true;
}

static void send_lines(struct lcmsink *k, const arris_lines *lines) {
    book_update(&k->book, lines);
    if (!is_due(k, LINES))
        return;
    if (book_pending(&k->book) &&
        outbox_lines(k->out, &k->last, ARRIS_LINES_T_CHANGES, &k->book, lines) == 0)
        book_told(&k->book);
    int64_t now = arris_now();
    if (now < k->whole)
        return;
    outbox_lines(k->out, &k->last, ARRIS_LINES_T_WHOLE, &k->book, lines);
    k->whole = now + (int64_t)(WHOLE * 1e9);
}

static int process(arris_stage *s, void *self, arris_frame *f) {
    struct lcmsink *k = self;
    const arris_lines *lines = arris_layer_get(f, ARRIS_LINES);
    const arris_segments *segments = arris_layer_get(f, ARRIS_SEGMENTS);
    const arris_verdict *verdict = arris_layer_get(f, ARRIS_VERDICT);
    const arris_image *image = arris_layer_get(f, ARRIS_IMAGE);
    int bad = 0;
    k->last = (stamp){arris_frame_utime(f), arris_frame_index(f)};
    if (lines)
        send_lines(k, lines);
    if (segments && is_due(k, SEGMENTS))
        bad |= outbox_segments(k->out, &k->last, segments, arris_layer_get(f, ARRIS_TRACKS));
    if (verdict && is_due(k, VERDICT))
        bad |= outbox_verdict(k->out, &k->last, verdict, false);
    if (image && is_due(k, IMAGES))
        bad |= outbox_image(k->out, &k->last, image);
    if (image && is_due(k, PREVIEW))
        bad |= outbox_preview(k->out, &k->last, image);
    if (bad)
        arris_count(s, "unsent", 1);
    return 0;
}

static int finish(arris_stage *s, void *self, arris_frame *f) {
    struct lcmsink *k = self;
    const arris_lines *lines = arris_layer_get(f, ARRIS_LINES);
    const arris_verdict *verdict = arris_layer_get(f, ARRIS_VERDICT);
    (void)s;
    if (lines && k->rate[LINES] != 0) {
        book_update(&k->book, lines);
        outbox_lines(k->out, &k->last, ARRIS_LINES_T_FINAL, &k->book, lines);
    }
    if (verdict && k->rate[VERDICT] != 0)
        outbox_verdict(k->out, &k->last, verdict, true);
    pthread_mutex_lock(&k->mutex);
    if (k->status > 0)
        send_status(k, true);
    k->status = 0;
    pthread_mutex_unlock(&k->mutex);
    return 0;
}

/* ---- the stage ------------------------------------------------------------------------------- */

/* Only what is on and there is asked for. */
static int settle(arris_stage *s, void *self, arris_layers *l) {
    static const uint32_t layers[CONTENTS] = {[LINES] = ARRIS_BIT(ARRIS_LINES),
                                              [SEGMENTS] = ARRIS_BIT(ARRIS_SEGMENTS) |
                                                           ARRIS_BIT(ARRIS_TRACKS),
                                              [VERDICT] = ARRIS_BIT(ARRIS_VERDICT),
                                              [PREVIEW] = ARRIS_BIT(ARRIS_IMAGE),
                                              [IMAGES] = ARRIS_BIT(ARRIS_IMAGE)};
    const struct lcmsink *k = self;
    (void)s;
    l->wants = 0;
    for (int i = 0; i < CONTENTS; i++)
        l->wants |= k->rate[i] != 0 ? layers[i] : 0;
    return 0;
}

static int prepare(arris_stage *s, struct lcmsink *k, const arris_caps *caps, fault *f) {
    pthread_mutex_init(&k->mutex, NULL);
    if (!book_new(&k->book, arris_capacity(s, ARRIS_LINES, NULL)))
        return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for the lines");
    if (!(k->link = link_open(k->url, f)))
        return ARRIS_E_IO;
    k->out = outbox_new(k->link, k->prefix, caps, arris_capacity(s, ARRIS_SEGMENTS, NULL), f);
    return k->out ? link_subscribe(k->link, "ARRIS", 1, NULL, tick, k, f) : ARRIS_E_USAGE;
}

static int setup(arris_stage *s, void *self, arris_caps *caps) {
    struct lcmsink *k = self;
    fault f;
    k->stage = s;
    int r = prepare(s, k, caps, &f);
    return r < 0 ? arris_fail(s, r, f.hint, "%s", f.text) : 0;
}

static void close_lcmsink(arris_stage *s, void *self) {
    struct lcmsink *k = self;
    (void)s;
    if (k->link)
        link_unsubscribe(k->link, k);
    link_close(k->link);
    outbox_free(k->out);
    book_free(&k->book);
}

#define T struct lcmsink
static const arris_prop props[] = {
    ARRIS_P_STRING(T, url, "url", NULL,
                   "of the LCM network, or file:///PATH?mode=w of a log to write; without it "
                   "LCM_DEFAULT_URL, or multicast on this machine"),
    ARRIS_P_STRING(T, prefix, "prefix", "ARRIS_", "what the names of the channels begin with"),
    ARRIS_P_STRING(T, pipeline, "pipeline", "arris", "the pipeline's name in its status"),
    ARRIS_P_DOUBLE_OR(T, rate[LINES], "lines", "every", "every", 0, 1000, "1/s",
                      "what has changed of the lines: how often, 0: never, every: with each frame"),
    ARRIS_P_DOUBLE_OR(T, rate[SEGMENTS], "segments", "every", "0", 0, 1000, "1/s",
                      "the segments, likewise"),
    ARRIS_P_DOUBLE_OR(T, rate[VERDICT], "verdict", "every", "2", 0, 1000, "1/s",
                      "the verdict, and at the end the last one, likewise"),
    ARRIS_P_DOUBLE_OR(T, rate[IMAGES], "images", "every", "0", 0, 1000, "1/s",
                      "the picture as it is, for lcmsrc on the same machine, likewise"),
    ARRIS_P_DOUBLE(T, rate[PREVIEW], "preview", "0", 0, 10, "1/s",
                   "the picture made small; 0: never"),
    ARRIS_P_DOUBLE(T, status, "status", "1", 0, 10, "1/s",
                   "how the pipeline is; at once when that changes; 0: never"),
};

const arris_stage_desc stage_lcmsink = {
    .size = sizeof(arris_stage_desc),
    .name = "lcmsink",
    .summary = "tells on LCM: lines as they change, segments, status, the verdict, pictures",
    .example = "imagesrc location=frames.csv ! lcmsink images=every url=file://run.lcmlog?mode=w",
    .flags = ARRIS_SINK,
    .layers = {.wants = ARRIS_BIT(ARRIS_IMAGE) | ARRIS_BIT(ARRIS_SEGMENTS) |
                        ARRIS_BIT(ARRIS_TRACKS) | ARRIS_BIT(ARRIS_LINES) |
                        ARRIS_BIT(ARRIS_VERDICT)},
    .self_size = sizeof(struct lcmsink),
    .props = props,
    .n_props = sizeof props / sizeof *props,
    .settle = settle,
    .setup = setup,
    .process = process,
    .finish = finish,
    .close = close_lcmsink,
};
