/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * link.h: one LCM connection for each URL of the process, with one thread that drains it. LCM drops
 * the newest messages when its own queues are full, so handlers copy what they want at once and
 * never wait for a pipeline; but the one who reads a log (file://...) may, since a log waits too.
 */
#ifndef LINK_H
#define LINK_H

#include "fault.h"

/* Where nothing else is said: multicast that does not leave the machine. LCM_DEFAULT_URL is asked
 * first. */
#define LINK_URL "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=4194304"

typedef struct lcm_link lcm_link;

/* Of a message's n bytes, by the link's thread. */
typedef void link_handler(void *user, const void *data, size_t n);
/* Some ten times a second, by the link's thread. */
typedef void link_tick(void *user);

/* The connection to `url`, or to the default when that is NULL; for link_close. A log is read from
 * link_start on, as fast as it is taken unless the URL says otherwise. Returns NULL with *f filled:
 * ARRIS_E_IO, _USAGE, _MEMORY. Any thread. */
lcm_link *link_open(const char *url, fault *f);
void link_close(lcm_link *l); /* NULL is allowed */

/* The path of the log that is read; NULL when it is a network, or a log that is written
 * (file:///PATH?mode=w). */
const char *link_log(const lcm_link *l);
void link_start(lcm_link *l);
/* A log: all was read, or it cannot be. */
bool link_ended(const lcm_link *l);

/* A handler of a log says that it waits until somebody takes what it has, and nothing more will be
 * read until then; and whoever waits for something more to be read asks. */
void link_set_blocked(lcm_link *l, bool blocked);
bool link_blocked(const lcm_link *l);

/* Has `h` called for messages of a channel, of which `queue` may wait in LCM, and `tick` (either
 * may be NULL). When the network refuses now it is tried again until it does not. Returns 0 or
 * ARRIS_E_USAGE (the channel's name), _MEMORY. */
int link_subscribe(lcm_link *l, const char *channel, int queue, link_handler *h, link_tick *tick,
                   void *user, fault *f);
/* Ends all subscriptions of `user`; afterwards none of its handlers runs. Not from a handler. */
void link_unsubscribe(lcm_link *l, void *user);

/* Sends a message. Returns 0, or ARRIS_E_IO when the network does not take it. Any thread. */
int link_publish(lcm_link *l, const char *channel, const void *data, size_t n);

/* What ails the network or the log, a string literal; NULL: nothing. Any thread. */
const char *link_trouble(const lcm_link *l);

/* 0 when `channel` is a name for one, else ARRIS_E_USAGE. */
int link_check_channel(const char *channel, fault *f);

/* µs since the epoch. */
int64_t link_utime(void);

#endif
