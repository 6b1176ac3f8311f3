/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * entries.h: the lines of a scan from within: for scan.c, which adds the views and tells of the
 * lines, and unite.c, which makes each edge one line.
 */
#ifndef ENTRIES_H
#define ENTRIES_H

#include "noise.h"
#include "path.h"
#include "scan.h"
#include "shift.h"

enum { ESTABLISHED = 10 }; /* views, or frames, after which a line is no accident */

typedef struct entry {
    bool tracked;         /* by a track that is alive */
    bool changed;         /* got a view in this frame */
    bool agreed;          /* that was where it was expected */
    bool listed;          /* told of */
    bool leaving;         /* merged or retired; gone with the next frame */
    bool judged;          /* whether to split it, for the end */
    uint32_t next_merge;  /* when the line has seen so many views */
    uint32_t since;       /* `frames` when it began */
    double residual;      /* of this frame's view; 0: none */
    double before;        /* of the frame before */
    arris_line out;       /* its beginning is asked every frame, as is what is above */
    uint32_t told_fit;    /* l.next_fit then, by which fits are told apart */
    double told[6];       /* the ends when they were last said to have moved */
    double contradiction; /* chi-square; see line_contradiction */
    struct entry *into;   /* that it was merged into: its tracks go on as that one's */
    uint32_t at;          /* `frames` when it was last seen */
    line l;               /* last: it is large */
} entry;

typedef struct link {
    int32_t track;
    uint32_t turn; /* of the frame; another one than the table's: the place is free */
    entry *e;
} link;

struct scan {
    scan_params p;
    scene scene;
    noise noise;
    shifts *shifts;           /* for the end */
    path *path;               /* as well */
    entry *pool, **alive;     /* n in the order they came, then the free ones */
    uint32_t n, frames, lost; /* lost: in the last frame */
    uint32_t linked, refused; /* tracks of this frame; those that found no room */
    int32_t newest;           /* the highest track that ever was */
    bool any_measured;        /* of the lines */
    bool all_linked;          /* `before` has the lines without a track, too */
    link *now, *before;       /* hashed by track: of this frame and of the one before */
    uint32_t mask, turn;      /* turn: that of `now`; the one of `before` is less by 1 */
    int32_t splits;           /* lines that began by a split */
    double weighted; /* mm: the noise of the positions by which the lines were last weighted */
    uint32_t next_weighing; /* when `frames` is this */
};

/* Makes *e a line that nothing is told of yet; its views are not touched. */
void entry_prepare(const scan *s, entry *e, int32_t id);

/* Whether what the line says counts for what all share: it is measured, or no line is. */
bool entry_counts(const scan *s, const entry *e);

/* The line is gone with the next frame. */
void entry_leave(entry *e, enum arris_line_change why, int32_t into);

/* Merges the lines that are the same edge, as far as new views ask for it. */
void unite_merge(scan *s);

/* For the end: corrects the poses by what the lines say, splits the lines that contradict
 * themselves then, and merges those that are the same. Leaves the noise `corrected`, unless it is
 * none. */
void unite_finish(scan *s);

#endif
