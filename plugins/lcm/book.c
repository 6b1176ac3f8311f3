/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * book.c: what the subscribers of ARRIS_LINES have been told (book.h).
 */
#include "book.h"

#include <stdlib.h>

bool book_new(book *b, size_t lines) {
    *b = (book){.max = (uint32_t)(2 * lines), .item = calloc(2 * lines + 1, sizeof *b->item)};
    return b->item != NULL;
}

void book_free(book *b) {
    free(b->item);
    *b = (book){.n = 0};
}

/* Both lists are in the order in which the lines came: the next one is nearly always where the last
 * search ended. */
static book_line *find(const book *b, int32_t id, uint32_t *cursor) {
    for (uint32_t k = 0; k < b->n; k++, *cursor = *cursor + 1 < b->n ? *cursor + 1 : 0)
        if (*cursor < b->n && b->item[*cursor].l.id == id)
            return &b->item[*cursor];
    return NULL;
}

static void add(book *b, const arris_line *l) {
    if (b->n == b->max)
        b->lost++;
    else
        b->item[b->n++] = (book_line){.l = *l, .pending = ARRIS_ADDED, .seen = true};
}

static void update_one(book_line *e, const arris_line *l) {
    e->l = *l;
    e->seen = true;
    if (l->change == ARRIS_MERGED || l->change == ARRIS_RETIRED)
        e->pending = l->change;
    else if (book_gone(e))
        e->pending = e->told ? ARRIS_MOVED : ARRIS_ADDED;
    else if (l->change != ARRIS_SAME && e->pending == ARRIS_SAME)
        e->pending = ARRIS_MOVED;
}

/* Retires what is not there any more, and forgets what went before it was ever told of. */
static void sweep(book *b) {
    uint32_t n = 0;
    for (uint32_t i = 0; i < b->n; i++) {
        book_line *e = &b->item[i];
        if (!e->seen && !book_gone(e)) {
            e->pending = ARRIS_RETIRED;
            e->l.into = -1;
        }
        if (e->told || !book_gone(e))
            b->item[n++] = *e;
    }
    b->n = n;
}

void book_update(book *b, const arris_lines *lines) {
    uint32_t cursor = 0;
    for (uint32_t i = 0; i < b->n; i++)
        b->item[i].seen = false;
    for (uint32_t i = 0; i < lines->n; i++) {
        const arris_line *l = &lines->item[i];
        book_line *e = find(b, l->id, &cursor);
        if (e)
            update_one(e, l);
        else if (l->change != ARRIS_MERGED && l->change != ARRIS_RETIRED)
            add(b, l);
    }
    sweep(b);
}

uint32_t book_total(const book *b) {
    uint32_t n = 0;
    for (uint32_t i = 0; i < b->n; i++)
        n += !book_gone(&b->item[i]);
    return n;
}

uint32_t book_pending(const book *b) {
    uint32_t n = 0;
    for (uint32_t i = 0; i < b->n; i++)
        n += b->item[i].pending != ARRIS_SAME;
    return n;
}

void book_told(book *b) {
    uint32_t n = 0;
    for (uint32_t i = 0; i < b->n; i++) {
        book_line *e = &b->item[i];
        if (book_gone(e))
            continue;
        e->pending = ARRIS_SAME;
        e->told = true;
        b->item[n++] = *e;
    }
    b->n = n;
}
