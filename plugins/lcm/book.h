/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * book.h: what the subscribers of ARRIS_LINES have been told, and what they are still to be told. A
 * change stays to be told until it was sent, so a rate, a dropped frame or a network that is gone
 * for a while loses none. No locks; nothing is allocated after book_new.
 */
#ifndef BOOK_H
#define BOOK_H

#include "arris_types.h"

typedef struct book_line {
    arris_line l;
    enum arris_line_change pending; /* to be told; ARRIS_SAME: nothing */
    bool told;                      /* of its being there */
    bool seen;                      /* in the newest layer */
} book_line;

typedef struct book {
    uint32_t n, max;
    uint64_t lost; /* lines that found no room */
    book_line *item;
} book;

/* Room for `lines` lines that are there, and as many that have gone. False when memory is short. */
bool book_new(book *b, size_t lines);
void book_free(book *b);

/* The newest lines. Those that have gone without a word, with a frame that was dropped, are
 * retired.
 */
void book_update(book *b, const arris_lines *lines);

/* Whether a line has gone: it is told of among the changes and not of the whole. */
static inline bool book_gone(const book_line *l) {
    return l->pending == ARRIS_MERGED || l->pending == ARRIS_RETIRED;
}

/* How many lines are there; how many have something to tell. */
uint32_t book_total(const book *b);
uint32_t book_pending(const book *b);

/* All that was pending has been told. */
void book_told(book *b);

#endif
