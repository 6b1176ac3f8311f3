/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * watch.c: looks on at a cell from outside: how many states and pictures pass, how long after a
 * picture its lines are told. It ends with the scan, prints what it saw, and exits with 1 when that
 * is not as it should be.
 */
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "arris_plugin.h"
#include "lcmtypes/arris_lines_t.h"
#include "lcmtypes/arris_status_t.h"
#include "link.h"
#include "messages.h"

enum { FRAMES = 1 << 17, RECENT = 256 };
static const double LIMIT = 15; /* ms, of 99 in 100 frames */

typedef struct watch {
    uint64_t states, pictures, changes;
    int64_t first_state, last_state; /* µs */
    struct {
        int64_t utime, came; /* µs, ns */
    } recent[RECENT];
    double latency[FRAMES]; /* ms, from picture to lines */
    size_t n;
    int lines;
    int64_t dropped, unposed, missing; /* by the pipeline's last status */
    char troubles[400];
    atomic_bool ended;
} watch;

static void on_state(void *user, const void *data, size_t n) {
    watch *w = user;
    arris_robot_state_t s;
    if (robot_state_read(data, n, &s))
        return;
    w->first_state = w->states++ ? w->first_state : s.utime;
    w->last_state = s.utime;
}

static void on_picture(void *user, const void *data, size_t n) {
    watch *w = user;
    arris_image_t m;
    int64_t seq, now = arris_now();
    if (image_read(data, n, &m, &seq))
        return;
    w->recent[w->pictures % RECENT].utime = m.utime;
    w->recent[w->pictures++ % RECENT].came = now;
}

static void on_lines(void *user, const void *data, size_t n) {
    watch *w = user;
    arris_lines_t m;
    int64_t now = arris_now();
    if (arris_lines_t_decode(data, 0, (int)n, &m) < 0)
        return;
    bool changes = m.kind == ARRIS_LINES_T_CHANGES && m.part + 1 == m.parts;
    for (int i = 0; changes && i < RECENT; i++)
        if (w->recent[i].utime == m.utime && w->n < FRAMES)
            w->latency[w->n++] = (double)(now - w->recent[i].came) * 1e-6;
    w->changes += changes;
    w->lines = m.total;
    arris_lines_t_decode_cleanup(&m);
}

static void on_status(void *user, const void *data, size_t n) {
    watch *w = user;
    arris_status_t m;
    if (arris_status_t_decode(data, 0, (int)n, &m) < 0)
        return;
    w->dropped = m.dropped;
    for (int i = 0; i < m.n; i++)
        if (strcmp(m.counter[i].name, "without pose") == 0)
            w->unposed = m.counter[i].value;
        else if (strcmp(m.counter[i].name, "missing") == 0)
            w->missing = m.counter[i].value;
    if (*m.trouble && !strstr(w->troubles, m.trouble))
        snprintf(w->troubles + strlen(w->troubles), sizeof w->troubles - strlen(w->troubles),
                 "  %s\n", m.trouble);
    atomic_store(&w->ended, m.state == ARRIS_STATUS_T_ENDED);
    arris_status_t_decode_cleanup(&m);
}

static int compare(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double quantile(const watch *w, double q) {
    return w->n ? w->latency[(size_t)(q * (double)(w->n - 1))] : 0;
}

static int report(watch *w) {
    double seconds = (double)(w->last_state - w->first_state) * 1e-6;
    qsort(w->latency, w->n, sizeof *w->latency, compare);
    printf("robot     %llu states in %.1f s, %.1f/s\n", (unsigned long long)w->states, seconds,
           seconds > 0 ? (double)(w->states - 1) / seconds : 0);
    printf("camera    %llu pictures\n", (unsigned long long)w->pictures);
    printf("pipeline  %lld dropped, %lld missing, %lld without pose; %d lines in the end\n",
           (long long)w->dropped, (long long)w->missing, (long long)w->unposed, w->lines);
    printf("latency   picture to lines, %zu frames: p50 %.2f ms, p99 %.2f ms, max %.2f ms (limit "
           "of p99 %.0f ms)\n",
           w->n, quantile(w, 0.5), quantile(w, 0.99), quantile(w, 1), LIMIT);
    if (*w->troubles)
        printf("troubles\n%s", w->troubles);
    return w->n == 0 || w->dropped || w->missing || w->unposed || quantile(w, 0.99) > LIMIT;
}

int main(void) {
    static watch w;
    fault f;
    lcm_link *link = link_open(NULL, &f);
    if (!link || link_subscribe(link, "ROBOT_STATE", 256, on_state, NULL, &w, &f) ||
        link_subscribe(link, "ARRIS_IMAGE", 16, on_picture, NULL, &w, &f) ||
        link_subscribe(link, "ARRIS_LINES", 64, on_lines, NULL, &w, &f) ||
        link_subscribe(link, "ARRIS_STATUS", 64, on_status, NULL, &w, &f)) {
        fprintf(stderr, "watch: %s\n", f.text);
        return 2;
    }
    while (!atomic_load(&w.ended))
        nanosleep(&(struct timespec){0, 50000000}, NULL);
    link_close(link);
    return report(&w);
}
