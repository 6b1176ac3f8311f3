/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * assembler.c: pictures from the payloads of a USB video stream.
 */
#include "assembler.h"

#include <stdlib.h>
#include <string.h>

enum { FID = 1, END = 2, PTS = 4, SCR = 8, ERR = 64 }; /* bits of a header */

int assembler_init(assembler *a, size_t size, size_t want) {
    *a = (assembler){.size = size, .want = want, .id = -1};
    a->memory = size <= SIZE_MAX / (ASSEMBLER_PICTURES + 1)
                    ? malloc((ASSEMBLER_PICTURES + 1) * size)
                    : NULL;
    for (size_t i = 0; a->memory && i <= ASSEMBLER_PICTURES; i++)
        a->slot[i].data = a->memory + i * size;
    return a->memory ? 0 : ARRIS_E_MEMORY;
}

void assembler_free(assembler *a) {
    free(a->memory);
    *a = (assembler){.id = -1};
}

static picture *work(assembler *a) {
    return &a->slot[(a->head + a->n) % (ASSEMBLER_PICTURES + 1)];
}

const picture *assembler_oldest(const assembler *a) {
    return a->n ? &a->slot[a->head] : NULL;
}

void assembler_next(assembler *a) {
    a->head = (a->head + 1) % (ASSEMBLER_PICTURES + 1);
    a->n--;
}

/* Ends the picture in work: whole it goes into the ring, in place of the oldest when that is full.
 */
static void finish(assembler *a) {
    const picture *p = work(a);
    bool shorter = p->n == 0 || p->n < a->want;
    a->begun = false;
    if (a->bad || a->over || shorter) {
        a->counts.flagged += a->bad;
        a->counts.longer += !a->bad && a->over;
        a->counts.shorter += !a->bad && !a->over;
        return;
    }
    if (a->n == ASSEMBLER_PICTURES) {
        assembler_next(a);
        a->counts.dropped++;
    }
    a->n++;
}

static void begin_picture(assembler *a, int id, int64_t now) {
    picture *p = work(a);
    p->n = 0;
    p->arrived = now;
    p->has_pts = false;
    a->id = id;
    a->begun = true;
    a->bad = a->over = false;
}

static uint32_t get32(const uint8_t *p) {
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

/* The clocks that a header says it has, as far as it is long enough. */
static void read_clocks(assembler *a, const uint8_t *data) {
    size_t stc = data[1] & PTS ? 6 : 2;
    a->has_clock = data[1] & SCR && data[0] >= stc + 6;
    if (a->has_clock)
        a->stc = get32(data + stc);
    if (a->begun && data[1] & PTS && data[0] >= 6 && !work(a)->has_pts) {
        work(a)->has_pts = true;
        work(a)->pts = get32(data + 2);
    }
}

void assembler_begin(assembler *a, const uint8_t *data, size_t n, int64_t now) {
    a->ends = a->has_clock = false;
    if (n < 2 || data[0] < 2 || data[0] > n) {
        a->counts.flagged += !a->begun;
        a->id = a->begun ? a->id : -1;
        assembler_gap(a);
        return;
    }
    int id = data[1] & FID;
    if (a->begun && id != a->id)
        finish(a); /* its end was not marked */
    if (!a->begun && (n > data[0] || data[1] & ERR)) {
        a->counts.wrong_id += id == a->id;
        begin_picture(a, id, now);
    }
    a->bad |= (data[1] & ERR) != 0;
    a->ends = data[1] & END;
    read_clocks(a, data);
    assembler_more(a, data + data[0], n - data[0]);
}

void assembler_more(assembler *a, const uint8_t *data, size_t n) {
    if (!a->begun)
        return;
    picture *p = work(a);
    size_t room = (a->want ? a->want : a->size) - p->n;
    a->over |= n > room;
    n = n < room ? n : room;
    if (n)
        memcpy(p->data + p->n, data, n);
    p->n += n;
}

void assembler_end(assembler *a) {
    if (a->begun && a->ends)
        finish(a);
    a->ends = false;
}

void assembler_gap(assembler *a) {
    a->ends = false;
    if (a->begun)
        a->bad = true;
}
