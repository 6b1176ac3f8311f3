/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * short.c: a plugin whose stage's descriptor is shorter than any that the host knows.
 */
#include "arris_plugin.h"

static int process(arris_stage *s, void *self, arris_frame *f) {
    (void)s, (void)self, (void)f;
    return 0;
}

static const arris_stage_desc stage = {
    .size = offsetof(arris_stage_desc, settle),
    .name = "testshort",
    .process = process,
};
ARRIS_PLUGIN("short", "LGPL-2.1-or-later", &stage);
