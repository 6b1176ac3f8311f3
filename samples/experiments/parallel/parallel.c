/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * parallel.c: edges parallel to the motion and nearly so (thesis, section 3.8). The planes through
 * such an edge and the camera's positions are all one, so its depth cannot be seen: it is to be
 * refused, not to be wrong. Exact edges at chosen angles from the motion, perfect poses: which are
 * measured, how far they are off, and what they say of themselves.
 */
#include <math.h>
#include <stdlib.h>

#include "../common/plot.h"
#include "../common/scan.h"

enum { FRAMES = 61, SEEDS = 3, PLATES = 3, MOST = 1000 };
static const double angles[] = {0, 0.1, 0.25, 0.5, 1, 2, 3, 5, 7, 10, 20, 45}; /* degrees */
enum { ANGLES = sizeof angles / sizeof *angles };
static const double DEPTH = 800, STEP = 4.1, HALF = 72;        /* mm: HALF the length of an edge */
static const double SOONEST = 0.5, SURE = 10, LEFT_END = 0.05; /* degrees */

/* What became of an edge. */
typedef struct outcome {
    double angle;        /* from the motion, degrees */
    double error, sigma; /* of its depth in the middle, mm; NAN when it is not measured */
} outcome;

static scene scene_of(int first) {
    scene s = scene_new();
    for (int i = 0; i < PLATES; i++)
        scene_add(&s, 0, (i - 1) * 0.2 * DEPTH, DEPTH, HALF, 45, angles[first + i] * M_PI / 180,
                  s.ground + 105);
    return s;
}

/* A line's ends as the scan's middle picture shows them, px, in the place of mm: there a line lies
 * on its edge whatever its depth. */
static void flatten(const scan *s, const double p[3], const double q[3], double a[3], double b[3]) {
    const arris_pose *pose = &s->pose[s->frames / 2];
    if (arris_project(&s->camera, pose, p, &a[0], &a[1]) <= 0 ||
        arris_project(&s->camera, pose, q, &b[0], &b[1]) <= 0)
        a[0] = a[1] = b[0] = b[1] = -1e6;
    a[2] = b[2] = 0;
}

/* Adds an outcome for each line on a long side of a plate. Returns how many `o` has then. */
static int collect(const scan *s, const scene *c, int first, int n, outcome *o) {
    static const double depth[3] = {0, 0, 1};
    truth flat = truth_of(c);
    for (int i = 0; i < flat.n; i++)
        flatten(s, flat.edge[i].p, flat.edge[i].q, flat.edge[i].p, flat.edge[i].q);
    for (int i = 0; i < s->n && n < MOST; i++) {
        arris_line l = s->line[i], *was = &s->line[i];
        bool measured = l.state == ARRIS_MEASURED;
        flatten(s, was->p, was->q, l.p, l.q);
        int e = truth_match(&flat, &l, 3);
        if (e >= 0 && e % 2 == 0)
            o[n++] = (outcome){angles[first + e / 4],
                               measured ? fabs((was->p[2] + was->q[2]) / 2 - DEPTH) : NAN,
                               measured ? sqrt(middle_variance(was, depth)) : NAN};
    }
    return n;
}

static int measure(outcome *o) {
    int n = 0;
    motion m = motion_along_x(FRAMES, STEP);
    for (int first = 0; first < ANGLES; first += PLATES) {
        scene c = scene_of(first);
        for (uint64_t seed = 1; seed <= SEEDS; seed++) {
            char *list = scene_render(&c, &m, seed, "parallel");
            scan s = scan_measure(list, "", "", "");
            n = collect(&s, &c, first, n, o);
            scan_free(&s);
            free(list);
        }
    }
    return n;
}

/* How many edges of angles from `low` to `high` are measured, or are not. */
static int count(const outcome *o, int n, double low, double high, bool measured) {
    int k = 0;
    for (int i = 0; i < n; i++)
        k += o[i].angle >= low && o[i].angle <= high && isfinite(o[i].error) == measured;
    return k;
}

/* The worst error over its stated sigma. */
static double worst(const outcome *o, int n) {
    double most = 0;
    for (int i = 0; i < n; i++)
        if (isfinite(o[i].error))
            most = fmax(most, o[i].error / o[i].sigma);
    return most;
}

/* ---- the figure ----------------------------------------------------------------------------- */

/* Where an angle is drawn: 0 at the axis's left end. */
static double place(double angle) {
    return fmax(angle, LEFT_END);
}

/* The bound: of an edge turned by that angle only sin(angle) of a step moves it across itself. */
static void draw_bound(plot *p) {
    double x[80], y[80];
    const scene s = scene_new();
    motion m = motion_along_x(FRAMES, STEP);
    double offset = bound_offset(&s, 105, 2 * HALF * s.camera.fx / DEPTH);
    for (int i = 0; i < 80; i++) {
        x[i] = 0.1 * pow(900, i / 79.);
        y[i] = bound_depth(&s, &m, FRAMES, DEPTH, offset / sin(x[i] * M_PI / 180));
    }
    plot_curve(p, PLOT_BLUE, "6 3", 80, x, y);
}

static void draw(const outcome *o, int n) {
    FILE *f = plot_open("parallel", 680, 460);
    plot p =
        plot_panel(f, 65, 40, 590, 360, "edges nearly parallel to the motion",
                   (plot_axis){"angle from the motion / degrees (0: at the left)", 0.04, 90, true},
                   (plot_axis){"error of depth / mm", 1e-3, 100, true});
    draw_bound(&p);
    for (int i = 0; i < n; i++) {
        double x = place(o[i].angle) * (1 + 0.02 * (i % 5 - 2));
        if (isfinite(o[i].error)) {
            plot_dot(&p, PLOT_BLUE, 3, x, fmax(o[i].error, 1.1e-3));
            plot_ring(&p, PLOT_GREEN, 4, x, o[i].sigma);
        } else
            plot_dot(&p, PLOT_RED, 3, x, 30);
    }
    plot_legend(&p, false, PLOT_RED, NULL, "refused: unobservable or weak");
    plot_legend(&p, false, PLOT_BLUE, NULL, "measured: its error");
    plot_legend(&p, false, PLOT_GREEN, NULL, "and its stated sigma");
    plot_legend(&p, false, PLOT_BLUE, "6 3", "Cramér-Rao bound");
    plot_end(&p);
    plot_close(f);
}

int main(void) {
    static outcome o[MOST];
    int n = measure(o);
    for (int i = 0; i < ANGLES; i++)
        printf("%5.2f degrees: %d measured, %d refused\n", angles[i],
               count(o, n, angles[i], angles[i], true), count(o, n, angles[i], angles[i], false));
    draw(o, n);
    int sure = 0;
    for (int i = 0; i < ANGLES; i++)
        sure += angles[i] >= SURE ? 2 * SEEDS : 0;
    bool good = report("measured within 0.5 degrees of the motion", count(o, n, 0, SOONEST, true),
                       "", "-", 0);
    good &=
        report("not measured from 10 degrees on", sure - count(o, n, SURE, 90, true), "", "-", 0);
    good &= report("the worst error over its stated sigma", worst(o, n), "", "-", 5);
    return good ? 0 : 1;
}
