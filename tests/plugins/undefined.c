/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * undefined.c: a plugin that cannot be loaded, since it wants a function that nothing has.
 */
#include "arris_plugin.h"

int a_function_that_nothing_has(void);

static int process(arris_stage *s, void *self, arris_frame *f) {
    (void)s, (void)self, (void)f;
    return a_function_that_nothing_has();
}

static const arris_stage_desc stage = {
    .size = sizeof(arris_stage_desc),
    .name = "testundefined",
    .process = process,
};
ARRIS_PLUGIN("undefined", "LGPL-2.1-or-later", &stage);
