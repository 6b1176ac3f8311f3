/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * internal.h: what the runtime's own files share. Nothing here is installed.
 */
#ifndef ARRIS_INTERNAL_H
#define ARRIS_INTERNAL_H

#include <pthread.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>

#include "arris.h"
#include "arris_plugin.h"

#define COUNT(a) (sizeof(a) / sizeof *(a))

/* ---- error.c: errors with a place in the launch line ----------------------------------------- */

/* A recipe or the command line itself. */
typedef struct source {
    struct source *next;     /* of all sources of a pipeline */
    const struct source *up; /* what includes it; NULL: the command line */
    char *path;              /* NULL: the command line */
    char *text;
} source;

/* One word of a launch line, quotes removed. */
typedef struct token {
    const source *src;
    const char *text;
    size_t at; /* byte offset in src->text */
} token;

/* Fill *err (NULL is allowed) and return `code`. error_at points at the byte `skip` of a token. */
int error_set(arris_error *err, int code, const char *hint, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
int error_at(arris_error *err, const token *t, size_t skip, int code, const char *hint,
             const char *format, ...) __attribute__((format(printf, 6, 7)));

/* ---- nearest.c --------------------------------------------------------------------------------
 */

/* Keeps the candidate that is nearest to `word` by edit distance; start with best = NULL. */
typedef struct nearest {
    const char *word, *best;
    unsigned distance;
} nearest;
void nearest_offer(nearest *n, const char *candidate);
/* The best candidate when it is near enough to be what was meant, else NULL. */
const char *nearest_result(const nearest *n);

/* ---- lex.c ------------------------------------------------------------------------------------
 */

enum { MAX_TOKENS = 4096, MAX_DEPTH = 16, MAX_RECIPE = 1 << 20 };

typedef struct token_list {
    token *item;
    size_t n, max;
    source *sources;
} token_list;

/* Splits a line into words, and puts a recipe's words in the place of its name. */
int lex(token_list *out, const char *line, arris_error *err);
void lex_free(token_list *t);
/* Paths in a recipe are relative to its folder: how much of src->path to put before `path`. */
int source_dir(const source *src, const char *path);

/* ---- props.c ----------------------------------------------------------------------------------
 */

typedef struct strings { /* what a stage's string properties point to */
    struct strings *next;
    char text[];
} strings;

/* Sets every property to its default. */
int props_default(const arris_stage_desc *d, void *self, strings **own, arris_error *err);
/* Parses a token `key=value` into the struct. */
int props_set(const arris_stage_desc *d, void *self, strings **own, const token *t,
              arris_error *err);
/* "0.3 to 5 px", "drop|pass|error", ... */
void props_range(const arris_prop *p, char *text, size_t size);

/* ---- registry.c -------------------------------------------------------------------------------
 */

/* The descriptor of a stage by name: built in, or from a plugin that is loaded when first asked
 * for. NULL with *err filled as if at token t (NULL: nowhere). It lives as long as the process. */
const arris_stage_desc *registry_find(const char *name, const token *t, arris_error *err);
/* Loads every plugin and calls f for every stage, in the order of their names. */
void registry_each(void (*f)(const arris_stage_desc *d, const char *plugin, void *user),
                   void *user);

/* ---- plumbing.c: the built-in stages -----------------------------------------------------------
 */

extern const arris_stage_desc *const builtin_stages[]; /* NULL-terminated */
extern const arris_stage_desc stage_queue, stage_tee;

enum { LEAKY_NO, LEAKY_OLDEST, LEAKY_NEWEST };
typedef struct queue_props {
    int32_t max_frames, leaky;
    double max_latency; /* ms; 0: any */
} queue_props;

/* ---- pool.c: buffers with a count of references ------------------------------------------------
 */

typedef struct pool_item {
    _Alignas(64) atomic_int refs; /* 0: free. Neighbours are in the hands of other lanes */
    void *data;
} pool_item;

typedef struct pool {
    size_t n;
    pool_item *item;
    void *memory;
    atomic_size_t hint;
} pool;

int pool_init(pool *p, size_t n, size_t size); /* zeroed, each on a 64-byte boundary */
void pool_free(pool *p);
/* A free item with one reference. The pools are sized so that there is one: if not, it is a fault
 * of the runtime itself, and the process is aborted with a message. */
pool_item *pool_take(pool *p);
void pool_ref(pool_item *i);
void pool_unref(pool_item *i);

/* ---- layer.c -----------------------------------------------------------------------------------
 */

const char *layer_name(enum arris_layer layer);
/* "image, pose" */
void layer_names(uint32_t set, char *text, size_t size);
/* Bytes of one buffer, and the setting-up of its pointers; `caps` are the giver's. 0: too large. */
size_t layer_size(enum arris_layer layer, const arris_caps *caps, size_t n, size_t m);
void layer_init(enum arris_layer layer, void *data, const arris_caps *caps, size_t n, size_t m);
/* Makes a used buffer an empty one. */
void layer_reset(enum arris_layer layer, void *data);

/* ---- clock.c -----------------------------------------------------------------------------------
 */

/* The cheapest monotonic counter of the machine. Stages are timed by it, since clock_gettime alone
 * would cost more than passing a frame on. */
static inline uint64_t clock_ticks(void) {
#if defined(__x86_64__)
    return __builtin_ia32_rdtsc();
#elif defined(__aarch64__)
    uint64_t t;
    __asm__ volatile("mrs %0, cntvct_el0" : "=r"(t));
    return t;
#else
    return (uint64_t)arris_now();
#endif
}
/* The length of a tick in ns, measured since start-up. */
double clock_ns_per_tick(void);

/* ---- histogram.c: log-linear, 1/16 resolution, one writer ---------------------------------------
 */

enum { HISTOGRAM_BUCKETS = 61 * 16 };
typedef struct histogram {
    atomic_ullong bucket[HISTOGRAM_BUCKETS];
    atomic_ullong sum, max;
} histogram;

static inline unsigned histogram_bucket(uint64_t v) {
    if (v < 16)
        return (unsigned)v;
    unsigned octave = 63 - (unsigned)__builtin_clzll(v);
    return (octave - 3) * 16 + (unsigned)(v >> (octave - 4) & 15);
}

static inline void relaxed_add(atomic_ullong *to, uint64_t n) {
    atomic_store_explicit(to, atomic_load_explicit(to, memory_order_relaxed) + n,
                          memory_order_relaxed);
}

/* With plain stores: any thread may read meanwhile. */
static inline void histogram_add(histogram *h, uint64_t ticks) {
    relaxed_add(&h->bucket[histogram_bucket(ticks)], 1);
    relaxed_add(&h->sum, ticks);
    if (ticks > atomic_load_explicit(&h->max, memory_order_relaxed))
        atomic_store_explicit(&h->max, ticks, memory_order_relaxed);
}
uint64_t histogram_count(const histogram *h);
uint64_t histogram_quantile(const histogram *h, double q);

/* ---- ring.c: the bounded queue between two lanes ------------------------------------------------
 */

typedef struct waiter { /* one thread that sleeps, and those that wake it */
    pthread_mutex_t mutex;
    pthread_cond_t cond;
    atomic_int waiting;
} waiter;

int waiter_init(waiter *w);
void waiter_free(waiter *w);
/* Waits until ready(what); false when *stop came first. */
bool waiter_wait(waiter *w, bool (*ready)(const void *), const void *what, const atomic_int *stop);
/* To be called after what `ready` looks at has changed. */
void waiter_wake(waiter *w);

/* What the one who puts writes: for a short queue all of it lies in one cache line. */
typedef struct ring_put_side {
    atomic_size_t tail; /* next to put */
    _Atomic(arris_frame *) slot[];
} ring_put_side;

typedef struct ring {
    size_t size;
    ring_put_side *put;
    waiter not_empty, not_full;
    _Alignas(64) atomic_size_t head; /* next to take */
    char rest[64 - sizeof(atomic_size_t)];
} ring;

int ring_init(ring *r, size_t size);
void ring_free(ring *r);
size_t ring_count(const ring *r);
/* Takes the oldest; NULL when empty. Any thread. */
arris_frame *ring_try_take(ring *r);
/* Puts one; false when `limit` frames are in it. The one producer. */
bool ring_try_put(ring *r, arris_frame *f, size_t limit);
/* The same, but waiting until it succeeds or *stop: then NULL or false. */
arris_frame *ring_take(ring *r, const atomic_int *stop);
bool ring_put(ring *r, arris_frame *f, size_t limit, const atomic_int *stop);

/* ---- bus.c --------------------------------------------------------------------------------------
 */

enum { BUS_MESSAGES = 64 };
typedef struct bus {
    pthread_mutex_t mutex;
    pthread_cond_t cond;
    arris_message message[BUS_MESSAGES];
    size_t head, n;
    uint64_t lost;
    bool ended;
} bus;

int bus_init(bus *b);
void bus_free(bus *b);
void bus_post(bus *b, const arris_message *m);
void bus_end(bus *b);

/* ---- the graph ----------------------------------------------------------------------------------
 */

#define NAME_CHARACTERS "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_"
enum { MAX_STAGES = 256, MAX_COUNTERS = 8, MAX_NAME = 64, MAX_LOOPS = 4, MAX_DELAY = 16 };

typedef struct lane {
    arris_pipeline *pipeline;
    int number;
    arris_stage *head; /* the source, or the queue that it takes from */
    pthread_t thread;
    bool running;
    arris_frame *frame; /* that it works on */
} lane;

typedef struct layer_pool {
    pool pool;
    size_t n, m; /* capacities as reserved */
    bool reserved;
} layer_pool;

/* A layer on its way back upstream (loop.c). Frames are counted as they come to the asker. */
typedef struct loop {
    arris_stage *asker, *giver;
    enum arris_layer layer;
    uint64_t entered; /* frames that have come to the asker */
    struct {
        pool_item *item;      /* NULL: of a frame that was dropped */
        atomic_ullong posted; /* the number of the frame that it is of, from 1 */
    } slot[MAX_DELAY + 1];
    waiter waiter;
} loop;

struct arris_stage {
    arris_pipeline *pipeline;
    const arris_stage_desc *desc;
    void *self;
    strings *own;
    token at; /* where it stands in the line */
    char name[MAX_NAME];
    bool implied; /* a queue that the host put in */

    arris_stage *in;
    arris_stage **out; /* more than one only behind a tee */
    size_t n_out;

    arris_layers layers; /* as settled */
    uint32_t have;       /* what reaches it */
    arris_caps caps;     /* as it hands them on */
    bool was_set_up, live;
    atomic_bool failed;
    int delay;       /* of what it asks for */
    uint32_t inside; /* the loops that it stands in, from asker to giver, both included */
    lane *lane;

    layer_pool pools[ARRIS_MAX_LAYERS];
    ring ring;                          /* of a queue */
    _Alignas(64) atomic_ullong dropped; /* by the lane before a queue, or its own */
    atomic_size_t fill;                 /* of a queue, the greatest; by the lane before it */
    _Alignas(64) atomic_ullong frames;
    atomic_llong frame;            /* the sequence number it works on; -1: none */
    _Atomic(const char *) trouble; /* what ails it; NULL: nothing */
    histogram time;
    struct {
        _Atomic(const char *) name;
        atomic_ullong n;
    } counter[MAX_COUNTERS];
};

struct arris_frame {
    pool_item *item;
    uint64_t seq;
    int64_t index, utime, start; /* start: CLOCK_MONOTONIC ns at the exposure */
    uint64_t queued;             /* ticks, when it was put into the queue that it waits in */
    bool last;                   /* the one that carries finish */
    bool timed;                  /* its way is booked in the stages' histograms */
    uint32_t carries;            /* the layers that are not NULL */
    uint32_t given;              /* by the stage that works on it now */
    uint64_t number[MAX_LOOPS];  /* among the frames that have come to a loop's asker */
    pool_item *layer[ARRIS_MAX_LAYERS];
    pool_item *old[ARRIS_MAX_LAYERS]; /* replaced; kept until process returns */
};

struct arris_pipeline {
    token_list tokens;
    arris_stage **stage; /* upstream first */
    size_t n_stages;
    lane *lanes;
    size_t n_lanes, n_leaves;
    arris_stage *first_leaf;
    pool frames;
    loop loop[MAX_LOOPS];
    size_t n_loops;
    bus bus;
    FILE *trace;
    double ns_per_tick;       /* for the trace */
    atomic_llong started;     /* ns; 0: has not */
    atomic_llong ended;       /* ns; 0: runs */
    arris_error *setup_error; /* where arris_fail writes before the lanes run */
    bool checked, running;
    atomic_int stop, abort, result;
    atomic_size_t leaves_left;
    _Alignas(64) atomic_ullong frames_made; /* by the source's lane */
    _Alignas(64) atomic_uint lines;         /* by the last lane, as what follows */
    atomic_bool quick;                      /* frames pass faster than is worth timing each */
    histogram latency;                      /* ns from exposure to the end of the first branch */
};

/* trace.c */
void trace_event(arris_pipeline *p, const arris_stage *s, uint64_t seq, uint64_t from, uint64_t to);
/* Ends the file; false when it could not be written whole. */
bool trace_close(arris_pipeline *p);

/* frame.c */
arris_frame *frame_take(arris_pipeline *p);
arris_frame *frame_shell(arris_frame *f, arris_pipeline *p); /* the same layers, own frame */
void frame_settle(arris_frame *f); /* forgets what the stage that worked on it replaced */
void frame_release(arris_frame *f);

/* parse.c */
arris_stage *stage_new(arris_pipeline *p, const arris_stage_desc *d, const token *at,
                       arris_error *err);
int stage_link(arris_stage *from, arris_stage *to, arris_error *err);

/* loop.c */
int loops_make(arris_pipeline *p, arris_error *err);
void loops_free(arris_pipeline *p);
/* Buffers of a giver's layer that its loops hold. */
size_t loops_hold(const arris_stage *giver, enum arris_layer layer);
/* Before and after a stage works on a frame; after: `gone` when it dropped the frame. */
void loops_enter(arris_stage *s, arris_frame *f);
void loops_leave(arris_stage *s, arris_frame *f, bool gone);

/* run.c: joins the lanes; what has not ended is aborted. */
void run_join(arris_pipeline *p);

#endif
