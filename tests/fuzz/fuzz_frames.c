/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * fuzz_frames.c: any bytes as a frames.csv.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "frames.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n);

static void check(const frame_entry *e) {
    arris_pose pose;
    frames_pose(e, &pose);
    for (int k = 0; k < 9; k++)
        if (!*e->file || !isfinite(pose.R[k]) || !isfinite(pose.C[k % 3]))
            abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n) {
    char *text = malloc(n + 1);
    frame_list l = {.n = 0};
    fault f;
    memcpy(text, data, n);
    text[n] = 0;
    if (frames_parse(&l, text, n, "frames.csv", &f) == 0)
        for (size_t k = 0; k < l.n; k++)
            check(&l.item[k]);
    frames_free(&l);
    free(text);
    return 0;
}
