/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * plumbing.c: the built-in stages. What queue and tee do is done by the lanes (run.c); here is how
 * they look to the user.
 */
#include <time.h>

#include "internal.h"

static int pass(arris_stage *s, void *self, arris_frame *f) {
    (void)s, (void)self, (void)f;
    return 0;
}

/* ---- queue, tee ------------------------------------------------------------------------------ */

static const arris_prop queue_table[] = {
    ARRIS_P_INT(queue_props, max_frames, "max-frames", "2", 1, 1000, "frames",
                "how many frames wait at most"),
    ARRIS_P_ENUM(queue_props, leaky, "leaky", "no", "no|oldest|newest",
                 "which frame is dropped when it is full; no: the lane before it waits"),
    ARRIS_P_DOUBLE(queue_props, max_latency, "max-latency", "0", 0, 3.6e6, "ms",
                   "frames older than this since their exposure are dropped; 0: none"),
};
const arris_stage_desc stage_queue = {
    .size = sizeof(arris_stage_desc),
    .name = "queue",
    .summary = "starts a new lane: what follows runs in a thread of its own",
    .example = "fakesrc frames=9 ! queue max-frames=2 ! fakesink",
    .self_size = sizeof(queue_props),
    .props = queue_table,
    .n_props = COUNT(queue_table),
    .process = pass,
};

const arris_stage_desc stage_tee = {
    .size = sizeof(arris_stage_desc),
    .name = "tee",
    .summary = "hands every frame to several branches, which share its layers",
    .example = "fakesrc frames=9 ! tee name=t  t. ! queue ! fakesink  t. ! fakesink",
    .process = pass,
};

/* ---- identity -------------------------------------------------------------------------------- */

typedef struct identity {
    double sleep; /* ms */
} identity;

static int identity_process(arris_stage *s, void *self, arris_frame *f) {
    (void)f;
    double sleep = ((identity *)self)->sleep;
    for (int64_t end = sleep > 0 ? arris_now() + (int64_t)(sleep * 1e6) : 0, left;
         end && arris_running(s) && (left = end - arris_now()) > 0;)
        nanosleep(&(struct timespec){0, (long)(left < 50000000 ? left : 50000000)}, NULL);
    return 0;
}

static const arris_prop identity_table[] = {
    ARRIS_P_DOUBLE(identity, sleep, "sleep", "0", 0, 6e4, "ms",
                   "how long each frame is held up, to see how a pipeline bears a slow stage"),
};
static const arris_stage_desc stage_identity = {
    .size = sizeof(arris_stage_desc),
    .name = "identity",
    .summary = "passes frames on as they are",
    .example = "fakesrc frames=9 ! identity ! fakesink",
    .self_size = sizeof(identity),
    .props = identity_table,
    .n_props = COUNT(identity_table),
    .process = identity_process,
};

/* ---- rate ------------------------------------------------------------------------------------ */

typedef struct rate {
    double fps;
    bool begun;
    int64_t next; /* µs; when the next frame may pass */
} rate;

/* By the frames' own time, so that a replay drops what the camera's run would have dropped. */
static int rate_process(arris_stage *s, void *self, arris_frame *f) {
    (void)s;
    rate *r = self;
    int64_t t = arris_frame_utime(f), period = (int64_t)(1e6 / r->fps);
    int64_t early = r->next - t; /* stamps jitter: an eighth of a period is not early */
    if (r->begun && early > period / 8 && early < 2 * period)
        return ARRIS_DROP;
    r->next = r->begun && early > -period && early < period ? r->next + period : t + period;
    r->begun = true;
    return 0;
}

static const arris_prop rate_table[] = {
    ARRIS_P_DOUBLE(rate, fps, "fps", "10", 1e-3, 1e6, "1/s",
                   "frames that pass in a second at most"),
};
static const arris_stage_desc stage_rate = {
    .size = sizeof(arris_stage_desc),
    .name = "rate",
    .summary = "drops frames that come faster than a rate, by the time of their exposure",
    .example = "fakesrc frames=9 ! rate fps=5 ! fakesink",
    .self_size = sizeof(rate),
    .props = rate_table,
    .n_props = COUNT(rate_table),
    .process = rate_process,
};

/* ---- fakesrc, fakesink ----------------------------------------------------------------------- */

typedef struct fakesrc {
    int32_t frames, made;
} fakesrc;

static int fakesrc_process(arris_stage *s, void *self, arris_frame *f) {
    (void)s;
    fakesrc *src = self;
    if (src->frames >= 0 && src->made == src->frames)
        return ARRIS_END;
    arris_frame_set(f, src->made, (int64_t)src->made * 40000);
    src->made++;
    return 0;
}

static const arris_prop fakesrc_table[] = {
    ARRIS_P_INT_OR(fakesrc, frames, "frames", "end", "end", 0, INT32_MAX, NULL,
                   "how many frames; end: until the pipeline is stopped"),
};
static const arris_stage_desc stage_fakesrc = {
    .size = sizeof(arris_stage_desc),
    .name = "fakesrc",
    .summary = "gives empty frames, 40 ms apart by their time, as fast as they are taken",
    .example = "fakesrc frames=9 ! fakesink",
    .flags = ARRIS_SOURCE,
    .self_size = sizeof(fakesrc),
    .props = fakesrc_table,
    .n_props = COUNT(fakesrc_table),
    .process = fakesrc_process,
};

static const arris_stage_desc stage_fakesink = {
    .size = sizeof(arris_stage_desc),
    .name = "fakesink",
    .summary = "takes frames and does nothing with them",
    .example = "fakesrc frames=9 ! fakesink",
    .flags = ARRIS_SINK,
    .process = pass,
};

const arris_stage_desc *const builtin_stages[] = {
    &stage_queue, &stage_tee, &stage_identity, &stage_rate, &stage_fakesrc, &stage_fakesink, NULL};
