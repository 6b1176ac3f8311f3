/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * link.c: one LCM connection for each URL of the process (link.h).
 */
#include "link.h"

#include <lcm/lcm.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "arris_plugin.h"

enum { SUBSCRIPTIONS = 16, TICK = 100 /* ms */, RETRY = 1000 /* ms */ };

typedef struct subscription {
    char channel[LCM_MAX_CHANNEL_NAME_LENGTH + 1]; /* empty: the place is free */
    int queue;
    link_handler *handler;
    link_tick *tick;
    void *user;
    lcm_subscription_t *lcm; /* NULL: of a log, or the network has refused so far */
} subscription;

struct lcm_link {
    lcm_link *next;
    char *url;
    int users;
    lcm_t *lcm;          /* NULL: it is a log */
    lcm_eventlog_t *log; /* NULL: it is a network */
    pthread_t thread;
    pthread_mutex_t mutex; /* of `subscriptions`; held while a handler runs */
    subscription subscriptions[SUBSCRIPTIONS];
    pthread_mutex_t sending; /* a log that is written mixes what two threads send at once */
    atomic_bool started, stop, ended, blocked, refused, unsent, damaged;
};

static pthread_mutex_t all_mutex = PTHREAD_MUTEX_INITIALIZER;
static lcm_link *all;

static const char log_scheme[] = "file://";

static const char network_hint[] =
    "is there a route for it? on one machine: ip link set lo up multicast on; ip route add "
    "224.0.0.0/4 dev lo";

int64_t link_utime(void) {
    struct timespec t;
    clock_gettime(CLOCK_REALTIME, &t);
    return (int64_t)t.tv_sec * 1000000 + t.tv_nsec / 1000;
}

/* ---- the thread ------------------------------------------------------------------------------ */

static void handle(const lcm_recv_buf_t *buffer, const char *channel, void *user) {
    const subscription *s = user;
    (void)channel;
    s->handler(s->user, buffer->data, buffer->data_size);
}

static void subscribe_now(lcm_link *l, subscription *s) {
    s->lcm = lcm_subscribe(l->lcm, s->channel, handle, s);
    if (s->lcm)
        lcm_subscription_set_queue_capacity(s->lcm, s->queue);
    atomic_store(&l->refused, !s->lcm);
}

static void tick(lcm_link *l, bool retry) {
    pthread_mutex_lock(&l->mutex);
    for (int i = 0; i < SUBSCRIPTIONS; i++) {
        subscription *s = &l->subscriptions[i];
        if (retry && l->lcm && *s->channel && s->handler && !s->lcm)
            subscribe_now(l, s);
        if (*s->channel && s->tick)
            s->tick(s->user);
    }
    pthread_mutex_unlock(&l->mutex);
}

static void *drain(void *arg) {
    lcm_link *l = arg;
    struct pollfd p = {.fd = lcm_get_fileno(l->lcm), .events = POLLIN};
    int64_t next_tick = 0, next_try = 0;
    while (!atomic_load(&l->stop)) {
        int64_t now = arris_now() / 1000000;
        if (now >= next_tick) {
            tick(l, now >= next_try);
            next_tick = now + TICK;
            next_try = now >= next_try ? now + RETRY : next_try;
        }
        if (poll(&p, 1, TICK) <= 0)
            continue;
        pthread_mutex_lock(&l->mutex);
        int rc = lcm_handle_timeout(l->lcm, 0);
        pthread_mutex_unlock(&l->mutex);
        if (rc < 0) /* not to spin on what does not pass */
            nanosleep(&(struct timespec){0, 1000000}, NULL);
    }
    return NULL;
}

static void hand_out(lcm_link *l, const lcm_eventlog_event_t *e) {
    pthread_mutex_lock(&l->mutex);
    for (int i = 0; i < SUBSCRIPTIONS; i++) {
        const subscription *s = &l->subscriptions[i];
        if (s->handler && strcmp(s->channel, e->channel) == 0)
            s->handler(s->user, e->data, (size_t)e->datalen);
    }
    pthread_mutex_unlock(&l->mutex);
}

static void *play(void *arg) {
    lcm_link *l = arg;
    while (!atomic_load(&l->stop)) {
        bool started = atomic_load(&l->started);
        lcm_eventlog_event_t *e = started ? lcm_eventlog_read_next_event(l->log) : NULL;
        if (e) {
            hand_out(l, e);
            lcm_eventlog_free_event(e);
            continue;
        }
        bool more = started && !feof(l->log->f) && !ferror(l->log->f);
        if (more) /* the next call looks for the event behind the damaged one */
            atomic_store(&l->damaged, true);
        atomic_store(&l->ended, started && !more);
        tick(l, false);
        if (!more)
            nanosleep(&(struct timespec){0, started ? TICK * 1000000 : 5000000}, NULL);
    }
    return NULL;
}

/* ---- opening and closing --------------------------------------------------------------------- */

static int connect_to(lcm_link *l, fault *f) {
    size_t n = strlen(log_scheme);
    if (strncmp(l->url, log_scheme, n) == 0 && !strchr(l->url, '?')) {
        l->log = lcm_eventlog_create(l->url + n, "r");
        return l->log ? 0
                      : fault_set(f, ARRIS_E_INPUT, "a log is file:// and the path to a file",
                                  "cannot open the log %s", l->url);
    }
    l->lcm = lcm_create(l->url);
    return l->lcm
               ? 0
               : fault_set(f, ARRIS_E_IO, network_hint, "cannot reach the LCM network %s", l->url);
}

static void destroy(lcm_link *l) {
    if (l->lcm)
        lcm_destroy(l->lcm);
    if (l->log)
        lcm_eventlog_destroy(l->log);
    pthread_mutex_destroy(&l->mutex);
    pthread_mutex_destroy(&l->sending);
    free(l->url);
    free(l);
}

static lcm_link *make(const char *url, fault *f) {
    lcm_link *l = calloc(1, sizeof *l);
    if (!l || !(l->url = strdup(url))) {
        free(l);
        fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for an LCM connection");
        return NULL;
    }
    pthread_mutex_init(&l->mutex, NULL);
    pthread_mutex_init(&l->sending, NULL);
    int rc = connect_to(l, f);
    if (rc == 0 && pthread_create(&l->thread, NULL, l->log ? play : drain, l))
        rc = fault_set(f, ARRIS_E_MEMORY, NULL, "cannot start the thread of %s", url);
    if (rc == 0)
        return l;
    destroy(l);
    return NULL;
}

lcm_link *link_open(const char *url, fault *f) {
    const char *fallback = getenv("LCM_DEFAULT_URL");
    if (!url)
        url = fallback && *fallback ? fallback : LINK_URL;
    pthread_mutex_lock(&all_mutex);
    lcm_link *l = all;
    while (l && strcmp(l->url, url) != 0)
        l = l->next;
    if (!l && (l = make(url, f))) {
        l->next = all;
        all = l;
    }
    if (l)
        l->users++;
    pthread_mutex_unlock(&all_mutex);
    return l;
}

void link_close(lcm_link *l) {
    if (!l)
        return;
    pthread_mutex_lock(&all_mutex);
    bool last = --l->users == 0;
    lcm_link **at = &all;
    while (last && *at != l)
        at = &(*at)->next;
    if (last)
        *at = l->next;
    pthread_mutex_unlock(&all_mutex);
    if (!last)
        return;
    atomic_store(&l->stop, true);
    pthread_join(l->thread, NULL);
    destroy(l);
}

/* ---- its use --------------------------------------------------------------------------------- */

int link_check_channel(const char *channel, fault *f) {
    static const char good[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-";
    size_t n = strlen(channel);
    if (n > 0 && n <= LCM_MAX_CHANNEL_NAME_LENGTH && strspn(channel, good) == n)
        return 0;
    return fault_set(f, ARRIS_E_USAGE, "1 to 63 letters, digits, '_' or '-'",
                     "'%.80s' is no name for a channel", channel);
}

int link_subscribe(lcm_link *l, const char *channel, int queue, link_handler *h, link_tick *t,
                   void *user, fault *f) {
    int rc = link_check_channel(channel, f), i = 0;
    if (rc)
        return rc;
    pthread_mutex_lock(&l->mutex);
    while (i < SUBSCRIPTIONS && *l->subscriptions[i].channel)
        i++;
    if (i < SUBSCRIPTIONS) {
        subscription *s = &l->subscriptions[i];
        *s = (subscription){.queue = queue, .handler = h, .tick = t, .user = user};
        strcpy(s->channel, channel);
        if (l->lcm && h)
            subscribe_now(l, s);
    }
    pthread_mutex_unlock(&l->mutex);
    return i < SUBSCRIPTIONS
               ? 0
               : fault_set(f, ARRIS_E_USAGE, NULL, "one process has at most %d LCM subscriptions",
                           SUBSCRIPTIONS);
}

void link_unsubscribe(lcm_link *l, void *user) {
    pthread_mutex_lock(&l->mutex);
    for (int i = 0; i < SUBSCRIPTIONS; i++) {
        subscription *s = &l->subscriptions[i];
        if (!*s->channel || s->user != user)
            continue;
        if (s->lcm)
            lcm_unsubscribe(l->lcm, s->lcm);
        *s = (subscription){.channel = ""};
    }
    pthread_mutex_unlock(&l->mutex);
}

int link_publish(lcm_link *l, const char *channel, const void *data, size_t n) {
    pthread_mutex_lock(&l->sending);
    bool sent = l->lcm && lcm_publish(l->lcm, channel, data, (unsigned)n) == 0;
    pthread_mutex_unlock(&l->sending);
    atomic_store(&l->unsent, !sent);
    return sent ? 0 : ARRIS_E_IO;
}

const char *link_trouble(const lcm_link *l) {
    return atomic_load(&l->unsent)    ? "the LCM network does not take messages"
           : atomic_load(&l->refused) ? "the LCM network refuses subscriptions"
           : atomic_load(&l->damaged) ? "the log is damaged: some of it is left out"
                                      : NULL;
}

const char *link_log(const lcm_link *l) {
    return l->log ? l->url + strlen(log_scheme) : NULL;
}

void link_start(lcm_link *l) {
    atomic_store(&l->started, true);
}

bool link_ended(const lcm_link *l) {
    return atomic_load(&l->ended);
}

void link_set_blocked(lcm_link *l, bool blocked) {
    atomic_store(&l->blocked, blocked);
}

bool link_blocked(const lcm_link *l) {
    return atomic_load(&l->blocked);
}
