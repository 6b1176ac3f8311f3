/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * client.c: gives the robot one command, and stays until it is done (client.h).
 */
#include "client.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <time.h>

#include "arris_plugin.h"
#include "messages.h"

enum { PENDING = -1, QUEUE = 64 };
static const int64_t AGAIN = 100000000, PATIENCE = 2000000000; /* ns */

typedef struct client {
    lcm_link *link;
    int64_t commander;
    int32_t seq;
    uint8_t buffer[MESSAGE_MAX];
    double *pos[ROBOT_POSES], *quat[ROBOT_POSES];

    pthread_mutex_t mutex; /* of what follows */
    int32_t request;       /* the one that is waited for */
    int result;            /* PENDING, or of the last answer */
    char reason[ROBOT_TEXT];
} client;

static void receive(void *user, const void *data, size_t n) {
    client *c = user;
    arris_robot_ack_t m;
    if (robot_ack_read(data, n, &m) || m.commander != c->commander)
        return;
    pthread_mutex_lock(&c->mutex);
    if (m.request == c->request) {
        c->result = m.result;
        snprintf(c->reason, sizeof c->reason, "%s", m.reason);
    }
    pthread_mutex_unlock(&c->mutex);
}

static int result_of(client *c) {
    pthread_mutex_lock(&c->mutex);
    int result = c->result;
    pthread_mutex_unlock(&c->mutex);
    return result;
}

static void send_command(client *c, int32_t request, const client_command *what) {
    arris_robot_command_t m = {.utime = link_utime(),
                               .seq = c->seq++,
                               .commander = c->commander,
                               .request = request,
                               .command = what->command,
                               .speed = what->speed,
                               .time_limit = what->time_limit,
                               .n = what->n,
                               .pos = c->pos,
                               .quat = c->quat};
    for (int i = 0; i < what->n; i++) {
        c->pos[i] = (double *)(uintptr_t)what->pose[i].pos;
        c->quat[i] = (double *)(uintptr_t)what->pose[i].quat;
    }
    int n = arris_robot_command_t_encode(c->buffer, 0, sizeof c->buffer, &m);
    if (n > 0)
        link_publish(c->link, "ROBOT_COMMAND", c->buffer, (size_t)n);
}

static void send_simple(client *c, int32_t request, int8_t command) {
    const client_command what = {.command = command};
    send_command(c, request, &what);
}

/* Requests: 1 is the command, 2 the STOP that ends it, 3 the release, or the end of a hold. */
static int converse(client *c, const client_command *what, const volatile int *stop) {
    int64_t end = arris_now() + PATIENCE;
    for (int result;;) {
        result = result_of(c);
        if (result != PENDING && result != ARRIS_ROBOT_ACK_T_ACCEPTED)
            return result;
        if (result == PENDING && arris_now() > end)
            return PENDING;
        if (*stop)
            send_simple(c, 2, ARRIS_ROBOT_COMMAND_T_STOP);
        else /* again and again: it is done once, and answered each time */
            send_command(c, 1, what);
        send_simple(c, 0, ARRIS_ROBOT_COMMAND_T_ALIVE);
        nanosleep(&(struct timespec){0, AGAIN}, NULL);
    }
}

int client_run(lcm_link *link, const client_command *what, const volatile int *stop, fault *f) {
    static const char *const words[] = {[ARRIS_ROBOT_ACK_T_REFUSED] = "the robot refuses",
                                        [ARRIS_ROBOT_ACK_T_STOPPED] = "the robot was stopped",
                                        [ARRIS_ROBOT_ACK_T_TIMED_OUT] = "the robot took too long"};
    client c = {.link = link, .request = 1, .result = PENDING};
    pthread_mutex_init(&c.mutex, NULL);
    if (getrandom(&c.commander, sizeof c.commander, 0) != sizeof c.commander || !c.commander)
        c.commander = arris_now();
    int rc = link_subscribe(link, "ROBOT_ACK", QUEUE, receive, NULL, &c, f);
    if (rc)
        return rc;
    int result = converse(&c, what, stop);
    while (what->command == ARRIS_ROBOT_COMMAND_T_HOLD && result == ARRIS_ROBOT_ACK_T_DONE &&
           !*stop)
        nanosleep(&(struct timespec){0, AGAIN}, NULL);
    send_simple(&c, 3,
                what->command == ARRIS_ROBOT_COMMAND_T_HOLD ? ARRIS_ROBOT_COMMAND_T_RESUME
                                                            : ARRIS_ROBOT_COMMAND_T_RELEASE);
    link_unsubscribe(link, &c);
    if (result == ARRIS_ROBOT_ACK_T_DONE)
        return 0;
    if (result == PENDING)
        return fault_set(f, ARRIS_E_IO, "is arris-robot --driver running on the same network?",
                         "no robot answers");
    return fault_set(f, ARRIS_E_INPUT, NULL, "%s: %s", words[result], c.reason);
}
