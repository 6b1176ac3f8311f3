/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * link.h: edgels to chains.
 */
#ifndef LINK_H
#define LINK_H

#include "gradient.h"

enum {
    LINK_OCTANTS = 8,
    LINK_REACH = 2, /* px: how far apart neighbours may be in x and in y */
    LINK_KEPT = 8,  /* rows */
    LINK_FAR = 5    /* pixels two away within 60 degrees of a direction */
};

/* The pixels of the 5x5 around an edgel are numbered by 8 times the column, plus the row. Two
 * edgels pick each other when the sum of what they pick is twice the middle. */
enum { LINK_MIDDLE = 8 * LINK_REACH + LINK_REACH, LINK_PIXEL = 63 };

/* Which pixels go on best: the one after an edgel and, times 2^8, the one before. Where there is
 * none LINK_LAST, and LINK_MIDDLE before. As long as only the eight around it are known, a 0 is
 * there, with LINK_LAST or LINK_FIRST, and with LINK_OPEN for either. */
typedef uint16_t link_pixels;
enum { LINK_LAST = 1 << 7, LINK_FIRST = 1 << 14, LINK_OPEN = 1 << 15 };

/* Which of the 5x5 pixels go on where none of the eight does: the set of them, 8 bits a column, and
 * the best one of those that are edgels, taken in the order of their bits. */
typedef struct link_far {
    uint64_t set;
    uint8_t best[1 << LINK_FAR];
} link_far;

typedef struct linker {
    link_pixels near[LINK_OCTANTS][512]; /* by the direction, and the 3x3 pixels that are edgels */
    link_far next_far[LINK_OCTANTS], prev_far[LINK_OCTANTS];
    link_pixels *pixels; /* of each edgel, along the edge, brighter side on the right */
    /* The edgel that goes on, if both find so; `end`: none, as for all before they are linked. */
    uint32_t *next, end;
    uint32_t *start, n_starts; /* where open chains begin */
    /* For each column: the edgel there of some rows, the oldest first; in which of the five rows
     * around the one that is looked at there is one, the oldest in the lowest bit; and whether
     * there is one in the newest. */
    uint16_t *index[LINK_KEPT];
    uint8_t *set, *fresh;
    size_t width;
    void *memory;
} linker;

/* For pictures of up to `width` and up to `max` edgels. 0 or ARRIS_E_MEMORY. */
int link_init(linker *l, int width, size_t max);
void link_free(linker *l);

/* Joins the edgels to chains. */
void link_edgels(linker *l, const edgels *e, int height, enum path path);

/* Appends to `out` the chains that have at least `min_length` points and one gradient of at least
 * `high` grey levels per px. Uses up the links. */
void link_chains(linker *l, const edgels *e, float high, uint32_t min_length, arris_edges *out);

#endif
