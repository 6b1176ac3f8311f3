/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * states.c: the robot's states as they come in (states.h).
 */
#include "states.h"

#include <string.h>

static const int64_t SECOND = 1000000000; /* ns */
static const int64_t SILENT = 500000000;  /* ns: states come at 50 Hz at least */
static const int64_t LATE = 1000000;      /* µs: a message that was overtaken is no older */
static const int64_t STEP = 200000;       /* µs that the states' clock may gain on ours at once */

static const struct {
    const char *name, *trouble;
} events[STATES_EVENTS] = {
    [STATES_MALFORMED] = {"malformed states", "malformed robot states come in"},
    [STATES_FOREIGN] = {"foreign states",
                        "two robots publish states; the one heard first is followed"},
    [STATES_LATE] = {"late states", NULL},
    [STATES_JUMPED] = {"states jumped back", "the robot's states have jumped back in time"},
    [STATES_STEPPED] = {"clock steps", "the clock of the robot's states was set ahead"},
};

bool states_new(states *s, int64_t now) {
    *s = (states){.began = now};
    return timeline_new(&s->line, STATES_ROOM);
}

void states_free(states *s) {
    timeline_free(&s->line);
}

static void note(states *s, enum states_event e, int64_t now) {
    s->count[e]++;
    s->last[e] = now;
}

static timed_pose pose_of(const arris_robot_state_t *m) {
    timed_pose p = {.utime = m->utime, .pos_sigma = m->pos_sigma, .rot_sigma = m->rot_sigma};
    memcpy(p.pos, m->pos, sizeof p.pos);
    memcpy(p.quat, m->quat, sizeof p.quat);
    return p;
}

/* Looks at the step from the newest state to this one. False when it is of no use. */
static bool follows(states *s, const arris_robot_state_t *m, int64_t now) {
    const timed_pose *newest = timeline_newest(&s->line);
    if (!newest)
        return true;
    int64_t step = m->utime - newest->utime, ours = (now - s->heard) / 1000;
    if (step <= 0 && step > -LATE && m->seq <= s->seq) {
        note(s, STATES_LATE, now);
        return false;
    }
    if (step <= 0) {
        note(s, STATES_JUMPED, now);
        timeline_clear(&s->line);
    } else if (step - ours > STEP && step > 2 * ours) {
        note(s, STATES_STEPPED, now);
    }
    return true;
}

void states_receive(states *s, const void *data, size_t n, int64_t now) {
    arris_robot_state_t m;
    if (robot_state_read(data, n, &m)) {
        note(s, STATES_MALFORMED, now);
        return;
    }
    if (s->heard && m.session != s->session && now - s->heard < SECOND) {
        note(s, STATES_FOREIGN, now);
        return;
    }
    if (m.session == s->session && !follows(s, &m, now))
        return;
    if (m.session != s->session)
        timeline_clear(&s->line);
    timed_pose p = pose_of(&m);
    timeline_add(&s->line, &p);
    s->session = m.session;
    s->seq = m.seq;
    s->error = m.error;
    s->heard = now;
}

const char *states_trouble(const states *s, int64_t now) {
    if (now - (s->heard ? s->heard : s->began) > SILENT)
        return s->heard ? "the robot's states have stopped" : "no robot states come in";
    for (int e = 0; e < STATES_EVENTS; e++)
        if (events[e].trouble && s->last[e] && now - s->last[e] < 2 * SECOND)
            return events[e].trouble;
    return s->error ? "the robot reports an error" : NULL;
}

const char *states_event_name(enum states_event e) {
    return events[e].name;
}
