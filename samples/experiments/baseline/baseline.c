/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * baseline.c: the error of depth against the baseline B over the depth D (thesis, section 3.6),
 * beside the Cramér-Rao bound, with perfect poses and with poses off by 0.2 mm. The same scans are
 * measured from their middle frames only, ever more of them.
 */
#include <math.h>
#include <stdlib.h>

#include "../common/plot.h"
#include "../common/scan.h"

enum { FRAMES = 121, SCANS = 8, LINES = 6 * SCANS };
static const int used[] = {9, 13, 19, 31, 45, 61, 91, 121}; /* frames */
enum { POINTS = sizeof used / sizeof *used };
static const double DEPTH = 800, STEP = 4.1, JITTER = 0.2; /* mm */

/* The RMS errors of depth with each of the numbers of frames, pooled over the scans, mm. */
static void measure(double jitter, double error[POINTS]) {
    static double e[POINTS][LINES];
    int n[POINTS] = {0};
    for (int seed = 1; seed <= SCANS; seed++) {
        scene s = scene_new();
        motion m = motion_along_x(FRAMES, STEP);
        m.jitter = jitter;
        scene_column(&s, DEPTH, (uint64_t)seed);
        truth t = truth_of(&s);
        char *list = scene_render(&s, &m, (uint64_t)seed, "baseline");
        for (int i = 0; i < POINTS; i++) {
            char source[64];
            int start = (FRAMES - used[i]) / 2;
            snprintf(source, sizeof source, "start=%d stop=%d", start, start + used[i]);
            scan r = scan_measure(list, source, "", "limit=1000");
            n[i] += depth_errors(&r, &t, 50, LINES - n[i], e[i] + n[i]);
            scan_free(&r);
        }
        free(list);
    }
    for (int i = 0; i < POINTS; i++)
        error[i] = n[i] < LINES * 2 / 3 ? NAN : rms(e[i], n[i]);
}

static void bounds(double jitter, double bound[POINTS]) {
    const scene s = scene_new();
    motion m = motion_along_x(FRAMES, STEP);
    m.jitter = jitter;
    double offset = bound_offset(&s, 105, SCENE_COLUMN_LENGTH * s.camera.fx);
    for (int i = 0; i < POINTS; i++)
        bound[i] = bound_depth(&s, &m, used[i], DEPTH, offset);
}

/* Draws the errors and their bound, and says what they are. Returns whether the RMS over the points
 * of error / bound is at most `most`. */
static bool test(plot *p, const char *colour, double jitter, double most) {
    double x[POINTS], error[POINTS], bound[POINTS], ratio[POINTS];
    char what[100];
    measure(jitter, error);
    bounds(jitter, bound);
    for (int i = 0; i < POINTS; i++) {
        x[i] = (used[i] - 1) * STEP / DEPTH;
        ratio[i] = error[i] / bound[i];
        plot_dot(p, colour, 4, x[i], error[i]);
        printf("jitter %.1f mm, B/D %.3f (%3d frames): %.4f mm, bound %.4f mm\n", jitter, x[i],
               used[i], error[i], bound[i]);
    }
    plot_curve(p, colour, "6 3", POINTS, x, bound);
    snprintf(what, sizeof what, "jitter %.1f mm: error of depth over its bound", jitter);
    return report(what, rms(ratio, POINTS), "", "-", most);
}

int main(void) {
    FILE *f = plot_open("baseline", 640, 460);
    plot p = plot_panel(f, 65, 40, 550, 360, "error of depth against the baseline",
                        (plot_axis){"baseline / depth", 0.03, 1, true},
                        (plot_axis){"RMS error of depth / mm", 0.001, 50, true});
    bool good = test(&p, PLOT_RED, JITTER, 2);
    good &= test(&p, PLOT_BLUE, 0, 2);
    plot_legend(&p, false, PLOT_RED, NULL, "measured, poses off by 0.2 mm");
    plot_legend(&p, false, PLOT_RED, "6 3", "its Cramér-Rao bound");
    plot_legend(&p, false, PLOT_BLUE, NULL, "measured, perfect poses");
    plot_legend(&p, false, PLOT_BLUE, "6 3", "its Cramér-Rao bound");
    plot_end(&p);
    plot_close(f);
    return good ? 0 : 1;
}
