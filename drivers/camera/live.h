/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * live.h: what every source of a camera shares: its common properties, when its frames were
 * exposed, and how a camera that is lost is looked for. All functions are the stage's thread's.
 */
#ifndef LIVE_H
#define LIVE_H

#include "arris_plugin.h"
#include "fault.h"

typedef struct live {
    const char *camera_path;
    int32_t frames;                /* -1: until it is stopped */
    double retry;                  /* s; -1: for ever */
    double timeout;                /* ms */
    double exposure_time, readout; /* ms; exposure_time -1: as the camera says */

    arris_camera camera;
    int64_t made;    /* frames handed on */
    int64_t lost_at; /* ns; 0: it is not */
    double pause;    /* s, before the next try */
} live;

/* The rows of a property table for `live` at field `l` of T. */
#define LIVE_PROPS(T, l)                                                                           \
    ARRIS_P_INFILE(T, l.camera_path, "camera", NULL,                                               \
                   "a camera.json, the parameters of this camera at this size"),                   \
        ARRIS_P_INT_OR(T, l.frames, "frames", "ever", "ever", 1, INT32_MAX, NULL,                  \
                       "ends after so many frames; ever: when it is stopped"),                     \
        ARRIS_P_DOUBLE_OR(T, l.retry, "retry", "ever", "ever", 0, 1e6, "s",                        \
                          "how long a lost camera is looked for before the stream ends"),          \
        ARRIS_P_DOUBLE(T, l.timeout, "timeout", "3000", 100, 1e6, "ms",                            \
                       "a camera that sends nothing for so long is started anew"),                 \
        ARRIS_P_DOUBLE_OR(T, l.exposure_time, "exposure-time", "auto", "auto", 0, 1e5, "ms",       \
                          "of a frame, to date its middle; auto: as the camera says"),             \
        ARRIS_P_DOUBLE(T, l.readout, "readout", "0", 0, 1e4, "ms",                                 \
                       "from the end of the exposure, of the middle row, to an end-of-frame "      \
                       "stamp")

/* In setup, with format, size and fps in *caps: adds the camera's model, reserves the image, and
 * makes the source a live one. Returns 0 or the error that it has reported. */
int live_setup(arris_stage *s, live *l, arris_caps *caps);

/* Whether it has handed on as many frames as it should. */
bool live_done(const live *l);

/* Dates a frame and counts it. `stamp` is when its exposure began (`start`) or when its last pixel
 * came, CLOCK_MONOTONIC in ns; `exposure` in ms as the camera says, 0 when it does not. The wall
 * clock is read now, so that utime is as true as that clock is at this moment. */
void live_frame(live *l, arris_frame *f, int64_t index, int64_t stamp, bool start, double exposure);

/* The camera is lost, or could not be started: says so once, until live_found. */
void live_lost(arris_stage *s, live *l, const fault *why);

/* It delivers again. */
void live_found(arris_stage *s, live *l);

/* Waits before the next try, each time longer, 0.1 to 2 s. Returns 0, ARRIS_END when the stream is
 * asked to end, or the error it has reported when `retry` is over. */
int live_wait(arris_stage *s, live *l, const fault *why);

#endif
