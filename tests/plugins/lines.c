/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * lines.c: the stage `testlines`: writes down the running lines of every frame.
 */
#include <stdio.h>

#include "arris_plugin.h"

struct lines {
    const char *location;
    FILE *out;
};

static int setup(arris_stage *s, void *self, arris_caps *caps) {
    (void)caps;
    struct lines *w = self;
    w->out = w->location ? fopen(w->location, "w") : NULL;
    return w->out ? 0 : arris_fail(s, ARRIS_E_IO, NULL, "give it a location that can be written");
}

static int process(arris_stage *s, void *self, arris_frame *f) {
    (void)s;
    struct lines *w = self;
    const arris_lines *l = arris_layer_get(f, ARRIS_LINES);
    for (uint32_t i = 0; i < l->n; i++) {
        const arris_line *o = &l->item[i];
        fprintf(w->out, "%lld %d %d %d %d", (long long)arris_frame_index(f), (int)o->id,
                (int)o->state, (int)o->change, (int)o->into);
        for (int k = 0; k < 6; k++)
            fprintf(w->out, " %.17g", k < 3 ? o->p[k] : o->q[k - 3]);
        for (int k = 0; k < 21; k++)
            fprintf(w->out, " %.17g", o->cov[k]);
        fputc('\n', w->out);
    }
    return 0;
}

static void close_lines(arris_stage *s, void *self) {
    (void)s;
    struct lines *w = self;
    if (w->out)
        fclose(w->out);
}

static const arris_prop props[] = {
    ARRIS_P_STRING(struct lines, location, "location", NULL, "the file"),
};
static const arris_stage_desc stage_lines = {
    .size = sizeof(arris_stage_desc),
    .name = "testlines",
    .summary = "writes down the running lines",
    .flags = ARRIS_SINK,
    .layers = {.needs = ARRIS_BIT(ARRIS_LINES)},
    .self_size = sizeof(struct lines),
    .props = props,
    .n_props = sizeof props / sizeof *props,
    .setup = setup,
    .process = process,
    .close = close_lines,
};

ARRIS_PLUGIN("lines", "LGPL-2.1-or-later", &stage_lines);
