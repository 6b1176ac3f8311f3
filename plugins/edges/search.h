/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * search.h: what the stage `edges` does in a frame: the kernel canny.h, where guide.h does not
 * spare it. Functions are the stage's callbacks or called by them.
 */
#ifndef SEARCH_H
#define SEARCH_H

#include "arris_plugin.h"
#include "canny.h"
#include "guide.h"

typedef struct search {
    bool guided;       /* the property */
    canny *canny;      /* the rest is search_setup's */
    guide *guide;      /* NULL: every picture is searched */
    uint64_t searched; /* the last frame that was */
} search;

/* In settle: a search that is not guided, or only `in_part` of the picture, has no use for lines.
 */
void search_settle(search *e, bool in_part, arris_layers *l);

/* Reserves the layers EDGES and GUIDE. It is guided where there are lines, a pose and a camera, and
 * somebody downstream who looks for lines. Returns 0 or an error. */
int search_setup(arris_stage *s, search *e, const canny_params *p, const arris_caps *caps);

/* Gives the frame both layers. */
int search_run(arris_stage *s, search *e, arris_frame *f);

void search_free(search *e);

#endif
