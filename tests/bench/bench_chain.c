/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * bench_chain.c: the whole chain, edges ! undistort ! segments ! track ! reconstruct, beside
 * cv::Canny alone on the same frames, in one process and one thread, guided and not; and whether a
 * frame costs the same after thousands of them.
 *
 *     bench_chain [frames.csv ...]
 *
 * Without arguments: the sample scan, and plates drawn at 320x240 and 1920x1080. A frame's times
 * are the least of RUNS runs, which do the same work; shown are means over the frames.
 */
#include <stdint.h>

#include "../../samples/experiments/common/scan.h"
#include "../process.h"

enum { RUNS = 5, MOST = 6000, EARLY = 200, LATE = 5000 };

typedef struct times {
    int n;
    double canny[MOST], chain[MOST]; /* ns */
    long pages[MOST];
} times;

static void read_times(const char *path, times *t) {
    FILE *f = fopen(path, "r");
    double canny, chain;
    long pages;
    int n = 0;
    for (; f && n < MOST && fscanf(f, "%lf %lf %ld", &canny, &chain, &pages) == 3; n++) {
        bool first = n >= t->n;
        t->canny[n] = first || canny < t->canny[n] ? canny : t->canny[n];
        t->chain[n] = first || chain < t->chain[n] ? chain : t->chain[n];
        t->pages[n] = pages;
    }
    t->n = n;
    if (!f || n == 0)
        die("bench_chain: nothing was timed");
    fclose(f);
}

/* Adds a run to *t. `source` and `edges` are properties of those stages. */
static void run(const char *list, const char *source, const char *edges, times *t) {
    char line[4096], *tally = in_build("bench/tally");
    snprintf(line, sizeof line,
             "imagesrc location=%s %s ! rival ! edges %s ! undistort ! segments ! track ! "
             "reconstruct ! tally file=%s",
             list, source, edges, tally);
    process p = arris_launch(NULL, line);
    if (p.code)
        die("bench_chain: %s", p.err);
    process_free(&p);
    read_times(tally, t);
    free(tally);
}

static double mean(const double *v, int from, int to) {
    double sum = 0;
    for (int i = from; i < to; i++)
        sum += v[i] / (to - from);
    return sum;
}

static void compare(const char *list) {
    static times guided, whole;
    guided.n = whole.n = 0;
    for (int i = 0; i < RUNS; i++) {
        run(list, "", "", &guided);
        run(list, "", "guide=false", &whole);
    }
    double canny = mean(guided.canny, 0, guided.n);
    size_t length = strlen(list);
    printf("%-44s %6d %9.3f %9.3f %8.2f %10.2f\n", list + (length > 44 ? length - 44 : 0), guided.n,
           canny * 1e-6, mean(guided.chain, 0, guided.n) * 1e-6,
           mean(guided.chain, 0, guided.n) / canny,
           mean(whole.chain, 0, whole.n) / mean(whole.canny, 0, whole.n));
}

/* A list of the scan forth and back, beside its own. For free. */
static char *forth_and_back(const char *list, int *turn) {
    static char row[1000][256];
    char *path = malloc(strlen(list) + 10);
    int n = 0;
    FILE *in = fopen(list, "r");
    while (in && n < 1000 && fgets(row[n], sizeof row[n], in))
        n++;
    if (!in || !path || n < 4)
        die("bench_chain: %s has no frames", list);
    fclose(in);
    strcpy(path, list);
    strcpy(strrchr(path, '/'), "/turn.csv");
    FILE *out = create("%s", path);
    for (int i = 0; i < n; i++)
        fputs(row[i], out);
    for (int i = n - 2; i > 1; i--)
        fputs(row[i], out);
    finish(out);
    *turn = 2 * (n - 2);
    return path;
}

/* Whether it costs the same after thousands of frames: over whole turns, of the same pictures. */
static void go_on(const char *list) {
    static times t;
    char source[64];
    int turn;
    char *path = forth_and_back(list, &turn);
    snprintf(source, sizeof source, "loop=%d", LATE / turn + 1);
    run(path, source, "", &t);
    int early = EARLY / turn * turn, late = LATE / turn * turn;
    double before = mean(t.chain, early, early + turn) / mean(t.canny, early, early + turn);
    double after = mean(t.chain, late, late + turn) / mean(t.canny, late, late + turn);
    printf("\nforth and back, a turn from frame %d and one from frame %d: %.3f and %.3f of Canny,\n"
           "ratio %.2f   <= 1.1 %s; memory grew by %ld kB between\n",
           early, late, before, after, after / before, after <= 1.1 * before ? "met" : "missed",
           (t.pages[late] - t.pages[early]) * sysconf(_SC_PAGESIZE) / 1024);
    free(path);
}

/* Plates in a picture of `scale` times the thesis's size in both directions, and 16:9 if `wide`. */
static char *plates(double scale, int width, int height, int frames, const char *name) {
    scene s = scene_new();
    motion m = motion_along_x(frames, 400. / frames);
    s.camera.cx += 0.5 * width / scale - 160, s.camera.cx *= scale;
    s.camera.cy *= scale, s.camera.fx *= scale, s.camera.fy *= scale;
    s.camera.width = width, s.camera.height = height;
    scene_scatter(&s, 670, 1000, 5);
    return scene_render(&s, &m, 1, name);
}

int main(int argc, char **argv) {
    const char *b = getenv("B");
    char path[4096];
    snprintf(path, sizeof path, "%s/bench/plugins", b ? b : "build");
    free(make_folder(""));
    setenv("ARRIS_PLUGIN_PATH", path, 1);
    printf("ms a frame, the least of %d runs\n%-44s %6s %9s %9s %8s %10s\n", RUNS, "scan", "frames",
           "Canny", "chain", "ratio", "unguided");
    for (int i = 1; i < argc; i++)
        compare(argv[i]);
    if (argc > 1)
        return 0;
    char *small = plates(1, 320, 240, 101, "bench-plates"),
         *large = plates(4.5, 1920, 1080, 41, "bench-plates-hd");
    compare("samples/box/frames.csv");
    compare(small);
    compare(large);
    go_on(small);
    free(small);
    free(large);
    return 0;
}
