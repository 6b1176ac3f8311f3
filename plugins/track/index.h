/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * index.h: which segments are near a place in the picture. No dependency on the runtime.
 */
#ifndef INDEX_H
#define INDEX_H

#include "arris_types.h"

typedef struct segment_index segment_index;

/* For at most `max` segments. NULL when memory is short. For index_free. */
segment_index *index_new(size_t max);
void index_free(segment_index *x); /* NULL is allowed */

/* Enters n segments; what was in it is gone. Those that are points or not finite are left out. */
void index_fill(segment_index *x, const arris_segment *s, uint32_t n);

/* The numbers, ascending, of those segments whose bounding rectangle comes nearer than `reach` px
 * to that of the segment `where`, and of some others; *n is how many. Valid until the next call. */
const uint32_t *index_near(segment_index *x, const arris_segment *where, double reach, uint32_t *n);

#endif
