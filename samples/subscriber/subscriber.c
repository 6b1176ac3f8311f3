/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * subscriber.c: listens to the lines that a pipeline with lcmsink tells of, and keeps them. It ends
 * with the scan, and prints what was measured.
 *     make build/subscriber && build/subscriber
 */
#include <stdio.h>
#include <string.h>

#include "lcmtypes/arris_lines_t.h"

enum { MAX_LINES = 4000 };

static struct {
    int id, state;
    double p[3], q[3];
} line[MAX_LINES];
static int n_lines, ended;

static void put(const arris_lines_t *m, int i) {
    int at = 0;
    while (at < n_lines && line[at].id != m->id[i])
        at++;
    if (m->change[i] == ARRIS_LINES_T_MERGED || m->change[i] == ARRIS_LINES_T_RETIRED) {
        if (at < n_lines)
            line[at] = line[--n_lines];
        return;
    }
    if (at == MAX_LINES)
        return;
    line[at].id = m->id[i];
    line[at].state = m->state[i];
    memcpy(line[at].p, m->p[i], sizeof line[at].p);
    memcpy(line[at].q, m->q[i], sizeof line[at].q);
    n_lines += at == n_lines;
}

static void on_lines(const lcm_recv_buf_t *buffer, const char *channel, const arris_lines_t *m,
                     void *user) {
    (void)buffer, (void)channel, (void)user;
    if (m->kind != ARRIS_LINES_T_CHANGES && m->part == 0)
        n_lines = 0; /* what is in none of the parts is gone */
    for (int i = 0; i < m->n; i++)
        put(m, i);
    if (m->kind == ARRIS_LINES_T_WHOLE && m->part + 1 == m->parts)
        printf("frame %lld: %d lines\n", (long long)m->frame, n_lines);
    fflush(stdout);
    ended = m->kind == ARRIS_LINES_T_FINAL && m->part + 1 == m->parts;
}

int main(void) {
    lcm_t *lcm = lcm_create(NULL); /* LCM_DEFAULT_URL, or multicast on this machine */
    if (!lcm || !arris_lines_t_subscribe(lcm, "ARRIS_LINES", on_lines, NULL)) {
        fprintf(stderr, "subscriber: no LCM network\n");
        return 1;
    }
    while (!ended && lcm_handle(lcm) == 0)
        ;
    for (int i = 0; i < n_lines; i++)
        if (line[i].state == ARRIS_LINES_T_MEASURED)
            printf("%4d  %8.2f %8.2f %8.2f   %8.2f %8.2f %8.2f\n", line[i].id, line[i].p[0],
                   line[i].p[1], line[i].p[2], line[i].q[0], line[i].q[1], line[i].q[2]);
    lcm_destroy(lcm);
    return 0;
}
