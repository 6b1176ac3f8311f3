/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * follow.c: where a simulated robot truly is (follow.h).
 */
#include "follow.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "handeye.h"
#include "link.h"
#include "messages.h"
#include "rigid.h"
#include "timeline.h"

enum { ROOM = 4096, QUEUE = 256 /* states */, MAX_GAP = 50000 /* us */ };

struct follow {
    bool mounted; /* there is a handeye */
    handeye handeye;
    lcm_link *link;
    pthread_mutex_t mutex; /* of what follows */
    pthread_cond_t changed;
    int64_t session;
    timeline line;
};

/* A robot that begins anew, or whose clock goes back, begins anew here. */
static void receive(void *user, const void *data, size_t n) {
    follow *w = user;
    arris_robot_state_t m;
    if (robot_state_read(data, n, &m) < 0)
        return;
    timed_pose p = {.utime = m.utime};
    memcpy(p.pos, m.pos, sizeof p.pos);
    memcpy(p.quat, m.quat, sizeof p.quat);
    pthread_mutex_lock(&w->mutex);
    const timed_pose *newest = timeline_newest(&w->line);
    if (newest && (m.session != w->session || m.utime <= newest->utime))
        timeline_clear(&w->line);
    w->session = m.session;
    timeline_add(&w->line, &p);
    pthread_cond_signal(&w->changed);
    pthread_mutex_unlock(&w->mutex);
}

int follow_new(follow **made, const char *url, const char *path, fault *f) {
    follow *w = *made = calloc(1, sizeof *w);
    pthread_condattr_t attr;
    if (!w || !timeline_new(&w->line, ROOM))
        return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for %d states of the robot", ROOM);
    pthread_mutex_init(&w->mutex, NULL);
    pthread_condattr_init(&attr);
    pthread_condattr_setclock(&attr, CLOCK_MONOTONIC);
    pthread_cond_init(&w->changed, &attr);
    pthread_condattr_destroy(&attr);
    w->mounted = path != NULL;
    int r = path ? handeye_load(path, &w->handeye, f) : 0;
    if (r < 0)
        return r;
    w->link = link_open(strcmp(url, "default") == 0 ? NULL : url, f);
    return w->link ? link_subscribe(w->link, "ROBOT_TRUTH", QUEUE, receive, NULL, w, f)
                   : ARRIS_E_IO;
}

void follow_free(follow *w) {
    if (!w)
        return;
    if (w->link)
        link_unsubscribe(w->link, w);
    link_close(w->link);
    timeline_free(&w->line);
    free(w);
}

bool follow_pose(follow *w, int64_t utime, int64_t deadline, arris_pose *out) {
    struct timespec t = {.tv_sec = deadline / 1000000000, .tv_nsec = deadline % 1000000000};
    timed_pose p;
    enum timeline_answer a;
    pthread_mutex_lock(&w->mutex);
    while ((a = timeline_at(&w->line, utime, MAX_GAP, &p)) == TIMELINE_TOO_NEW)
        if (pthread_cond_timedwait(&w->changed, &w->mutex, &t))
            break;
    pthread_mutex_unlock(&w->mutex);
    if (a != TIMELINE_FOUND)
        return false;
    timed_pose_write(&p, out);
    if (w->mounted)
        rigid_move(out, w->handeye.t, w->handeye.q);
    return true;
}
