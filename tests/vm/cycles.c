/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * cycles.c: `cycles N LINE...` builds, starts, runs to its end and frees every pipeline N times,
 * all lines at the same time in threads of their own. Fails when one fails, or files stay open.
 */
#include <dirent.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>

#include "arris.h"

enum { MAX_LINES = 8 };
static int cycles;

static int complain(const char *line, int i, const char *text) {
    fprintf(stderr, "cycles: %s: time %d: %s\n", line, i + 1, text);
    return 1;
}

static int run(const char *line, int i) {
    arris_error err;
    arris_message m;
    arris_pipeline *p = arris_parse(line, &err);
    int bad = !p || arris_check(p, &err) || arris_start(p, &err) ? complain(line, i, err.text) : 0;
    for (enum arris_wait_result r; !bad && (r = arris_wait(p, &m, 100)) != ARRIS_WAIT_ENDED;)
        if (r == ARRIS_WAIT_MESSAGE && m.severity != ARRIS_INFO)
            complain(line, i, m.text);
    bad |= !bad && arris_result(p) != 0;
    if (!bad && arris_get_progress(p).done != 2)
        bad = complain(line, i, "not 2 frames");
    if (p)
        arris_free(p);
    return bad;
}

static void *run_all(void *line) {
    for (int i = 0; i < cycles; i++)
        if (run(line, i))
            return line;
    return NULL;
}

static int open_files(void) {
    DIR *d = opendir("/proc/self/fd");
    int n = 0;
    while (d && readdir(d))
        n++;
    if (d)
        closedir(d);
    return n;
}

static int run_together(int n, char **line) {
    pthread_t thread[MAX_LINES];
    int bad = 0;
    for (int i = 0; i < n; i++)
        if (pthread_create(&thread[i], NULL, run_all, line[i]))
            abort();
    for (int i = 0; i < n; i++) {
        void *failed;
        pthread_join(thread[i], &failed);
        bad |= failed != NULL;
    }
    return bad;
}

int main(int argc, char **argv) {
    if (argc < 3 || argc > 2 + MAX_LINES)
        return fprintf(stderr, "usage: cycles N LINE...\n"), 2;
    cycles = 1;
    int bad = run_together(argc - 2, argv + 2); /* what the libraries open once */
    int before = open_files();
    cycles = atoi(argv[1]);
    bad |= run_together(argc - 2, argv + 2);
    int after = open_files();
    printf("cycles: %d times, %d files open before, %d after\n", cycles, before, after);
    return bad || after != before;
}
