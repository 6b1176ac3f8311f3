/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * fuzz_launch.c: any text as a launch line, of the built-in stages. What it is parsed to is checked
 * as a whole, unless the pools of that many queues would take all memory.
 */
#include <stdlib.h>
#include <string.h>

#include "arris.h"

int LLVMFuzzerInitialize(int *argc, char ***argv);
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerInitialize(int *argc, char ***argv) {
    (void)argc, (void)argv;
    return setenv("ARRIS_PLUGIN_PATH", "", 1);
}

/* An error says something, and its caret stands under its line. */
static void look_at(const arris_error *err) {
    if (!arris_exit_code(err->code) || !*err->text || err->column > (int)strlen(err->line))
        abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    char *line = malloc(size + 1);
    memcpy(line, data, size);
    line[size] = '\0';
    arris_error err;
    arris_pipeline *p = arris_parse(line, &err);
    if (!p || (size < 200 && arris_check(p, &err)))
        look_at(&err);
    arris_free(p);
    free(line);
    return 0;
}
