/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * states.h: the robot's states as they come in: one robot's, in their order, on a timeline; and
 * what is wrong with them. No locks: by one thread at a time.
 *
 * The first session heard is followed until it has been silent for a second; another one meanwhile
 * is another robot (or a driver started again, which is followed then). Time that jumps back within
 * a session is a clock that was set, or a replay that began anew: the timeline begins anew too.
 * Time that jumps ahead leaves a gap, over which the timeline does not interpolate.
 */
#ifndef STATES_H
#define STATES_H

#include "messages.h"
#include "timeline.h"

enum { STATES_ROOM = 4096 /* 4 s at 1 kHz, 20 s at 200 Hz */ };

enum states_event {
    STATES_MALFORMED,
    STATES_FOREIGN,
    STATES_LATE,
    STATES_JUMPED,
    STATES_STEPPED,
    STATES_EVENTS
};

typedef struct states {
    timeline line;
    int64_t session;
    int32_t seq;
    int32_t error;        /* that the robot reports */
    int64_t began, heard; /* ns: when listening began, and the last state of the session; 0: none */
    uint64_t count[STATES_EVENTS];
    int64_t last[STATES_EVENTS]; /* ns, when it happened last; 0: never */
} states;

/* For states_free. False when memory is short. `now`: arris_now. */
bool states_new(states *s, int64_t now);
void states_free(states *s);

/* A message of the channel, as it came at `now`. */
void states_receive(states *s, const void *data, size_t n, int64_t now);

/* What is wrong now, or was within the last two seconds: a string literal; NULL: nothing. */
const char *states_trouble(const states *s, int64_t now);

/* What a count is called by. */
const char *states_event_name(enum states_event e);

#endif
