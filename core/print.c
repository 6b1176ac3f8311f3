/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * print.c: a pipeline for people: the graph as text and for Graphviz, progress, statistics.
 */
#include <string.h>

#include "internal.h"

static void caps_text(const arris_caps *c, char *text, size_t size) {
    *text = '\0';
    if (c->format)
        snprintf(text, size, "%dx%d %d bit%s", c->width, c->height, 8 * (int)c->format,
                 c->camera ? "" : ", no camera model");
}

void arris_print(const arris_pipeline *p, FILE *out) {
    for (size_t i = 0; i < p->n_stages; i++) {
        const arris_stage *s = p->stage[i];
        char needs[120], gives[120], caps[80];
        layer_names(s->layers.needs | (s->layers.wants & s->have), needs, sizeof needs);
        layer_names(s->layers.gives, gives, sizeof gives);
        caps_text(&s->caps, caps, sizeof caps);
        fprintf(out, "%-14s lane %d   %s -> %s%s%s%s", s->name, s->lane ? s->lane->number : 0,
                needs, gives, *caps ? "   (" : "", caps, *caps ? ")" : "");
        for (size_t k = 0; k < s->n_out && s->n_out > 1; k++)
            fprintf(out, "%s%s", k ? ", " : "   to ", s->out[k]->name);
        fputs(s->implied ? "   (put in by the host)\n" : "\n", out);
    }
}

void arris_print_dot(const arris_pipeline *p, FILE *out) {
    fprintf(out, "digraph arris {\n  rankdir=LR;\n  node [shape=box, style=rounded];\n");
    for (size_t l = 0; l < p->n_lanes; l++) {
        fprintf(out, "  subgraph cluster_%zu {\n    label=\"lane %zu\";\n", l, l);
        for (size_t i = 0; i < p->n_stages; i++)
            if (p->stage[i]->lane == &p->lanes[l])
                fprintf(out, "    \"%s\";\n", p->stage[i]->name);
        fprintf(out, "  }\n");
    }
    for (size_t i = 0; i < p->n_stages; i++)
        for (size_t k = 0; k < p->stage[i]->n_out; k++) {
            char layers[200];
            layer_names(p->stage[i]->have | p->stage[i]->layers.gives, layers, sizeof layers);
            fprintf(out, "  \"%s\" -> \"%s\" [label=\"%s\"];\n", p->stage[i]->name,
                    p->stage[i]->out[k]->name, layers);
        }
    fprintf(out, "}\n");
}

static double milliseconds(const histogram *h, double q) {
    return (double)histogram_quantile(h, q) * 1e-6;
}

arris_progress arris_get_progress(const arris_pipeline *p) {
    int64_t started = atomic_load(&p->started), ended = atomic_load(&p->ended);
    if (!started)
        return (arris_progress){0};
    arris_progress r = {.frames = atomic_load(&p->frames_made),
                        .lines = atomic_load(&p->lines),
                        .seconds = (double)((ended ? ended : arris_now()) - started) * 1e-9,
                        .p50 = milliseconds(&p->latency, 0.5),
                        .p99 = milliseconds(&p->latency, 0.99)};
    r.done = r.frames;
    for (size_t i = 0; i < p->n_stages; i++) {
        const arris_stage *s = p->stage[i];
        uint64_t n = atomic_load(&s->frames);
        r.dropped += atomic_load(&s->dropped);
        if (!s->n_out && n < r.done)
            r.done = n;
        if (!r.trouble && (r.trouble = atomic_load(&s->trouble)))
            r.troubled = s->name;
    }
    return r;
}

arris_progress arris_stage_progress(const arris_stage *s) {
    return arris_get_progress(s->pipeline);
}

/* Calls f for what one stage has counted. */
static void each_counter(const arris_stage *s,
                         void (*f)(void *user, const char *stage, const char *name, uint64_t n),
                         void *user) {
    for (int i = 0; i < MAX_COUNTERS; i++) {
        const char *name = atomic_load_explicit(&s->counter[i].name, memory_order_acquire);
        if (name)
            f(user, s->name, name, atomic_load(&s->counter[i].n));
    }
}

void arris_each_counter(const arris_stage *s,
                        void (*f)(void *user, const char *stage, const char *name, uint64_t n),
                        void *user) {
    const arris_pipeline *p = s->pipeline;
    if (atomic_load(&p->started))
        for (size_t i = 0; i < p->n_stages; i++)
            each_counter(p->stage[i], f, user);
}

static void print_times(const histogram *h, double us, FILE *out) {
    uint64_t n = histogram_count(h);
    fprintf(out, " %10.2f %10.2f %10.2f %10.2f",
            n ? (double)atomic_load(&h->sum) / (double)n * us : 0.0,
            (double)histogram_quantile(h, 0.5) * us, (double)histogram_quantile(h, 0.99) * us,
            (double)atomic_load(&h->max) * us);
}

static void print_counter(void *out, const char *stage, const char *name, uint64_t n) {
    (void)stage;
    fprintf(out, "   %s %llu", name, (unsigned long long)n);
}

static void print_stage_stats(const arris_stage *s, double us, FILE *out) {
    fprintf(out, "%-16s %9llu %8llu", s->name, (unsigned long long)atomic_load(&s->frames),
            (unsigned long long)atomic_load(&s->dropped));
    print_times(&s->time, us, out);
    if (s->desc == &stage_queue)
        fprintf(out, "   fill %zu of %d", atomic_load(&s->fill),
                ((const queue_props *)s->self)->max_frames);
    each_counter(s, print_counter, out);
    const char *trouble = atomic_load(&s->trouble);
    fprintf(out, "%s%s\n", trouble ? "   " : "", trouble ? trouble : "");
}

void arris_print_stats(const arris_pipeline *p, FILE *out) {
    arris_progress r = arris_get_progress(p);
    double us = clock_ns_per_tick() * 1e-3;
    fprintf(out, "%-16s %9s %8s %10s %10s %10s %10s   (times in us; a queue's is the wait)\n",
            "stage", "frames", "dropped", "mean", "p50", "p99", "max");
    for (size_t i = 0; i < p->n_stages; i++)
        print_stage_stats(p->stage[i], us, out);
    fprintf(out, "%-16s %9llu %8llu", "from exposure",
            (unsigned long long)atomic_load(&p->first_leaf->frames), (unsigned long long)r.dropped);
    print_times(&p->latency, 1e-3, out);
    if (atomic_load(&p->quick))
        fprintf(out, "\n(frames this fast are timed on every 16th)");
    fprintf(out, "\n%llu frames in %.3f s, %.1f frames/s\n", (unsigned long long)r.frames,
            r.seconds, r.seconds > 0 ? (double)r.frames / r.seconds : 0.0);
}
