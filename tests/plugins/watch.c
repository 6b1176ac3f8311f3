/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * watch.c: the stage `testwatch`: from frame to frame, what the process allocates (by
 * count_alloc.so, which must be preloaded) and how much memory it holds.
 */
#include <dlfcn.h>
#include <stdio.h>

#include "../preload/count_alloc.h"
#include "arris_plugin.h"

struct watch {
    const char *allocations, *memory;
    int32_t from, to, every;
    enum { BEFORE, COUNTING, AFTER } now;
    void (*count)(bool on);
    int (*report)(const char *path);
    FILE *out;
};

static int setup(arris_stage *s, void *self, arris_caps *caps) {
    (void)caps;
    struct watch *w = self;
    *(void **)&w->count = dlsym(RTLD_DEFAULT, "count_alloc");
    *(void **)&w->report = dlsym(RTLD_DEFAULT, "count_alloc_report");
    w->out = w->memory ? fopen(w->memory, "w") : NULL;
    if ((w->allocations && (!w->count || !w->report)) || (w->memory && !w->out))
        return arris_fail(s, ARRIS_E_IO, "preload count_alloc.so", "nothing can be watched");
    return 0;
}

/* Resident memory, in pages. */
static long resident(void) {
    long pages = -1;
    FILE *f = fopen("/proc/self/statm", "r");
    if (!f || fscanf(f, "%*d %ld", &pages) != 1)
        pages = -1;
    if (f)
        fclose(f);
    return pages;
}

static int process(arris_stage *s, void *self, arris_frame *f) {
    struct watch *w = self;
    int64_t seq = (int64_t)arris_frame_seq(f);
    if (w->allocations && w->now == BEFORE && seq >= w->from) { /* any may have been dropped */
        w->now = COUNTING;
        w->count(true);
    } else if (w->now == COUNTING && seq >= w->to) {
        w->now = AFTER;
        w->count(false);
        if (w->report(w->allocations))
            return arris_fail(s, ARRIS_E_IO, NULL, "cannot write %s", w->allocations);
    }
    if (w->out && seq % w->every == 0)
        fprintf(w->out, "%lld %ld\n", (long long)seq, resident());
    return 0;
}

static void close_watch(arris_stage *s, void *self) {
    (void)s;
    struct watch *w = self;
    if (w->out)
        fclose(w->out);
}

static const arris_prop props[] = {
    ARRIS_P_STRING(struct watch, allocations, "allocations", NULL, "the file of who allocates"),
    ARRIS_P_STRING(struct watch, memory, "memory", NULL, "the file of how much is held"),
    ARRIS_P_INT(struct watch, from, "from", "30", 0, 1e9, NULL, "the frame from which is counted"),
    ARRIS_P_INT(struct watch, to, "to", "100", 0, 1e9, NULL, "the frame to which is counted"),
    ARRIS_P_INT(struct watch, every, "every", "1000", 1, 1e9, NULL, "memory is noted so often"),
};
static const arris_stage_desc stage_watch = {
    .size = sizeof(arris_stage_desc),
    .name = "testwatch",
    .summary = "watches the process's memory",
    .flags = ARRIS_SINK,
    .self_size = sizeof(struct watch),
    .props = props,
    .n_props = sizeof props / sizeof *props,
    .setup = setup,
    .process = process,
    .close = close_watch,
};

ARRIS_PLUGIN("watch", "LGPL-2.1-or-later", &stage_watch);
