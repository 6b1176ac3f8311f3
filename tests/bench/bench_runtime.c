/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * bench_runtime.c: what the runtime itself costs, in one run beside GStreamer: the time per buffer
 * of ten `identity` and of one `queue` between a source of empty frames and fakesink.
 *
 * What stages add is the difference between pipelines with and without them. A repetition runs all
 * pipelines of both in turn, and ratios are taken within a repetition, so that what else the
 * machine does falls on both alike. Shown are medians.
 */
#include <gst/gst.h>
#include <stdio.h>
#include <stdlib.h>

#include "arris.h"
#include "arris_plugin.h"

enum { BUFFERS = 100000, REPETITIONS = 9 };
enum { BARE, IDENTITY, QUEUE_2, QUEUE_200, PIPELINES };

/* What stands between source and sink. */
static const char *const ours[PIPELINES] = {
    "",
    "! identity ! identity ! identity ! identity ! identity ! identity ! identity ! identity "
    "! identity ! identity",
    "! queue", "! queue max-frames=200"};
static const char *const theirs[PIPELINES] = {
    "",
    "! identity silent=true ! identity silent=true ! identity silent=true ! identity silent=true "
    "! identity silent=true ! identity silent=true ! identity silent=true ! identity silent=true "
    "! identity silent=true ! identity silent=true",
    "! queue max-size-buffers=2 max-size-bytes=0 max-size-time=0", "! queue"};

static double times[2][PIPELINES][REPETITIONS]; /* ns per buffer: Arris, GStreamer */

static void give_up(const char *what) {
    fprintf(stderr, "bench_runtime: %s\n", what);
    exit(1);
}

/* Both return the ns per buffer from the start of the pipeline to the end of its stream. */
static double run_ours(const char *middle) {
    char line[512];
    arris_error err;
    arris_message m;
    snprintf(line, sizeof line, "fakesrc frames=%d %s ! fakesink", BUFFERS, middle);
    arris_pipeline *p = arris_parse(line, &err);
    if (!p || arris_check(p, &err))
        give_up(err.text);
    int64_t start = arris_now();
    if (arris_start(p, &err))
        give_up(err.text);
    while (arris_wait(p, &m, 1000) != ARRIS_WAIT_ENDED)
        ;
    int64_t end = arris_now();
    if (arris_get_progress(p).done != BUFFERS)
        give_up("Arris lost frames");
    arris_free(p);
    return (double)(end - start) / BUFFERS;
}

static double run_theirs(const char *middle) {
    char line[512];
    snprintf(line, sizeof line, "fakesrc num-buffers=%d sizetype=empty %s ! fakesink", BUFFERS,
             middle);
    GstElement *p = gst_parse_launch(line, NULL);
    if (!p)
        give_up("GStreamer cannot build the pipeline; are its core elements installed?");
    GstBus *bus = gst_element_get_bus(p);
    int64_t start = arris_now();
    gst_element_set_state(p, GST_STATE_PLAYING);
    GstMessage *m =
        gst_bus_timed_pop_filtered(bus, GST_CLOCK_TIME_NONE, GST_MESSAGE_EOS | GST_MESSAGE_ERROR);
    int64_t end = arris_now();
    if (GST_MESSAGE_TYPE(m) != GST_MESSAGE_EOS)
        give_up("GStreamer's pipeline failed");
    gst_message_unref(m);
    gst_object_unref(bus);
    gst_element_set_state(p, GST_STATE_NULL);
    gst_object_unref(p);
    return (double)(end - start) / BUFFERS;
}

static int ascending(const void *a, const void *b) {
    double d = *(const double *)a - *(const double *)b;
    return (d > 0) - (d < 0);
}

static double median(double v[REPETITIONS]) {
    qsort(v, REPETITIONS, sizeof *v, ascending);
    return v[REPETITIONS / 2];
}

/* What pipeline a of ours and b of theirs take, a stage, more than pipeline `less`; -1: in all. */
static void show(const char *what, int a, int b, int less, int stages, double goal) {
    double v[2][REPETITIONS], ratio[REPETITIONS];
    for (int r = 0; r < REPETITIONS; r++) {
        v[0][r] = (times[0][a][r] - (less < 0 ? 0 : times[0][less][r])) / stages;
        v[1][r] = (times[1][b][r] - (less < 0 ? 0 : times[1][less][r])) / stages;
        ratio[r] = v[0][r] / v[1][r];
    }
    printf("%-44s %8.1f %10.1f %8.3f", what, median(v[0]), median(v[1]), median(ratio));
    if (goal > 0)
        printf("   <= %.1f %s", goal, median(ratio) <= goal ? "met" : "missed");
    printf("\n");
}

int main(int argc, char **argv) {
    gst_init(&argc, &argv);
    for (int r = -1; r < REPETITIONS; r++) /* the first warms up */
        for (int i = 0; i < PIPELINES; i++) {
            double a = run_ours(ours[i]), b = run_theirs(theirs[i]);
            if (r >= 0) {
                times[0][i][r] = a;
                times[1][i][r] = b;
            }
        }
    printf("ns per buffer, %d empty buffers, median of %d\n", BUFFERS, REPETITIONS);
    printf("%-44s %8s %10s %8s   goal\n", "", "Arris", "GStreamer", "ratio");
    show("source and sink", BARE, BARE, -1, 1, 0);
    show("an identity, of ten", IDENTITY, IDENTITY, BARE, 10, 0.1);
    show("a queue, as by default (of 2 and 200)", QUEUE_2, QUEUE_200, BARE, 1, 0.5);
    show("a queue of 2", QUEUE_2, QUEUE_2, BARE, 1, 0);
    show("a queue of 200", QUEUE_200, QUEUE_200, BARE, 1, 0);
    show("source, queue as by default, sink", QUEUE_2, QUEUE_200, -1, 1, 0);
    return 0;
}
