/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * arris_plugin.h: the only header a stage includes.
 *
 * A plugin is a shared object that exports one symbol, `arris_plugin`, which lists its stages and
 * subcommands. A stage is a descriptor: a private struct that the host allocates and zeroes, a
 * table of properties that the host parses, range-checks and stores into it, and callbacks.
 * samples/template is one.
 *
 * The life of a stage, in order:
 *   settle   once, any time before the graph is checked: the properties are known, nothing is open
 *   setup    once, upstream stages first, by the thread that builds the pipeline; opens things
 *   process  for every frame, always by the same thread (the stage's lane)
 *   finish   once after the last frame, upstream stages first: results are completed and written
 *   close    once, always when setup was called, even when that failed; releases everything
 * Every callback but process may be NULL. A stage's callbacks never run at the same time.
 *
 * Callbacks return 0 or a negative error. Before a stage returns an error it says why with
 * arris_fail, which returns the code: `return arris_fail(s, ARRIS_E_IO, "hint", "cannot ...");`
 * An error in process ends the stream: what is in flight is drained, every stage finishes, and the
 * pipeline reports the error.
 */
#ifndef ARRIS_PLUGIN_H
#define ARRIS_PLUGIN_H

#include <stdio.h>

#include "arris_geometry.h"
#include "arris_types.h"

#ifdef __cplusplus
extern "C" {
#endif
#pragma GCC visibility push(default)

#define ARRIS_ABI 1

typedef struct arris_stage arris_stage; /* the host's side of a stage; opaque */
typedef struct arris_frame arris_frame; /* opaque */

/* ---- properties ----------------------------------------------------------------------------- */

enum arris_type {
    ARRIS_INT,    /* int32_t */
    ARRIS_DOUBLE, /* double */
    ARRIS_BOOL,   /* bool */
    ARRIS_ENUM,   /* int32_t: the index into `words` */
    ARRIS_STRING, /* const char *: NULL when it was not given and has no default */
    ARRIS_INFILE  /* const char *: a path to read; in a recipe it is relative to the recipe */
};

/* Frozen within an ABI number, since tables of it are arrays. A STRING whose name is "*" takes what
 * no other row names: `name=value` and a line feed for each such word of the launch line. */
typedef struct arris_prop {
    const char *name;
    enum arris_type type;
    size_t offset;     /* of the field in the stage's struct */
    const char *value; /* the default, as a user would write it; NULL: none */
    double min, max;   /* INT, DOUBLE */
    const char *unit;  /* "px", "mm"; NULL: none */
    const char
        *words; /* ENUM: "drop|pass|error". INT, DOUBLE: a word that stands for -1 ("auto") */
    const char *help;
} arris_prop;

/* Rows of a property table: ARRIS_P_INT(struct edges, min_length, "min-length", "10", 1, 1e4, ...)
 */
#define ARRIS_P_INT(T, field, name, value, min, max, unit, help)                                   \
    { name, ARRIS_INT, offsetof(T, field), value, min, max, unit, NULL, help }
#define ARRIS_P_INT_OR(T, field, name, word, value, min, max, unit, help)                          \
    { name, ARRIS_INT, offsetof(T, field), value, min, max, unit, word, help }
#define ARRIS_P_DOUBLE(T, field, name, value, min, max, unit, help)                                \
    { name, ARRIS_DOUBLE, offsetof(T, field), value, min, max, unit, NULL, help }
#define ARRIS_P_DOUBLE_OR(T, field, name, word, value, min, max, unit, help)                       \
    { name, ARRIS_DOUBLE, offsetof(T, field), value, min, max, unit, word, help }
#define ARRIS_P_BOOL(T, field, name, value, help)                                                  \
    { name, ARRIS_BOOL, offsetof(T, field), value, 0, 0, NULL, NULL, help }
#define ARRIS_P_ENUM(T, field, name, value, words, help)                                           \
    { name, ARRIS_ENUM, offsetof(T, field), value, 0, 0, NULL, words, help }
#define ARRIS_P_STRING(T, field, name, value, help)                                                \
    { name, ARRIS_STRING, offsetof(T, field), value, 0, 0, NULL, NULL, help }
#define ARRIS_P_INFILE(T, field, name, value, help)                                                \
    { name, ARRIS_INFILE, offsetof(T, field), value, 0, 0, NULL, NULL, help }

/* ---- descriptors ---------------------------------------------------------------------------- */

enum {
    ARRIS_SOURCE = 1, /* stands first; process fills an empty frame */
    ARRIS_SINK = 2,   /* may stand anywhere; a branch without one is an error */
    ARRIS_AHEAD = 4   /* a source that works ahead, in a lane of its own before a queue */
};

/* What a source's or any stage's process returns besides 0 and errors. */
enum {
    ARRIS_DROP = 1, /* the frame goes no further; counted */
    ARRIS_END = 2   /* source: there is no frame, the stream has ended */
};

/* The layers of a stage, as sets of ARRIS_BIT(layer). */
typedef struct arris_layers {
    uint32_t needs; /* without these the graph is refused */
    uint32_t wants; /* used when they are there */
    uint32_t gives; /* added, or replaced */
    uint32_t asks;  /* made downstream, of an earlier frame: see arris_feedback */
} arris_layers;

typedef struct arris_stage_desc {
    size_t size; /* sizeof(arris_stage_desc) as the plugin was built: fields are only appended */
    const char *name, *summary;
    const char *example; /* a launch line that shows it; the tests run it */
    uint32_t flags;
    arris_layers layers;
    size_t self_size; /* of the private struct, `self` below */
    const arris_prop *props;
    size_t n_props;

    /* Narrows `l` once the properties are known; arris_has says what reaches the stage. Opens and
     * changes nothing. */
    int (*settle)(arris_stage *s, void *self, arris_layers *l);
    /* Opens what the stage needs, reserves the layers that it gives (arris_reserve), and, when it
     * changes them, the caps: they come in as upstream left them and go on downstream. */
    int (*setup)(arris_stage *s, void *self, arris_caps *caps);
    /* Returns 0, ARRIS_DROP, ARRIS_END or an error. */
    int (*process)(arris_stage *s, void *self, arris_frame *f);
    /* `f` carries what upstream stages gave in their own finish, and no image. */
    int (*finish)(arris_stage *s, void *self, arris_frame *f);
    void (*close)(arris_stage *s, void *self);

    /* Of a stage that deals with devices: lists those that are there and what they can do, for
     * `arris stages NAME --devices`. Any thread, without a pipeline. Returns 0 or an error. */
    int (*devices)(FILE *out);
} arris_stage_desc;

/* A subcommand of the program: `arris NAME ...`. */
typedef struct arris_command_desc {
    size_t size; /* sizeof(arris_command_desc) as the plugin was built: fields are only appended */
    const char *name, *summary;
    /* argv[0] is the name. Reports its own errors on stderr and returns the program's exit code. */
    int (*run)(int argc, char **argv);
} arris_command_desc;

typedef struct arris_plugin_desc {
    size_t size;  /* sizeof(arris_plugin_desc) as the plugin was built: fields are only appended */
    uint32_t abi; /* ARRIS_ABI */
    const char *name, *licence;
    const arris_stage_desc *const *stages;     /* NULL-terminated */
    const arris_command_desc *const *commands; /* NULL-terminated; NULL: none */
} arris_plugin_desc;

/* In a plugin: ARRIS_PLUGIN("mine", "LGPL-2.1-or-later", &stage_a, &stage_b); */
#if defined(__cplusplus)
#define ARRIS_EXPORT extern "C" __attribute__((visibility("default")))
#else
#define ARRIS_EXPORT __attribute__((visibility("default")))
#endif
#define ARRIS_PLUGIN(name, licence, ...) ARRIS_PLUGIN_COMMANDS(name, licence, NULL, __VA_ARGS__)
/* The same with a NULL-terminated array of subcommands; a plugin without stages lists NULL. */
#define ARRIS_PLUGIN_COMMANDS(name, licence, commands, ...)                                        \
    static const arris_stage_desc *const arris_plugin_stages[] = {__VA_ARGS__, NULL};              \
    ARRIS_EXPORT const arris_plugin_desc arris_plugin;                                             \
    const arris_plugin_desc arris_plugin = {sizeof(arris_plugin_desc), ARRIS_ABI, name, licence,   \
                                            arris_plugin_stages,       commands}

/* ---- the stage and its host ----------------------------------------------------------------- */

/* The name by which the user knows this stage: its `name=`, else the descriptor's. Lives as long as
 * the stage. Any thread. */
const char *arris_stage_name(const arris_stage *s);

/* Whether `layer` reaches this stage; from settle on. Any thread. */
bool arris_has(const arris_stage *s, enum arris_layer layer);

/* Whether a stage downstream needs or wants `layer` as this stage gives it; from setup on. Any
 * thread. */
bool arris_wanted(const arris_stage *s, enum arris_layer layer);

/* In setup: reserves the buffers of a layer that the stage gives, for all frames that can be in
 * flight. Capacities by layer: IMAGE and FLOW take the size of the stage's outgoing caps and
 * ignore both numbers; EDGES n points, m chains; VERDICT n features, m lines; SEGMENTS, TRACKS,
 * LINES, CORNERS n items; POSE none; a user layer n bytes. Call it last in setup. Returns 0 or
 * ARRIS_E_INTERNAL when the stage does not give that layer. */
int arris_reserve(arris_stage *s, enum arris_layer layer, size_t n, size_t m);

/* In setup: how many items a layer that reaches this stage holds at most, as its giver reserved it;
 * the second number goes to *m unless that is NULL. 0 when it does not reach the stage. */
size_t arris_capacity(const arris_stage *s, enum arris_layer layer, size_t *m);

/* In setup, of a source: its frames come when the world makes them. A live source runs in a lane of
 * its own before a queue that drops the oldest frame rather than wait. */
void arris_set_live(arris_stage *s, bool live);

/* In process: false once the stream is asked to end. A stage that waits polls it at least every
 * 100 ms. Any thread. */
bool arris_running(const arris_stage *s);

/* Posts an error with the stage's name and frame, and returns `code`. `hint` says what to do, or is
 * NULL. The text is formatted as by printf and cut at 400 bytes. Any thread. */
int arris_fail(arris_stage *s, int code, const char *hint, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

/* Likewise, for what the user should know though the stream goes on. */
void arris_warn(arris_stage *s, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* Adds to the stage's named counter, shown by --stats ("truncated", "without pose"). `name` is a
 * string literal; a stage has at most 8. By the stage's own thread. */
void arris_count(arris_stage *s, const char *name, uint64_t n);

/* What ails the stage now though the stream goes on ("no robot states", "the device is lost"): a
 * string literal; NULL when all is well again. A change of it is posted as a message; progress has
 * it as long as it lasts. Any thread. */
void arris_trouble(arris_stage *s, const char *what);

/* Where the whole stream stands, and every counter of its stages: `f` is called for each, with the
 * stage's name and the counter's. For stages that tell others. Any thread, from the first call of
 * process to close; before the stream has started all is 0. */
arris_progress arris_stage_progress(const arris_stage *s);
void arris_each_counter(const arris_stage *s,
                        void (*f)(void *user, const char *stage, const char *name, uint64_t n),
                        void *user);

/* ---- the frame ------------------------------------------------------------------------------ */

/* The frame's number in the stream, from 0. In finish: how many there were. */
uint64_t arris_frame_seq(const arris_frame *f);

/* The middle of the exposure, µs since the epoch (or since the recording's own start). */
int64_t arris_frame_utime(const arris_frame *f);

/* The number that the recording gives the frame (frames.csv's index); the sequence number unless
 * the source said otherwise. */
int64_t arris_frame_index(const arris_frame *f);

/* In a source's process: what the frame is. Latency is counted from this call. */
void arris_frame_set(arris_frame *f, int64_t index, int64_t utime);

/* When the frame came, by arris_now: that call, unless the source says afterwards that it was
 * earlier. */
int64_t arris_frame_arrival(const arris_frame *f);
void arris_frame_set_arrival(arris_frame *f, int64_t when);

/* A layer of the frame to read; NULL when it has none. Valid until process returns. */
const void *arris_layer_get(const arris_frame *f, enum arris_layer layer);

/* In settle or setup: how many frames before the present one arris_feedback looks, 1 to 16
 * (default 1). */
void arris_set_delay(arris_stage *s, int frames);

/* Whether a stage downstream gives a layer that this one asks for; from setup on. Any thread. */
bool arris_has_feedback(const arris_stage *s, enum arris_layer layer);

/* In process: a layer that this stage asks for, as the nearest giver downstream made it `delay`
 * frames (that came to this stage) before. Waits for it when a queue stands between, so that what
 * comes of it does not depend on threads. NULL: that frame was dropped on the way, there was none
 * yet, nobody gives it, or the pipeline is aborted. Valid until process returns. */
const void *arris_feedback(arris_stage *s, enum arris_layer layer);

/* A fresh buffer of a layer that this stage gives and has reserved; the frame carries it from now
 * on in the place of one that it had, which stays readable until process returns. Counts and
 * `camera` are those of an empty layer; the image's size and format are set, its pixels are not.
 * Never NULL: the pool holds enough for every frame in flight. */
void *arris_layer_give(arris_stage *s, arris_frame *f, enum arris_layer layer);

/* Whether any frame still carries `given`, which this stage's arris_layer_give returned. A source
 * may point an image's data and stride into memory of its own, a driver's buffer, when rows start
 * on 64-byte boundaries and 64 bytes may be read after the last: this tells it when it may have
 * that memory back. By the stage's own thread, until it is given anew; in close nothing is held. */
bool arris_layer_held(const arris_stage *s, enum arris_layer layer, const void *given);

/* CLOCK_MONOTONIC, ns. Any thread. */
int64_t arris_now(void);

#pragma GCC visibility pop
#ifdef __cplusplus
}
#endif
#endif
