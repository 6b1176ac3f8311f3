/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * netns.h: a network of the test program's own, with nothing but a loopback interface.
 */
#ifndef NETNS_H
#define NETNS_H

#include <errno.h>
#include <sched.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static inline bool netns_write(const char *path, const char *text) {
    FILE *f = fopen(path, "w");
    bool good = f && fputs(text, f) >= 0;
    return f && fclose(f) == 0 && good;
}

/* Brings the network up, or takes it away. */
static inline bool netns_set(bool up) {
    return up ? system("ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo") == 0
              : system("ip link set lo down") == 0;
}

/* Moves the process, which has no other thread yet, into a network namespace of its own. False,
 * said why, where that is not allowed. */
static inline bool netns_enter(void) {
    char uid[40], gid[40];
    snprintf(uid, sizeof uid, "0 %d 1\n", (int)getuid());
    snprintf(gid, sizeof gid, "0 %d 1\n", (int)getgid());
    bool in = unshare(CLONE_NEWNET) == 0;
    if (!in && unshare(CLONE_NEWUSER | CLONE_NEWNET) == 0)
        in = netns_write("/proc/self/setgroups", "deny") &&
             netns_write("/proc/self/uid_map", uid) && netns_write("/proc/self/gid_map", gid);
    if (in && netns_set(true))
        return true;
    printf("skipped: no network namespace of its own: %s\n", strerror(errno));
    return false;
}

#endif
