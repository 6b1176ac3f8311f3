/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * arris.h: what applications include to build and run a pipeline.
 *
 *     arris_error err;
 *     arris_pipeline *p = arris_parse("imagesrc location=box/frames.csv ! edges ! fakesink", &err);
 *     if (p && arris_check(p, &err) == 0 && arris_start(p, &err) == 0)
 *         while (arris_wait(p, &msg, 100) != ARRIS_WAIT_ENDED) ...
 *     arris_free(p);
 *
 * A pipeline belongs to the thread that made it; only arris_stop and arris_abort may be called from
 * elsewhere, signal handlers included.
 */
#ifndef ARRIS_H
#define ARRIS_H

#include <stdio.h>

#include "arris_geometry.h"
#include "arris_types.h"

#ifdef __cplusplus
extern "C" {
#endif
#pragma GCC visibility push(default)

typedef struct arris_pipeline arris_pipeline;

/* What went wrong, and where in the launch line. */
typedef struct arris_error {
    int code;        /* ARRIS_E_... */
    char text[512];  /* one sentence */
    char hint[512];  /* what to do, or empty; may have several lines */
    char line[1024]; /* the launch line around the error, or empty */
    int column;      /* of the caret in `line`, from 0; -1: none */
    char file[512];  /* the recipe that the line is from, or empty */
    int line_number; /* in that recipe, from 1 */
} arris_error;

enum arris_severity { ARRIS_INFO, ARRIS_WARNING, ARRIS_ERROR };

typedef struct arris_message {
    enum arris_severity severity;
    int code;       /* ARRIS_E_... when severity is ARRIS_ERROR */
    char stage[64]; /* who says it; empty: the pipeline */
    int64_t frame;  /* sequence number; -1: none */
    char text[400];
    char hint[400];
} arris_message;

/* The text of an error code ("bad input"), and the exit code that `arris` gives for it. */
const char *arris_strerror(int code);
int arris_exit_code(int code);

/* "0.1.0" */
const char *arris_version(void);

/* Parses a launch line (the grammar is in README.md) and loads the stages that it names. Returns a
 * pipeline for arris_free, or NULL with *err filled (USAGE, RECIPE, PLUGIN, IO, MEMORY). */
arris_pipeline *arris_parse(const char *line, arris_error *err);

/* The same for words, as main gets them: a word with white space in it is one value. One word alone
 * is taken as a whole line. */
arris_pipeline *arris_parse_words(int n, char *const *words, arris_error *err);

/* Settles and checks the whole graph, sets every stage up, and sizes the pools. Returns 0 or an
 * error with *err filled; then only arris_free may follow. */
int arris_check(arris_pipeline *p, arris_error *err);

/* After arris_check: writes the graph as text, one stage a line with its layers and caps. */
void arris_print(const arris_pipeline *p, FILE *out);
/* The graph in Graphviz's language; lanes are its clusters. */
void arris_print_dot(const arris_pipeline *p, FILE *out);

/* Before arris_start: writes every stage's work on every frame to `path` as Chrome trace JSON
 * (chrome://tracing, Perfetto). Returns 0 or ARRIS_E_IO with *err filled. */
int arris_trace(arris_pipeline *p, const char *path, arris_error *err);

/* After arris_check: starts the lanes. Returns 0 or an error with *err filled. */
int arris_start(arris_pipeline *p, arris_error *err);

/* Waits at most timeout_ms for the next message. The stream has ended only when every stage has
 * finished and every message has been taken. */
enum arris_wait_result { ARRIS_WAIT_TIMEOUT, ARRIS_WAIT_MESSAGE, ARRIS_WAIT_ENDED };
enum arris_wait_result arris_wait(arris_pipeline *p, arris_message *m, int timeout_ms);

/* The first error of the stream, or 0. After ARRIS_WAIT_ENDED. */
int arris_result(const arris_pipeline *p);

/* Asks the source to end; what is in flight is drained and every stage finishes. Any thread, and
 * signal handlers. */
void arris_stop(arris_pipeline *p);
/* Asks every lane to end at once; nothing is finished. Any thread, and signal handlers. */
void arris_abort(arris_pipeline *p);

/* Stops what runs, joins the threads, closes the stages and releases everything. NULL is allowed.
 */
void arris_free(arris_pipeline *p);

/* Where the stream stands. From the owner's thread while it runs, or after. */
arris_progress arris_get_progress(const arris_pipeline *p);

/* A table of what every stage did: frames, drops, mean, p50, p99 and the greatest time of process,
 * queues' fill, counters, and latency from exposure. From the owner's thread, any time. */
void arris_print_stats(const arris_pipeline *p, FILE *out);

/* Lists the stages that are known, one a line, or as a JSON array when `json`. */
void arris_print_stages(FILE *out, bool json);
/* Explains one stage from its descriptor. Returns 0, or an error with *err filled. */
int arris_print_stage(const char *name, FILE *out, bool json, arris_error *err);
/* Lists the devices that a stage finds, and what they can do. Returns 0, or an error with *err
 * filled. */
int arris_print_devices(const char *name, FILE *out, arris_error *err);

/* A subcommand `arris NAME ...` that a plugin gives: takes its words, words[0] its name, and
 * returns the program's exit code. NULL with *err filled (USAGE, PLUGIN) when there is none. Any
 * thread. */
typedef int (*arris_command)(int n, char **words);
arris_command arris_find_command(const char *name, arris_error *err);
/* Lists the plugins' subcommands, one a line. Any thread. */
void arris_print_commands(FILE *out);

#pragma GCC visibility pop
#ifdef __cplusplus
}
#endif
#endif
