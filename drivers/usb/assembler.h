/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * assembler.h: pictures from the payloads of a USB video stream (USB Video Class 1.1, 2.4.3).
 *
 * Every payload begins with a header: its length, and bits of which FID toggles from picture to
 * picture, EOF marks the last payload of one, ERR an error. A picture is handed on only when it is
 * whole: of uncompressed ones every byte must have come. All functions are one thread's.
 */
#ifndef USB_ASSEMBLER_H
#define USB_ASSEMBLER_H

#include "arris_types.h"

enum { ASSEMBLER_PICTURES = 8 };

typedef struct picture {
    uint8_t *data;
    size_t n;
    int64_t arrived; /* CLOCK_MONOTONIC ns, of its first payload */
    bool has_pts;    /* the camera's clock when its capture began: */
    uint32_t pts;
} picture;

/* What went wrong, counted since the start. */
typedef struct assembler_counts {
    uint64_t flagged;  /* with the error bit, or of which a packet or a header was lost */
    uint64_t shorter;  /* of too few bytes */
    uint64_t longer;   /* of too many */
    uint64_t wrong_id; /* that did not toggle FID */
    uint64_t dropped;  /* whole, but nobody took them in time */
} assembler_counts;

typedef struct assembler {
    size_t size, want; /* bytes: room for a picture; of each exactly, 0: any number */
    uint8_t *memory;
    picture slot[ASSEMBLER_PICTURES + 1]; /* a ring: whole ones, then the one in work */
    unsigned head, n;
    int id;         /* FID of the picture in work, or of the last one; -1: not known yet */
    bool begun;     /* a picture is in work */
    bool ends;      /* this payload is the last of its picture */
    bool bad, over; /* the picture in work has an error; has too many bytes */
    bool has_clock; /* the last header's source clock: */
    uint32_t stc;
    assembler_counts counts;
} assembler;

/* Room for pictures of `size` bytes; those of a fixed size have `want`. Returns 0, ARRIS_E_MEMORY.
 */
int assembler_init(assembler *a, size_t size, size_t want);
void assembler_free(assembler *a);

/* A payload's first bytes, then more of it, then its end. Times are CLOCK_MONOTONIC, ns. */
void assembler_begin(assembler *a, const uint8_t *data, size_t n, int64_t now);
void assembler_more(assembler *a, const uint8_t *data, size_t n);
void assembler_end(assembler *a);

/* Something of the stream was lost here. */
void assembler_gap(assembler *a);

/* The oldest whole picture, or NULL; it stays until assembler_next. */
const picture *assembler_oldest(const assembler *a);
void assembler_next(assembler *a);

#endif
