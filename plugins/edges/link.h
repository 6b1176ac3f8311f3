/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * link.h: edgels to chains.
 */
#ifndef LINK_H
#define LINK_H

#include "gradient.h"

enum { LINK_OCTANTS = 8, LINK_PATTERNS = 512 };

/* Steps to two of the 3x3 pixels around an edgel; the middle one says that there is none. */
typedef struct link_steps {
    uint8_t next, prev;
} link_steps;

typedef struct linker {
    /* by the direction, and by which of the 3x3 pixels are edgels: those that go on best */
    link_steps best[LINK_OCTANTS][LINK_PATTERNS];
    int32_t *next, *prev; /* along the edge, brighter side on the right; an edgel itself: none */
    int32_t *start;       /* where open chains begin */
    int32_t *order;       /* the edgels of all chains */
    int32_t *index[3];    /* of three rows, the oldest first: the edgel in a column */
    uint8_t *bits[3];     /* which columns have one */
    size_t width;
    void *memory;
} linker;

/* For pictures of up to `width` and up to `max` edgels. 0 or ARRIS_E_MEMORY. */
int link_init(linker *l, int width, size_t max);
void link_free(linker *l);

/* Finds every edgel's neighbours. */
void link_edgels(linker *l, const edgels *e, int height);

/* Appends to `out` the chains that have at least `min_length` points and one gradient of at least
 * `high` units. (dx, dy) is added to every point. Uses up the links. */
void link_chains(linker *l, const edgels *e, float unit, float high, uint32_t min_length, float dx,
                 float dy, arris_edges *out, enum path path);

#endif
