/* SPDX-License-Identifier: LGPL-2.1-or-later
 * null.c: a stage that does nothing, complete. */
#include "arris_plugin.h"

static int process(arris_stage *s, void *self, arris_frame *f) {
    (void)s, (void)self, (void)f;
    return 0;
}

static const arris_stage_desc stage = {
    .size = sizeof(arris_stage_desc),
    .name = "null",
    .summary = "passes frames on as they are",
    .process = process,
};

ARRIS_PLUGIN("null", "LGPL-2.1-or-later", &stage);
