/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * launch.c: `arris launch`: builds a pipeline, runs it, and tells what it says.
 */
#include <errno.h>
#include <getopt.h>
#include <signal.h>
#include <string.h>
#include <unistd.h>

#include "cli.h"

typedef struct options {
    bool check, stats, quiet, verbose;
    const char *trace, *dot;
} options;

static arris_pipeline *volatile running;

/* The first asks for the end, the second insists, the third is the system's own. */
static void on_signal(int number) {
    static volatile sig_atomic_t times;
    if (!running)
        return;
    if (times++ == 0) {
        arris_stop(running);
    } else {
        arris_abort(running);
        signal(number, SIG_DFL);
    }
}

static int parse_options(int argc, char **argv, options *o) {
    static const struct option table[] = {{"check", no_argument, NULL, 'c'},
                                          {"stats", no_argument, NULL, 's'},
                                          {"trace", required_argument, NULL, 't'},
                                          {"dot", required_argument, NULL, 'd'},
                                          {"quiet", no_argument, NULL, 'q'},
                                          {"verbose", no_argument, NULL, 'v'},
                                          {NULL, 0, NULL, 0}};
    for (int c; (c = getopt_long(argc, argv, "qv", table, NULL)) != -1;) {
        switch (c) {
        case 'c':
            o->check = true;
            break;
        case 's':
            o->stats = true;
            break;
        case 't':
            o->trace = optarg;
            break;
        case 'd':
            o->dot = optarg;
            break;
        case 'q':
            o->quiet = true;
            break;
        case 'v':
            o->verbose = true;
            break;
        default: /* getopt has said what is wrong */
            fputs("  see `arris --help`\n", stderr);
            return 2;
        }
    }
    if (optind < argc)
        return 0;
    fputs("arris launch: give it a pipeline; see `arris --help`\n", stderr);
    return 2;
}

static int write_dot(const arris_pipeline *p, const char *path) {
    FILE *f = strcmp(path, "-") == 0 ? stdout : fopen(path, "w");
    if (f)
        arris_print_dot(p, f);
    if (!f || (f != stdout && fclose(f))) {
        fprintf(stderr, "arris: cannot write the graph '%s': %s\n", path, strerror(errno));
        return arris_exit_code(ARRIS_E_IO);
    }
    return 0;
}

/* On a terminal only; `end` leaves the line standing. */
static void show_progress(const arris_pipeline *p, const options *o, bool end) {
    arris_progress r = arris_get_progress(p);
    bool terminal = isatty(STDERR_FILENO);
    if (o->quiet || (!terminal && !(end && o->verbose)))
        return;
    fprintf(stderr, "%s%llu frames, %.1f s, %.0f frames/s", terminal ? "\r\033[K" : "",
            (unsigned long long)r.done, r.seconds,
            r.seconds > 0 ? (double)r.done / r.seconds : 0.0);
    if (r.dropped)
        fprintf(stderr, ", %llu dropped", (unsigned long long)r.dropped);
    if (r.lines)
        fprintf(stderr, ", %llu lines", (unsigned long long)r.lines);
    fputs(end ? "\n" : "", stderr);
}

static void show_message(const arris_message *m, const options *o) {
    static const char *const words[] = {"info", "warning", "error"};
    if (m->severity == ARRIS_INFO ? !o->verbose : o->quiet && m->severity == ARRIS_WARNING)
        return;
    fprintf(stderr, "%sarris: %s: ", isatty(STDERR_FILENO) ? "\r\033[K" : "", words[m->severity]);
    if (*m->stage)
        fprintf(stderr, "%s: ", m->stage);
    if (m->frame >= 0)
        fprintf(stderr, "frame %lld: ", (long long)m->frame);
    fprintf(stderr, "%s\n", m->text);
    if (*m->hint)
        fprintf(stderr, "  %s\n", m->hint);
}

static int run(arris_pipeline *p, const options *o) {
    arris_error err;
    arris_message m;
    if (arris_start(p, &err))
        return cli_error(&err);
    for (;;) {
        enum arris_wait_result r = arris_wait(p, &m, 100);
        if (r == ARRIS_WAIT_ENDED)
            break;
        if (r == ARRIS_WAIT_MESSAGE)
            show_message(&m, o);
        else
            show_progress(p, o, false);
    }
    show_progress(p, o, true);
    if (o->stats)
        arris_print_stats(p, stdout);
    if (arris_result(p) == ARRIS_E_ABORTED)
        fputs("arris: aborted; nothing was written\n", stderr);
    return arris_exit_code(arris_result(p));
}

static int check_and_run(arris_pipeline *p, const options *o) {
    arris_error err;
    arris_message m;
    int bad = arris_check(p, &err);
    while (arris_wait(p, &m, 0) == ARRIS_WAIT_MESSAGE)
        show_message(&m, o);
    if (bad)
        return cli_error(&err);
    int rc = o->dot ? write_dot(p, o->dot) : 0;
    if (rc == 0 && o->check)
        arris_print(p, stdout);
    if (rc || o->check)
        return rc;
    if (o->trace && arris_trace(p, o->trace, &err))
        return cli_error(&err);
    return run(p, o);
}

int cli_launch(int argc, char **argv) {
    options o = {0};
    arris_error err;
    argv[0] = (char[]){"arris launch"}; /* as getopt's messages begin */
    int rc = parse_options(argc, argv, &o);
    if (rc)
        return rc;
    arris_pipeline *p = arris_parse_words(argc - optind, argv + optind, &err);
    if (!p)
        return cli_error(&err);
    running = p;
    struct sigaction action = {.sa_handler = on_signal};
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    rc = check_and_run(p, &o);
    running = NULL;
    arris_free(p);
    return rc;
}
