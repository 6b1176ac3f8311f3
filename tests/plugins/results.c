/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * results.c: the source `results` for the tests of sinks: results that are known by heart.
 *
 * Frame i has index 10 + i, a pose at x = 10 i mm (none in frame 2), i % 3 + 1 segments, of which
 * number k runs from (i, k) to (i + 30, k + 40), and the tracks of the table below. The lines are
 * one that is measured, one weak, one unobservable and one that was merged into the first.
 */
#include "arris_plugin.h"

#define N 6

struct results {
    int32_t frames, made;
};

/* By frame: pairs of track and segment until {-1}. */
static const arris_track tracks_of[N][4] = {
    {{0, 0}, {-1, 0}},
    {{0, 1}, {1, 0}, {-1, 0}},
    {{0, -1}, {1, 2}, {2, 0}, {-1, 0}},
    {{2, 0}, {-1, 0}},
    {{-1, 0}},
    {{1, 2}, {3, 1}, {-1, 0}},
};

static int setup(arris_stage *s, void *self, arris_caps *caps) {
    (void)self, (void)caps;
    arris_reserve(s, ARRIS_POSE, 0, 0);
    arris_reserve(s, ARRIS_SEGMENTS, 3, 0);
    arris_reserve(s, ARRIS_TRACKS, 4, 0);
    return arris_reserve(s, ARRIS_LINES, 4, 0);
}

static void give_lines(arris_stage *s, arris_frame *f, uint32_t frames) {
    static const arris_line line[4] = {
        {.id = 0, .state = ARRIS_MEASURED, .into = -1, .p = {0, -50, 700}, .q = {0, 50, 700.5}},
        {.id = 2, .state = ARRIS_WEAK, .into = -1, .p = {20, -50, 700}, .q = {20, 50, 900}},
        {.id = 3, .state = ARRIS_UNOBSERVABLE, .into = -1, .q = {1e6, 0, 0}},
        {.id = 4, .change = ARRIS_MERGED, .into = 0, .p = {0, -40, 700}, .q = {0, 40, 700}},
    };
    arris_lines *l = arris_layer_give(s, f, ARRIS_LINES);
    l->frames = frames;
    l->pose_sigma = 0.25;
    for (l->n = 0; l->n < 4; l->n++) {
        l->item[l->n] = line[l->n];
        l->item[l->n].cov[0] = l->item[l->n].cov[6] = 0.01;
        l->item[l->n].views = frames;
    }
}

static int process(arris_stage *s, void *self, arris_frame *f) {
    struct results *r = self;
    if (r->made == r->frames)
        return ARRIS_END;
    int i = r->made++;
    arris_frame_set(f, 10 + i, 1000 * i);
    arris_pose *pose = arris_layer_give(s, f, ARRIS_POSE);
    *pose = (arris_pose){.valid = i != 2, .C = {10. * i}, .R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    arris_segments *segments = arris_layer_give(s, f, ARRIS_SEGMENTS);
    for (int k = 0; k <= i % 3; k++)
        segments->item[segments->n++] = (arris_segment){.x1 = i,
                                                        .y1 = k,
                                                        .x2 = i + 30,
                                                        .y2 = k + 40,
                                                        .cov = {0.0625, 0, 1e-6},
                                                        .lo = 20,
                                                        .hi = 220.5F,
                                                        .chi2 = 1.25F};
    arris_tracks *tracks = arris_layer_give(s, f, ARRIS_TRACKS);
    for (const arris_track *t = tracks_of[i % N]; t->id >= 0; t++)
        tracks->item[tracks->n++] = *t;
    tracks->total = i < 1 ? 1 : i < 2 ? 2 : i < 5 ? 3 : 4;
    give_lines(s, f, (uint32_t)r->made);
    return 0;
}

static int finish(arris_stage *s, void *self, arris_frame *f) {
    give_lines(s, f, (uint32_t)((struct results *)self)->made);
    return 0;
}

static const arris_prop props[] = {
    ARRIS_P_INT(struct results, frames, "frames", "6", 0, 1e9, NULL, "how many"),
};
static const arris_stage_desc stage_results = {
    .size = sizeof(arris_stage_desc),
    .name = "results",
    .summary = "results that are known",
    .flags = ARRIS_SOURCE,
    .layers = {.gives = ARRIS_BIT(ARRIS_POSE) | ARRIS_BIT(ARRIS_SEGMENTS) |
                        ARRIS_BIT(ARRIS_TRACKS) | ARRIS_BIT(ARRIS_LINES)},
    .self_size = sizeof(struct results),
    .props = props,
    .n_props = sizeof props / sizeof *props,
    .setup = setup,
    .process = process,
    .finish = finish,
};

ARRIS_PLUGIN("results", "LGPL-2.1-or-later", &stage_results);
