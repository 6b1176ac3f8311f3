/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * run.c: the lanes. A lane is a thread that takes a frame, from its source or its queue, and calls
 * the stages in order until the next queue or the end of the branch. The end of the stream is a
 * frame like any other, marked `last`: it carries finish from stage to stage.
 */
#include <signal.h>
#include <string.h>

#include "internal.h"

/* Where a frame is through in less than QUICK ns, only every UNTIMED-th is timed: reading the clock
 * would cost more than passing it on. */
enum { QUICK = 20000, UNTIMED = 16 };

static bool is_failed(const arris_stage *s) {
    return atomic_load_explicit(&s->failed, memory_order_relaxed);
}

static bool is_set(const atomic_int *flag) {
    return atomic_load_explicit(flag, memory_order_relaxed);
}

/* ---- messages -------------------------------------------------------------------------------- */

static void post(arris_stage *s, enum arris_severity severity, int code, const char *hint,
                 const char *format, va_list ap) {
    arris_message m = {.severity = severity, .code = code, .frame = atomic_load(&s->frame)};
    snprintf(m.stage, sizeof m.stage, "%s", s->name);
    vsnprintf(m.text, sizeof m.text, format, ap);
    snprintf(m.hint, sizeof m.hint, "%s", hint ? hint : "");
    bus_post(&s->pipeline->bus, &m);
}

/* The first error of a stage is told; what fails afterwards because of it is not. */
int arris_fail(arris_stage *s, int code, const char *hint, const char *format, ...) {
    va_list ap;
    va_start(ap, format);
    if (s->pipeline->setup_error && !s->pipeline->setup_error->code) {
        char text[400];
        vsnprintf(text, sizeof text, format, ap);
        error_at(s->pipeline->setup_error, &s->at, 0, code, hint, "%s: %s", s->name, text);
    } else if (!s->pipeline->setup_error && !atomic_exchange(&s->failed, true)) {
        int none = 0;
        atomic_compare_exchange_strong(&s->pipeline->result, &none, code);
        atomic_store(&s->pipeline->stop, 1);
        post(s, ARRIS_ERROR, code, hint, format, ap);
    }
    va_end(ap);
    return code;
}

void arris_warn(arris_stage *s, const char *format, ...) {
    va_list ap;
    va_start(ap, format);
    post(s, ARRIS_WARNING, 0, NULL, format, ap);
    va_end(ap);
}

void arris_count(arris_stage *s, const char *name, uint64_t n) {
    for (int i = 0; i < MAX_COUNTERS; i++) {
        const char *there = atomic_load_explicit(&s->counter[i].name, memory_order_relaxed);
        if (there && strcmp(there, name) != 0)
            continue;
        atomic_fetch_add_explicit(&s->counter[i].n, n, memory_order_relaxed);
        atomic_store_explicit(&s->counter[i].name, name, memory_order_release);
        return;
    }
}

void arris_trouble(arris_stage *s, const char *what) {
    const char *before = atomic_exchange(&s->trouble, what);
    if (before == what)
        return;
    arris_message m = {.severity = what ? ARRIS_WARNING : ARRIS_INFO, .frame = -1};
    snprintf(m.stage, sizeof m.stage, "%s", s->name);
    snprintf(m.text, sizeof m.text, "%s%s", what ? "" : "over: ", what ? what : before);
    bus_post(&s->pipeline->bus, &m);
}

const char *arris_stage_name(const arris_stage *s) {
    return s->name;
}

bool arris_running(const arris_stage *s) {
    return !is_set(&s->pipeline->stop) && !is_set(&s->pipeline->abort);
}

/* ---- frames through stages ------------------------------------------------------------------- */

static void drop(arris_stage *s, arris_frame *f) {
    atomic_fetch_add_explicit(&s->dropped, 1, memory_order_relaxed);
    frame_release(f);
}

static void end_branch(arris_stage *s, arris_frame *f) {
    arris_pipeline *p = s->pipeline;
    const arris_lines *lines = arris_layer_get(f, ARRIS_LINES);
    if (lines) {
        unsigned n = 0;
        for (uint32_t i = 0; i < lines->n; i++)
            n += lines->item[i].state == ARRIS_MEASURED && lines->item[i].change < ARRIS_MERGED;
        atomic_store_explicit(&p->lines, n, memory_order_relaxed);
    }
    bool last = f->last;
    if (f->timed && s == p->first_leaf) {
        int64_t latency = arris_now() - f->start;
        histogram_add(&p->latency, (uint64_t)latency);
        atomic_store_explicit(&p->quick, latency < QUICK && p->n_leaves == 1, memory_order_relaxed);
    }
    frame_release(f);
    if (last && atomic_fetch_sub(&p->leaves_left, 1) == 1) {
        p->ended = arris_now();
        if (!trace_close(p))
            bus_post(&p->bus, &(arris_message){.severity = ARRIS_WARNING,
                                               .frame = -1,
                                               .text = "the trace could not be written whole"});
        bus_end(&p->bus);
    }
}

/* Books the time since *from, when the frame is a timed one, and starts anew. */
static void book(arris_stage *s, const arris_frame *f, uint64_t *from) {
    if (!f->timed)
        return;
    uint64_t to = clock_ticks();
    histogram_add(&s->time, to - *from);
    if (s->pipeline->trace)
        trace_event(s->pipeline, s, f->seq, *from, to);
    *from = to;
}

static uint64_t begin_timing(const arris_frame *f) {
    return f->timed ? clock_ticks() : 0;
}

/* Calls a stage and books its time since *from. An error ends the stream. */
static int work(arris_stage *s, arris_frame *f, uint64_t *from) {
    atomic_store_explicit(&s->frame, (long long)f->seq, memory_order_relaxed);
    if (s->inside)
        loops_enter(s, f);
    int rc = is_failed(s) ? ARRIS_DROP : s->desc->process(s, s->self, f);
    if (f->given)
        frame_settle(f);
    if (s->inside)
        loops_leave(s, f, rc != 0);
    if (rc != ARRIS_END) {
        relaxed_add(&s->frames, 1);
        book(s, f, from);
    }
    if (rc < 0)
        arris_fail(s, rc, NULL, "%s", arris_strerror(rc));
    return rc;
}

/* The same for the last frame, which always goes on. */
static void finish(arris_stage *s, arris_frame *f) {
    atomic_store_explicit(&s->frame, -1, memory_order_relaxed);
    bool wanted = s->desc->finish && !is_set(&s->pipeline->abort);
    int rc = wanted ? s->desc->finish(s, s->self, f) : 0;
    frame_settle(f);
    if (rc < 0)
        arris_fail(s, rc, NULL, "%s", arris_strerror(rc));
}

static void enqueue(arris_stage *q, arris_frame *f) {
    const queue_props *props = q->self;
    const atomic_int *abort = &q->pipeline->abort;
    size_t limit = (size_t)props->max_frames, fill;
    f->queued = begin_timing(f);
    if (f->last || props->leaky == LEAKY_NO) {
        if (!ring_put(&q->ring, f, limit + f->last, abort))
            frame_release(f);
    } else if (props->leaky == LEAKY_NEWEST) {
        if (!ring_try_put(&q->ring, f, limit))
            drop(q, f);
    } else {
        while (!ring_try_put(&q->ring, f, limit)) {
            arris_frame *oldest = ring_try_take(&q->ring);
            if (oldest)
                drop(q, oldest);
        }
    }
    fill = ring_count(&q->ring);
    if (fill <= limit && fill > atomic_load_explicit(&q->fill, memory_order_relaxed))
        atomic_store_explicit(&q->fill, fill, memory_order_relaxed);
}

/* Hands a frame to `s` and on, until a queue or the end of the branch. */
static void pass_to(arris_stage *s, arris_frame *f, uint64_t from) {
    for (;; s = s->out[s->n_out - 1]) {
        if (s->desc == &stage_queue) {
            enqueue(s, f);
            return;
        }
        if (f->last) {
            finish(s, f);
        } else if (work(s, f, &from)) {
            drop(s, f);
            return;
        }
        if (!s->n_out) {
            end_branch(s, f);
            return;
        }
        for (size_t i = 0; i + 1 < s->n_out; i++, from = begin_timing(f))
            pass_to(s->out[i], frame_shell(f, s->pipeline), from);
    }
}

/* ---- lanes ----------------------------------------------------------------------------------- */

static bool too_late(const arris_stage *q, const arris_frame *f) {
    double most = ((const queue_props *)q->self)->max_latency;
    return most > 0 && !f->last && (double)(arris_now() - f->start) > most * 1e6;
}

static void run_queue(arris_stage *q) {
    const atomic_int *abort = &q->pipeline->abort;
    for (arris_frame *f; !is_set(abort) && (f = ring_take(&q->ring, abort));) {
        bool last = f->last;
        uint64_t from = begin_timing(f);
        relaxed_add(&q->frames, !last);
        if (f->timed)
            histogram_add(&q->time, from - f->queued);
        if (too_late(q, f)) {
            loops_leave(q, f, true);
            drop(q, f);
        } else {
            pass_to(q->out[0], f, from);
        }
        if (last)
            return;
    }
}

static arris_frame *new_frame(arris_pipeline *p, bool last) {
    arris_frame *f = frame_take(p);
    f->seq = atomic_load_explicit(&p->frames_made, memory_order_relaxed);
    f->index = (int64_t)f->seq;
    f->last = last;
    f->start = arris_now();
    f->timed = !last && (p->trace || f->seq % UNTIMED == 0 ||
                         !atomic_load_explicit(&p->quick, memory_order_relaxed));
    return f;
}

static void run_source(arris_stage *s) {
    arris_pipeline *p = s->pipeline;
    while (arris_running(s)) {
        arris_frame *f = new_frame(p, false);
        uint64_t from = begin_timing(f);
        int rc = work(s, f, &from);
        if (rc == ARRIS_DROP) {
            drop(s, f);
            continue;
        }
        if (rc) {
            frame_release(f);
            break;
        }
        atomic_store_explicit(&p->frames_made, f->seq + 1, memory_order_relaxed);
        pass_to(s->out[0], f, from);
    }
    arris_frame *f = new_frame(p, true);
    finish(s, f);
    pass_to(s->out[0], f, 0);
}

static void *lane_main(void *arg) {
    lane *l = arg;
    if (l->head->in)
        run_queue(l->head);
    else
        run_source(l->head);
    return NULL;
}

/* Signals are for the application's threads. */
static int start_lane(lane *l) {
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    int rc = pthread_create(&l->thread, NULL, lane_main, l);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    l->running = rc == 0;
    return rc;
}

int arris_start(arris_pipeline *p, arris_error *err) {
    if (!p->checked || p->started)
        return error_set(err, ARRIS_E_USAGE, "call arris_check first, and start once",
                         "the pipeline is not ready to start");
    atomic_store(&p->started, arris_now());
    atomic_store(&p->leaves_left, p->n_leaves);
    for (size_t i = p->n_lanes; i-- > 0;) {
        int rc = start_lane(&p->lanes[i]);
        if (rc) {
            arris_abort(p);
            return error_set(err, ARRIS_E_MEMORY, NULL, "cannot start a thread: %s", strerror(rc));
        }
    }
    return 0;
}

void arris_stop(arris_pipeline *p) {
    atomic_store(&p->stop, 1);
}

/* The bus must end too, but a signal handler may not take its lock: arris_wait looks at the flag.
 */
void arris_abort(arris_pipeline *p) {
    int none = 0;
    atomic_compare_exchange_strong(&p->result, &none, ARRIS_E_ABORTED);
    atomic_store(&p->abort, 1);
}

int arris_result(const arris_pipeline *p) {
    return atomic_load(&p->result);
}

void run_join(arris_pipeline *p) {
    if (!p->ended)
        arris_abort(p);
    for (size_t i = 0; i < p->n_lanes; i++)
        if (p->lanes[i].running)
            pthread_join(p->lanes[i].thread, NULL);
}
