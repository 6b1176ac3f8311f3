/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * sequence.c: the source `sequence`, whose frames the test program makes up, and the sink `seen`,
 * which shows it what became of them. Both call the program that loads them (tests/sequence.h).
 */
#include "../sequence.h"

#include "arris_plugin.h"

static int setup(arris_stage *s, void *self, arris_caps *caps) {
    (void)self;
    const sequence *q = sequence_now();
    caps->camera = &q->camera;
    caps->width = q->camera.width, caps->height = q->camera.height;
    caps->format = q->draw ? ARRIS_GREY8 : 0;
    arris_reserve(s, ARRIS_POSE, 0, 0);
    return q->draw ? arris_reserve(s, ARRIS_IMAGE, 0, 0)
                   : arris_reserve(s, ARRIS_SEGMENTS, SEQUENCE_SEGMENTS, 0);
}

static int settle(arris_stage *s, void *self, arris_layers *l) {
    (void)s, (void)self;
    l->gives = ARRIS_BIT(ARRIS_POSE) |
               (sequence_now()->draw ? ARRIS_BIT(ARRIS_IMAGE) : ARRIS_BIT(ARRIS_SEGMENTS));
    return 0;
}

static int process(arris_stage *s, void *self, arris_frame *f) {
    int32_t i = (*(int32_t *)self)++;
    const sequence *q = sequence_now();
    if (i == q->frames)
        return ARRIS_END;
    arris_frame_set(f, i, (int64_t)i * 200000);
    arris_pose *pose = arris_layer_give(s, f, ARRIS_POSE);
    if (q->draw) {
        arris_image *image = arris_layer_give(s, f, ARRIS_IMAGE);
        image->camera = &q->camera;
        q->draw(i, pose, image);
    } else {
        arris_segments *segments = arris_layer_give(s, f, ARRIS_SEGMENTS);
        segments->camera = &q->camera;
        q->shoot(i, pose, segments);
    }
    return 0;
}

static int look(arris_stage *s, void *self, arris_frame *f) {
    (void)s, (void)self;
    sequence_look((int)arris_frame_seq(f), arris_layer_get(f, ARRIS_SEGMENTS),
                  arris_layer_get(f, ARRIS_TRACKS), arris_layer_get(f, ARRIS_LINES));
    return 0;
}

static const arris_stage_desc stage_sequence = {
    .size = sizeof(arris_stage_desc),
    .name = "sequence",
    .summary = "frames that a test makes up",
    .flags = ARRIS_SOURCE,
    .layers = {.gives = ARRIS_BIT(ARRIS_POSE) | ARRIS_BIT(ARRIS_IMAGE) | ARRIS_BIT(ARRIS_SEGMENTS)},
    .self_size = sizeof(int32_t),
    .settle = settle,
    .setup = setup,
    .process = process,
};

static const arris_stage_desc stage_seen = {
    .size = sizeof(arris_stage_desc),
    .name = "seen",
    .summary = "what became of the frames of a sequence",
    .flags = ARRIS_SINK,
    .layers = {.needs = ARRIS_BIT(ARRIS_TRACKS) | ARRIS_BIT(ARRIS_LINES)},
    .process = look,
    .finish = look,
};

ARRIS_PLUGIN("sequence", "LGPL-2.1-or-later", &stage_sequence, &stage_seen);
