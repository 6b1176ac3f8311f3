/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * fuzz_uvc.c: any bytes as a USB camera's descriptors, and then as its payloads, each with its
 * length before it, whether they are whole or not.
 */
#include <stdlib.h>
#include <string.h>

#include "usb/assembler.h"
#include "usb/descriptors.h"

enum { SIZE = 300 /* of a picture */ };

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n);

static void parse(const uint8_t *data, size_t n) {
    static uvc_camera c;
    fault f;
    if (uvc_parse(data, n, &c, &f))
        return;
    if (!c.n_frames || c.n_frames > UVC_FRAMES || !c.n_alternates ||
        c.n_alternates > UVC_ALTERNATES)
        abort();
    for (uint32_t i = 0; i < c.n_frames; i++)
        if (!c.frame[i].pixels || !c.frame[i].width || !c.frame[i].height ||
            !uvc_interval(&c.frame[i], data[0]))
            abort();
    for (uint32_t i = 0; i < c.n_alternates; i++)
        if (!c.alternate[i].packet)
            abort();
}

static void assemble(const uint8_t *data, size_t n, size_t want) {
    assembler a;
    if (assembler_init(&a, SIZE, want))
        abort();
    for (size_t at = 0; at < n; at += 1 + data[at]) {
        size_t len = data[at] < n - at - 1 ? data[at] : n - at - 1;
        assembler_begin(&a, data + at + 1, len, (int64_t)at);
        if (len & 1)
            assembler_more(&a, data + at + 1, len);
        assembler_end(&a);
        const picture *p = assembler_oldest(&a);
        if (p && (p->n == 0 || p->n > SIZE || (want && p->n != want)))
            abort();
        if (p && len % 3 == 0)
            assembler_next(&a);
    }
    assembler_free(&a);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n) {
    uint8_t *copy = malloc(n ? n : 1);
    memcpy(copy, data, n);
    parse(copy, n);
    assemble(copy, n, 0);
    assemble(copy, n, SIZE);
    free(copy);
    return 0;
}
