/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * translation.c: the translation between two pictures in pixels and in millimetres (thesis, section
 * 3.5: 1.44 px and 4.1 mm). A line at depth Z moves by f t / Z when the camera moves by t. So the
 * steps of the tracked lines in the pictures, and their depth as it was reconstructed, give the
 * camera's step back, which the robot states.
 *
 * By f t / Z the thesis's two numbers belong to a depth of 1084 mm: the exact scan has its plates
 * there and, for the curve, at other depths.
 */
#include <math.h>
#include <stdlib.h>

#include "../common/plot.h"
#include "../common/scan.h"

static const double STEP = 4.1, THESIS_PX = 1.44; /* mm, px */

/* Where a segment's line crosses row y. */
static double x_at(const seen *g, double y) {
    return g->e[0] + (y - g->e[1]) * (g->e[2] - g->e[0]) / (g->e[3] - g->e[1]);
}

/* The mean of a steep track's steps along x between successive pictures, px; NAN when there are
 * fewer than 20. Not the median: a robot that sticks and slips makes many short steps and few long
 * ones. */
static double step_of(const scan *s, int track) {
    const seen *last = NULL;
    double sum = 0;
    int n = 0;
    for (int i = 0; i < s->n_seen; i++) {
        const seen *g = &s->seen[i];
        if (g->track != track || fabs(g->e[3] - g->e[1]) < 2 * fabs(g->e[2] - g->e[0]))
            continue;
        double y = (g->e[1] + g->e[3]) / 2;
        if (last && last->frame == g->frame - 1) {
            sum += x_at(last, y) - x_at(g, y);
            n++;
        }
        last = g;
    }
    return n < 20 ? NAN : sum / n;
}

/* Whether the line's middle appears at x in that picture as the track's segment does: a line and
 * its track need not have the same number. */
static bool is_of(const scan *s, const arris_line *l, const seen *g) {
    double M[3], x, y;
    for (int k = 0; k < 3; k++)
        M[k] = (l->p[k] + l->q[k]) / 2;
    return arris_project(&s->camera, &s->pose[g->frame], M, &x, &y) > 0 &&
           y > fmin(g->e[1], g->e[3]) && y < fmax(g->e[1], g->e[3]) && fabs(x_at(g, y) - x) < 1;
}

/* Measured, and nearly of one depth. */
static bool is_level(const arris_line *l) {
    return l->state == ARRIS_MEASURED && fabs(l->q[2] - l->p[2]) < 0.1 * fabs(l->q[1] - l->p[1]);
}

/* The depth of the level line that the track became, mm; NAN: none. */
static double depth_of(const scan *s, int track) {
    for (int i = 0; i < s->n_seen; i++)
        for (int k = 0; s->seen[i].track == track && k < s->n; k++)
            if (is_level(&s->line[k]) && is_of(s, &s->line[k], &s->seen[i]))
                return (s->line[k].p[2] + s->line[k].q[2]) / 2;
    return NAN;
}

static int tracks_of(const scan *s) {
    int most = -1;
    for (int i = 0; i < s->n_seen; i++)
        most = s->seen[i].track > most ? s->seen[i].track : most;
    return most + 1;
}

/* The step of every steep track with its depth, drawn and collected: px, and as mm. Returns how
 * many. */
static int steps(const scan *s, plot *p, const char *colour, double *px, double *mm) {
    int n = 0;
    for (int t = 0; t < tracks_of(s) && n < 1000; t++) {
        double d = step_of(s, t), z = depth_of(s, t);
        if (!isfinite(d) || !isfinite(z))
            continue;
        plot_ring(p, colour, 4, z, d);
        px[n] = d;
        mm[n++] = d * z / s->camera.fx;
    }
    return n;
}

static char *render(double near, double far, const char *name) {
    scene s = scene_new();
    motion m = motion_along_x(60, STEP);
    scene_scatter(&s, near, far, 5);
    return scene_render(&s, &m, 1, name);
}

/* Measures a scan and says what its steps are, and how far the camera's is off. */
static bool test(plot *p, const char *list, const char *name, const char *colour, double most,
                 double *px_median) {
    double px[1000], mm[1000];
    char what[100];
    scan s = scan_measure(list, "", "", "");
    int n = steps(&s, p, colour, px, mm);
    double step = median(mm, n);
    *px_median = median(px, n);
    printf("%s: %d lines, %.3f px are %.4f mm; the robot says %.1f mm\n", name, n, *px_median, step,
           STEP);
    snprintf(what, sizeof what, "%s: the step is off by", name);
    scan_free(&s);
    return report(what, fabs(step - STEP), "mm", "4.1 mm", most);
}

int main(void) {
    const scene s = scene_new();
    double px, other, z[200], d[200], at = s.camera.fx * STEP / THESIS_PX;
    char *thesis = render(at, at, "translation"), *deep = render(650, 1150, "translation-depths");
    FILE *f = plot_open("translation", 640, 440);
    plot p = plot_panel(f, 65, 40, 550, 340, "a step of 4.1 mm in the pictures",
                        (plot_axis){"depth of the line / mm", 600, 1200, false},
                        (plot_axis){"step / px", 1, 3, false});
    for (int i = 0; i < 200; i++) {
        z[i] = 600 + 3 * i;
        d[i] = s.camera.fx * STEP / z[i];
    }
    plot_curve(&p, PLOT_GREY, "", 200, z, d);
    bool good = test(&p, thesis, "exact, the thesis's depth", PLOT_BLUE, 0.005, &px);
    good &= report("exact: its step differs from the thesis's by", fabs(px - THESIS_PX), "px",
                   "1.44 px", 0.005);
    good &= test(&p, deep, "exact, all depths", PLOT_BLUE, 0.005, &other);
    good &= test(&p, "samples/box/frames.csv", "box", PLOT_RED, 0.05, &other);
    plot_ring(&p, PLOT_BLACK, 8, at, THESIS_PX);
    plot_legend(&p, false, PLOT_GREY, "", "f t / Z");
    plot_legend(&p, false, PLOT_BLUE, NULL, "lines of exact scans");
    plot_legend(&p, false, PLOT_RED, NULL, "lines of the box");
    plot_legend(&p, false, PLOT_BLACK, NULL, "thesis: 1.44 px, 4.1 mm");
    plot_end(&p);
    plot_close(f);
    free(thesis);
    free(deep);
    return good ? 0 : 1;
}
