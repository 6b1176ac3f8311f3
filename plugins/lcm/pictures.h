/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * pictures.h: the pictures that come in over LCM, in a short ring, all of the size and format of
 * the first. No locks: by one thread at a time. Nothing is allocated once that is settled.
 */
#ifndef PICTURES_H
#define PICTURES_H

#include "messages.h"

enum { PICTURES_ROOM = 16 };

typedef struct picture_slot {
    int64_t index, utime, arrival; /* the camera's count, or ours; µs; ns */
    uint8_t *data;                 /* rows without a gap */
} picture_slot;

typedef struct pictures {
    enum arris_format format; /* 0: no picture has come yet */
    int32_t width, height;    /* px */
    picture_slot slot[PICTURES_ROOM];
    uint32_t n, next;    /* how many are filled; the next to take */
    int64_t heard;       /* ns, when the last picture came, or began to be waited for */
    int64_t last, count; /* the camera's last index, -1: none; pictures that have come */
    /* since somebody looked: no message at all; another size or format; given up for a newer one;
     * made by the camera and not received */
    uint64_t malformed, other, overrun, missing;
} pictures;

/* Begins without any. */
void pictures_begin(pictures *p);
void pictures_free(pictures *p);

/* A message that came at `now` (ns): keeps its picture, in the place of the oldest when all are
 * filled. */
void pictures_receive(pictures *p, const void *data, size_t n, int64_t now);

/* Settles size and format beforehand, by what is known or by a message. False when memory is short,
 * or the message is none. */
bool pictures_settle(pictures *p, int32_t width, int32_t height, enum arris_format format);
bool pictures_settle_by(pictures *p, const void *data, size_t n);

static inline size_t pictures_row(const pictures *p) { /* bytes */
    return (size_t)p->width * p->format;
}

/* The oldest; NULL when there is none. It is gone with the next pictures_receive. */
const picture_slot *pictures_take(pictures *p);

#endif
