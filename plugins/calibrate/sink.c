/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * sink.c: the stage `calibrate`, which `arris calibrate --from` puts at the end of the pipeline
 * that it is given; it hands the pictures to live.c.
 */
#include "arris_plugin.h"

#include "live.h"

struct calibrate {
    bool paced;
};

static int setup(arris_stage *s, void *self, arris_caps *caps) {
    if (!live_runs())
        arris_warn(s, "only `arris calibrate --from` makes something of the views");
    ((struct calibrate *)self)->paced = caps->fps > 0;
    return 0;
}

static int process(arris_stage *s, void *self, arris_frame *frame) {
    fault f;
    if (!live_runs())
        return 0;
    int r = live_take(arris_layer_get(frame, ARRIS_IMAGE), arris_frame_index(frame),
                      ((struct calibrate *)self)->paced, &f);
    return r < 0 ? arris_fail(s, r, f.hint, "%s", f.text) : 0;
}

const arris_stage_desc stage_calibrate = {
    .size = sizeof(arris_stage_desc),
    .name = "calibrate",
    .summary = "collects views of a chessboard for `arris calibrate --from`, which adds it",
    .example = "imagesrc location=frames.csv ! calibrate",
    .flags = ARRIS_SINK,
    .layers = {.needs = ARRIS_BIT(ARRIS_IMAGE)},
    .self_size = sizeof(struct calibrate),
    .setup = setup,
    .process = process,
};
