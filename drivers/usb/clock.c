/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * clock.c: a camera's clock in terms of this machine's.
 */
#include "clock.h"

static const int64_t window = 2000000000, longest = 500000000; /* ns */

void clock_init(source_clock *c, uint32_t hertz) {
    *c = (source_clock){.tick = hertz ? 1e9 / hertz : 0};
}

void clock_note(source_clock *c, uint32_t ticks, int64_t now) {
    if (c->tick == 0)
        return;
    c->ticks += c->known ? (int32_t)(ticks - c->last) : 0;
    c->last = ticks;
    int64_t offset = now - (int64_t)((double)c->ticks * c->tick);
    if (!c->known)
        c->before = c->now = offset;
    if (!c->known || now > c->turn) {
        c->before = c->now;
        c->now = offset;
        c->turn = now + window;
    }
    c->now = offset < c->now ? offset : c->now;
    c->known = true;
}

bool clock_date(const source_clock *c, uint32_t ticks, int64_t arrived, int64_t *when) {
    if (!c->known)
        return false;
    int64_t offset = c->before < c->now ? c->before : c->now;
    *when = (int64_t)((double)(c->ticks + (int32_t)(ticks - c->last)) * c->tick) + offset;
    return *when <= arrived && *when > arrived - longest;
}
