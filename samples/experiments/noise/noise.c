/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * noise.c: the error of depth against the noise of the pictures (thesis, section 3.9), beside the
 * Cramér-Rao bound, and that of the same chain with the thesis's segments (raw end points).
 */
#include <math.h>
#include <stdlib.h>

#include "../common/plot.h"
#include "../common/scan.h"

enum { FRAMES = 61, SCANS = 6, LINES = 6 * SCANS };
static const double noise[] = {0.5, 1, 2, 4, 8, 16}; /* grey levels */
enum { POINTS = sizeof noise / sizeof *noise };
static const double DEPTH = 800, STEP = 4.1; /* mm */

static const char *const segments[] = {"", "mode=thesis"};
static double error[2][POINTS]; /* RMS, mm, with those segments */

static void measure(int i) {
    double e[2][LINES];
    int n[2] = {0};
    for (int seed = 1; seed <= SCANS; seed++) {
        scene s = scene_new();
        motion m = motion_along_x(FRAMES, STEP);
        s.noise = noise[i];
        scene_column(&s, DEPTH, (uint64_t)seed);
        truth t = truth_of(&s);
        char *list = scene_render(&s, &m, (uint64_t)seed, "noise");
        for (int k = 0; k < 2; k++) {
            scan r = scan_measure(list, "", segments[k], "limit=1000");
            n[k] += depth_errors(&r, &t, 50, LINES - n[k], e[k] + n[k]);
            scan_free(&r);
        }
        free(list);
    }
    for (int k = 0; k < 2; k++)
        error[k][i] = n[k] < LINES * 2 / 3 ? NAN : rms(e[k], n[k]);
}

static double bound_at(double sigma) {
    scene s = scene_new();
    motion m = motion_along_x(FRAMES, STEP);
    s.noise = sigma;
    double offset = bound_offset(&s, 105, SCENE_COLUMN_LENGTH * s.camera.fx);
    return bound_depth(&s, &m, FRAMES, DEPTH, offset);
}

int main(void) {
    double x[60], bound[60], ratio[POINTS];
    FILE *f = plot_open("noise", 640, 460);
    plot p = plot_panel(f, 65, 40, 550, 360, "error of depth against the noise",
                        (plot_axis){"noise of a pixel / grey levels", 0.3, 30, true},
                        (plot_axis){"RMS error of depth / mm", 0.001, 100, true});
    for (int i = 0; i < 60; i++) {
        x[i] = 0.3 * pow(100, i / 59.);
        bound[i] = bound_at(x[i]);
    }
    plot_curve(&p, PLOT_BLUE, "6 3", 60, x, bound);
    for (int i = 0; i < POINTS; i++) {
        measure(i);
        ratio[i] = error[0][i] / bound_at(noise[i]);
        printf("noise %4.1f: %.4f mm, bound %.4f mm; with the thesis's segments %s\n", noise[i],
               error[0][i], bound_at(noise[i]), in_mm(error[1][i]).s);
        plot_dot(&p, PLOT_BLUE, 4, noise[i], error[0][i]);
        plot_dot(&p, PLOT_RED, 4, noise[i], error[1][i]);
    }
    plot_legend(&p, true, PLOT_RED, NULL, "with the thesis's segments");
    plot_legend(&p, true, PLOT_BLUE, NULL, "measured");
    plot_legend(&p, true, PLOT_BLUE, "6 3", "Cramér-Rao bound");
    plot_end(&p);
    plot_close(f);
    return report("error of depth over its bound", rms(ratio, POINTS), "", "-", 2) ? 0 : 1;
}
