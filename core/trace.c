/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * trace.c: every stage's work on every frame as Chrome trace JSON.
 */
#include <errno.h>
#include <string.h>

#include "internal.h"

int arris_trace(arris_pipeline *p, const char *path, arris_error *err) {
    p->trace = fopen(path, "w");
    if (!p->trace)
        return error_set(err, ARRIS_E_IO, NULL, "cannot write the trace '%s': %s", path,
                         strerror(errno));
    p->ns_per_tick = clock_ns_per_tick();
    fprintf(p->trace,
            "[{\"ph\":\"M\",\"name\":\"process_name\",\"pid\":1,\"args\":{\"name\":\"arris\"}}");
    return 0;
}

/* Names are put out without escapes: the parser lets none through that needs them. */
void trace_event(arris_pipeline *p, const arris_stage *s, uint64_t seq, uint64_t from,
                 uint64_t to) {
    fprintf(p->trace,
            ",\n{\"ph\":\"X\",\"name\":\"%s\",\"pid\":1,\"tid\":%d,\"ts\":%.3f,\"dur\":%.3f,"
            "\"args\":{\"frame\":%llu}}",
            s->name, s->lane->number, (double)from * p->ns_per_tick * 1e-3,
            (double)(to - from) * p->ns_per_tick * 1e-3, (unsigned long long)seq);
}

bool trace_close(arris_pipeline *p) {
    if (!p->trace)
        return true;
    fputs("]\n", p->trace);
    bool good = !ferror(p->trace);
    good = fclose(p->trace) == 0 && good;
    p->trace = NULL;
    return good;
}
