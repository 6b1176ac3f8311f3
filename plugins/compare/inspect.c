/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * inspect.c: the command `arris inspect`: runs a recipe that ends in `compare` and tells the
 * verdict: as files, as a table, as the exit code. The pipeline itself is `arris launch`'s.
 */
#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "arris_plugin.h"

#include "nominal.h"
#include "options.h"

static const char help[] =
    "usage: arris inspect [-o FOLDER] [--json] [-q] RECIPE [WORD...]\n"
    "       arris inspect --edges MODEL [--crease-angle DEGREES] [--min-length MM]\n"
    "\n"
    "Runs a recipe (or a whole line) whose last stage is `compare`, writes lines.json, "
    "verdict.json\n"
    "and report.html, and prints the verdict.\n"
    "\n"
    "  -o FOLDER   where the results go; the folder one stands in unless given\n"
    "  --json      print verdict.json in place of the table\n"
    "  -q          print nothing but errors\n"
    "  --edges     list the edges of a model, as features= names them\n"
    "\n"
    "Exit codes: 0 pass, 1 fail, 3 indeterminate, 2 usage or recipe, 4 device or input.\n";

typedef struct options {
    const char *folder, *edges;
    double crease, min_length;
    bool json, quiet;
} options;

enum { OK = 0, FAIL = 1, USAGE = 2, INDETERMINATE = 3, INPUT = 4, INTERNAL = 5 };

static void tell(const fault *f) {
    fprintf(stderr, "arris inspect: %s\n%s%s%s", f->text, f->hint ? "  " : "",
            f->hint ? f->hint : "", f->hint ? "\n" : "");
}

/* ---- the edges of a model -------------------------------------------------------------------- */

static int list_edges(const options *o) {
    nominal m;
    fault f = {.hint = NULL};
    int r = nominal_read(&m, o->edges, o->crease * 0.017453292519943295, o->min_length, &f);
    if (r)
        tell(&f);
    else
        printf("%-20s %10s   %s\n", "edge", "length/mm", "from, to / mm");
    for (uint32_t i = 0; r == 0 && i < m.n_edges; i++) {
        const double *p = m.edge[i].p, *q = m.edge[i].q;
        printf("%-20s %10.2f   %.2f,%.2f,%.2f  %.2f,%.2f,%.2f\n", m.edge[i].id,
               hypot(hypot(q[0] - p[0], q[1] - p[1]), q[2] - p[2]), p[0], p[1], p[2], q[0], q[1],
               q[2]);
    }
    nominal_free(&m);
    return r == ARRIS_E_MEMORY ? INTERNAL : r ? INPUT : OK;
}

/* ---- the pipeline ---------------------------------------------------------------------------- */

static bool is_recipe(const char *word) {
    size_t n = strlen(word);
    return n > 6 && strcmp(word + n - 6, ".arris") == 0;
}

/* `arris launch WORDS ! filesink ... ! filesink ...`; NULL-terminated, for free(). */
static char **compose(const options *o, int n, char **words, char paths[3][4096],
                      char recipe[4096]) {
    static char arris[] = "arris", launch[] = "launch", quiet[] = "-q", then[] = "!";
    static char filesink[] = "filesink";
    static const char *const names[] = {"lines.json", "verdict.json", "report.html"};
    char **argv = calloc((size_t)n + 20, sizeof *argv);
    int argc = 0;
    if (!argv)
        return NULL;
    argv[argc++] = arris;
    argv[argc++] = launch;
    if (o->quiet)
        argv[argc++] = quiet;
    for (int i = 0; i < n; i++)
        argv[argc++] = words[i];
    for (int i = 0; i < 3; i++) {
        snprintf(paths[i], sizeof paths[i], "location=%s/%s", o->folder, names[i]);
        argv[argc++] = then;
        argv[argc++] = filesink;
        argv[argc++] = paths[i];
        if (i > 0 && is_recipe(words[0]) && snprintf(recipe, 4096, "recipe=%s", words[0]) < 4096)
            argv[argc++] = recipe;
    }
    return argv;
}

/* Ctrl-C reaches both; the pipeline's own end is waited for. */
static int launch(char **argv) {
    struct sigaction ignore = {.sa_handler = SIG_IGN}, old;
    int status = 0;
    sigaction(SIGINT, &ignore, &old);
    pid_t pid = fork();
    if (pid == 0) {
        sigaction(SIGINT, &old, NULL);
        execv("/proc/self/exe", argv);
        _exit(INTERNAL);
    }
    while (pid > 0 && waitpid(pid, &status, 0) < 0 && errno == EINTR)
        ;
    sigaction(SIGINT, &old, NULL);
    if (pid < 0)
        fprintf(stderr, "arris inspect: cannot start the pipeline: %s\n", strerror(errno));
    return pid > 0 && WIFEXITED(status) ? WEXITSTATUS(status) : INTERNAL;
}

/* ---- the verdict ----------------------------------------------------------------------------- */

static void print_number(const json_t *feature, const char *key, double unit, const char *format) {
    const json_t *v = json_object_get(feature, key);
    char text[32] = "-";
    if (json_is_number(v))
        snprintf(text, sizeof text, format, json_number_value(v) * unit);
    printf(" %10s", text);
}

static void print_feature(const json_t *f) {
    const char *reason = json_string_value(json_object_get(f, "reason"));
    bool angle = !strcmp(json_string_value(json_object_get(f, "unit")), "rad");
    double unit = angle ? 57.29577951308232 : 1;
    printf("%-22s", json_string_value(json_object_get(f, "id")));
    print_number(f, "deviation", unit, "%+.3f");
    print_number(f, "U", unit, "%.3f");
    print_number(f, "worst", unit, "%+.3f");
    print_number(f, "tolerance", unit, "%.3g");
    printf("  %-4s %s%s%s\n", angle ? "deg" : "mm",
           json_string_value(json_object_get(f, "verdict")), reason ? ": " : "",
           reason ? reason : "");
}

static void print_table(const json_t *root) {
    const json_t *features = json_object_get(root, "features"), *f;
    size_t i, extra = json_array_size(json_object_get(root, "extra_lines"));
    printf("%-22s %10s %10s %10s %10s  unit verdict\n", "feature", "deviation", "U", "worst",
           "tolerance");
    json_array_foreach(features, i, f) print_feature(f);
    printf("\n%zu lines that no nominal edge explains\n", extra);
    printf("verdict: %s\n", json_string_value(json_object_get(root, "verdict")));
}

static int print_file(const char *path) {
    char block[4096];
    FILE *f = fopen(path, "r");
    for (size_t n; f && (n = fread(block, 1, sizeof block, f)) > 0;)
        fwrite(block, 1, n, stdout);
    return f ? fclose(f) : -1;
}

static int conclude(const options *o, const char *path) {
    json_error_t e;
    json_t *root = json_load_file(path, 0, &e);
    const char *verdict = json_string_value(json_object_get(root, "verdict"));
    if (!verdict) {
        fprintf(stderr, "arris inspect: cannot read the verdict back from %s: %s\n", path, e.text);
        json_decref(root);
        return INTERNAL;
    }
    int rc = !strcmp(verdict, "PASS") ? OK : !strcmp(verdict, "FAIL") ? FAIL : INDETERMINATE;
    if (o->json)
        print_file(path);
    else if (!o->quiet)
        print_table(root);
    json_decref(root);
    return rc;
}

/* ---- the command ----------------------------------------------------------------------------- */

static const char hint[] = "see `arris inspect --help`";

static int read_number(const char *option, double *v, fault *f) {
    char *end;
    *v = strtod(optarg, &end);
    if (end != optarg && *end == 0 && isfinite(*v) && *v >= 0)
        return 0;
    return fault_set(f, ARRIS_E_USAGE, hint, "%s %.40s: expected a number, 0 or above", option,
                     optarg);
}

static int read_option(int c, void *self, fault *f) {
    options *o = self;
    switch (c) {
    case 'j':
        o->json = true;
        return 0;
    case 'q':
        o->quiet = true;
        return 0;
    case 'e':
        o->edges = optarg;
        return 0;
    case 'c':
        return read_number("--crease-angle", &o->crease, f);
    case 'm':
        return read_number("--min-length", &o->min_length, f);
    default:
        o->folder = optarg;
        return 0;
    }
}

/* 0; 1, the help was asked for; or an error. */
static int read_options(int argc, char **argv, options *o, fault *f) {
    static const struct option table[] = {{"json", no_argument, NULL, 'j'},
                                          {"edges", required_argument, NULL, 'e'},
                                          {"crease-angle", required_argument, NULL, 'c'},
                                          {"min-length", required_argument, NULL, 'm'},
                                          {"quiet", no_argument, NULL, 'q'},
                                          {"help", no_argument, NULL, 'h'},
                                          {NULL, 0, NULL, 0}};
    struct stat st;
    int r = options_read(argc, argv, "+ho:q", table, read_option, o, hint, f);
    if (r == 0 && !o->edges && optind == argc)
        return fault_set(f, ARRIS_E_USAGE, hint, "give it a recipe");
    if (r == 0 && (strlen(o->folder) > 4000 || stat(o->folder, &st) || !S_ISDIR(st.st_mode)))
        return fault_set(f, ARRIS_E_USAGE, "create it first", "there is no folder '%.300s'",
                         o->folder);
    return r;
}

static int run(int argc, char **argv) {
    options o = {.folder = ".", .crease = 25, .min_length = 15};
    char paths[3][4096], recipe[4096];
    fault f;
    int rc = read_options(argc, argv, &o, &f);
    if (rc > 0)
        fputs(help, stdout);
    if (rc < 0)
        tell(&f);
    if (rc)
        return rc < 0 ? USAGE : OK;
    if (o.edges)
        return list_edges(&o);
    char **words = compose(&o, argc - optind, argv + optind, paths, recipe);
    rc = words ? launch(words) : INTERNAL;
    free(words);
    return rc ? rc : conclude(&o, paths[1] + strlen("location="));
}

const arris_command_desc command_inspect = {sizeof(arris_command_desc), "inspect",
                                            "runs a recipe and judges a part: pass or fail", run};
