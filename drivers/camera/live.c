/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * live.c: what every source of a camera shares.
 */
#include "live.h"

#include <time.h>

#include "camera.h"

static const double first_pause = 0.1, longest_pause = 2; /* s */

int live_setup(arris_stage *s, live *l, arris_caps *caps) {
    fault f;
    if (l->camera_path) {
        int r = camera_load(l->camera_path, &l->camera, &f);
        if (r < 0)
            return arris_fail(s, r, f.hint, "%s", f.text);
        if (l->camera.width != caps->width || l->camera.height != caps->height)
            return arris_fail(s, ARRIS_E_INPUT, "name the one that was calibrated at this size",
                              "%s is of pictures of %dx%d, and these are %dx%d", l->camera_path,
                              l->camera.width, l->camera.height, caps->width, caps->height);
        caps->camera = &l->camera;
    }
    arris_set_live(s, true);
    return arris_reserve(s, ARRIS_IMAGE, 0, 0);
}

bool live_done(const live *l) {
    return l->frames >= 0 && l->made >= l->frames;
}

/* By how much the wall clock is ahead of arris_now, ns: by the quickest of a few readings, since
 * the thread may lose its turn between the two clocks. */
static int64_t wall_ahead(void) {
    int64_t ahead = 0, quickest = INT64_MAX;
    for (int i = 0; i < 3; i++) {
        struct timespec t;
        int64_t before = arris_now();
        clock_gettime(CLOCK_REALTIME, &t);
        int64_t took = arris_now() - before;
        if (took < quickest)
            ahead = (int64_t)t.tv_sec * 1000000000 + t.tv_nsec - before - took / 2, quickest = took;
    }
    return ahead;
}

void live_frame(live *l, arris_frame *f, int64_t index, int64_t stamp, bool start,
                double exposure) {
    double half = (l->exposure_time < 0 ? exposure : l->exposure_time) / 2; /* ms */
    int64_t middle = stamp + (int64_t)(1e6 * (start ? half : -half - l->readout));
    arris_frame_set(f, index, (wall_ahead() + middle) / 1000);
    l->made++;
}

void live_lost(arris_stage *s, live *l, const fault *why) {
    if (l->lost_at)
        return;
    l->lost_at = arris_now();
    l->pause = first_pause;
    arris_count(s, "lost", 1);
    arris_warn(s, "the camera is lost: %s; looking for it", why->text);
}

void live_found(arris_stage *s, live *l) {
    if (l->lost_at)
        arris_warn(s, "the camera is back after %.1f s", (double)(arris_now() - l->lost_at) * 1e-9);
    l->lost_at = 0;
}

int live_wait(arris_stage *s, live *l, const fault *why) {
    int64_t end = arris_now() + (int64_t)(l->pause * 1e9);
    while (arris_running(s) && arris_now() < end)
        nanosleep(&(struct timespec){.tv_nsec = 20000000}, NULL);
    l->pause = 2 * l->pause < longest_pause ? 2 * l->pause : longest_pause;
    if (!arris_running(s))
        return ARRIS_END;
    if (l->retry >= 0 && (double)(arris_now() - l->lost_at) > l->retry * 1e9)
        return arris_fail(s, ARRIS_E_IO, "see that it is plugged in and that nothing else uses it",
                          "the camera has not come back in %g s: %s", l->retry, why->text);
    return 0;
}
