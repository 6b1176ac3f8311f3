/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * link.h: edgels to chains.
 */
#ifndef LINK_H
#define LINK_H

#include "gradient.h"

enum {
    LINK_OCTANTS = 8,
    LINK_REACH = 2,                 /* px: how far apart neighbours may be in x and in y */
    LINK_KEPT = 2 * LINK_REACH + 2, /* rows */
    LINK_FAR = 5,                   /* pixels two away within 60 degrees of a direction */
    LINK_BLOCK = 64                 /* edgels that are looked at together */
};

/* Which of the eight pixels around an edgel go on best; 8: none. */
typedef struct link_near {
    uint8_t next, prev;
} link_near;

/* Which of the 5x5 pixels go on where none of the eight does: the set of them, 8 bits a column, and
 * the best one of those that are edgels, taken in the order of their bits; for none the middle one.
 */
typedef struct link_far {
    uint64_t set;
    uint8_t best[1 << LINK_FAR]; /* 8 times the column and the row */
} link_far;

typedef struct linker {
    link_near near[LINK_OCTANTS][512]; /* by the direction, and the 3x3 pixels that are edgels */
    link_far next_far[LINK_OCTANTS], prev_far[LINK_OCTANTS];
    /* Of each edgel, along the edge, brighter side on the right; itself: none. */
    uint32_t *next, *prev;
    uint32_t *start, n_starts; /* where open chains begin */
    /* For each column: the edgel there of some rows, the oldest first; of which of these rows but
     * the newest there is one, the oldest in the lowest bit; and whether there is one of that. */
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
