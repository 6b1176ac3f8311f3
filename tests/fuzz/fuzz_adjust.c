/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * fuzz_adjust.c: any bytes as what `arris adjust` reads: after a first byte a lines.json when that
 * is even, else a segments.csv of three frames.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "adjust/input.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n);

static void read_as_lines(const char *text, size_t n) {
    arris_lines lines = {0};
    fault f;
    if (input_lines(text, n, "lines.json", &lines, &f) == 0)
        for (uint32_t i = 0; i < lines.n; i++)
            if (!isfinite(lines.item[i].p[0] + lines.item[i].q[2] + lines.item[i].cov[20]))
                abort();
    free(lines.item);
}

static void read_as_segments(const char *text, size_t n) {
    static frame_entry entry[] = {{"a.png", 0, 0, true, {0}},
                                  {"b.png", 1, 40000, true, {4}},
                                  {"c.png", 7, 80000, false, {0}}};
    const frame_list frames = {.n = 3, .item = entry, .posed = true};
    const arris_camera camera = {.width = 320, .height = 240, .fx = 380, .fy = 380};
    record r = {.n = 0};
    fault f = {.hint = NULL};
    char *copy = malloc(n + 1);
    if (!copy)
        return;
    memcpy(copy, text, n);
    copy[n] = '\0';
    if (input_segments(copy, n, "segments.csv", &frames, &camera, &r, &f) == 0)
        for (uint32_t i = 0; i < r.n; i++)
            if (r.item[i].frame >= r.n_frames || r.item[i].track < 0)
                abort();
    record_free(&r);
    free(copy);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n) {
    if (n > 0)
        (*data % 2 ? read_as_segments : read_as_lines)((const char *)data + 1, n - 1);
    return 0;
}
