/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * projection.c: the projection test (thesis, section 3.2, eq. 3.1): the measured 3D lines are
 * projected into every picture by its reported pose, and laid beside the segments that were found
 * there: how far, across the line, are a segment's ends from it? An exact scan, and the box, whose
 * reported poses are off by some 0.3 mm.
 */
#include <math.h>
#include <stdlib.h>

#include "../common/plot.h"
#include "../common/scan.h"

#define BOX "samples/box/frames.csv"

static const double REACH = 3; /* px: a segment farther from a line is another's */

/* The ends of a line as picture `frame` shows them; false: behind the camera. */
static bool project(const scan *s, const arris_line *l, int frame, double e[4]) {
    const arris_pose *pose = &s->pose[frame];
    return pose->valid && arris_project(&s->camera, pose, l->p, &e[0], &e[1]) > 0 &&
           arris_project(&s->camera, pose, l->q, &e[2], &e[3]) > 0;
}

/* How far the segment's ends are from the projected line e (to the left of it), px, in d. Returns
 * whether it is a segment of that line: parallel to 3 degrees, its middle beside it, and near. */
static bool compare(const double e[4], const seen *g, double d[2]) {
    double ux = e[2] - e[0], uy = e[3] - e[1], n = hypot(ux, uy), along = 0;
    double gx = g->e[2] - g->e[0], gy = g->e[3] - g->e[1];
    for (int i = 0; i < 2; i++) {
        double x = g->e[2 * i] - e[0], y = g->e[2 * i + 1] - e[1];
        d[i] = (x * uy - y * ux) / n;
        along += (x * ux + y * uy) / (2 * n);
    }
    return fabs(gx * ux + gy * uy) > cos(3 * M_PI / 180) * n * hypot(gx, gy) && along > 0 &&
           along < n && fabs(d[0] + d[1]) / 2 < REACH;
}

/* The distances of both ends of the segment that is nearest to the line in its picture; false: none
 * is its own. `from` is where the frame's segments begin. */
static bool nearest(const scan *s, const arris_line *l, int frame, int from, double best[2]) {
    double e[4], d[2], least = INFINITY;
    if (!project(s, l, frame, e))
        return false;
    for (int i = from; i < s->n_seen && s->seen[i].frame == frame; i++)
        if (compare(e, &s->seen[i], d) && fabs(d[0] + d[1]) < least) {
            least = fabs(d[0] + d[1]);
            best[0] = d[0];
            best[1] = d[1];
        }
    return isfinite(least);
}

/* The distances of all lines in all pictures go to d, which holds `most`; the RMS of each picture,
 * NAN without any, to per_frame. Returns how many there are. */
static int distances(const scan *s, int most, double *d, double *per_frame) {
    int n = 0;
    for (int frame = 0, from = 0; frame < s->frames; frame++) {
        int begin = n;
        while (from < s->n_seen && s->seen[from].frame < frame)
            from++;
        for (int i = 0; i < s->n && n + 2 <= most; i++)
            if (s->line[i].state == ARRIS_MEASURED && nearest(s, &s->line[i], frame, from, d + n))
                n += 2;
        per_frame[frame] = n > begin ? rms(d + begin, n - begin) : NAN;
    }
    return n;
}

/* The scan's middle picture: its segments, and the lines that are projected into it. */
static void draw_picture(FILE *f, double left, const char *title, const scan *s) {
    double e[4];
    plot p = plot_panel(f, left, 40, 400, 300, title,
                        (plot_axis){"x / px", 0, s->camera.width - 1, false},
                        (plot_axis){"y / px", s->camera.height - 1, 0, false});
    for (int i = 0; i < s->n_seen; i++)
        if (s->seen[i].frame == s->frames / 2) {
            const double *g = s->seen[i].e;
            plot_segment(&p, "#bbbbbb", 5, g[0], g[1], g[2], g[3]);
        }
    for (int i = 0; i < s->n; i++)
        if (s->line[i].state == ARRIS_MEASURED && project(s, &s->line[i], s->frames / 2, e))
            plot_segment(&p, PLOT_BLUE, 1.2, e[0], e[1], e[2], e[3]);
    plot_legend(&p, true, "#bbbbbb", "", "segments of the picture");
    plot_legend(&p, true, PLOT_BLUE, "", "3D lines, projected");
    plot_end(&p);
}

/* ---- the test ------------------------------------------------------------------------------- */

enum { FRAMES = 1000, MOST = 100000 };

typedef struct outcome {
    int frames;
    double per_frame[FRAMES]; /* px */
} outcome;

/* Measures the scan; returns the RMS of all distances, px. `picture`: where to draw one, or 0. */
static double test(FILE *f, double picture, outcome *o, const char *list, const char *title,
                   const char *segments) {
    static double d[MOST];
    scan s = scan_measure(list, "", segments, "");
    if (s.frames > FRAMES)
        die("too many frames");
    int n = distances(&s, MOST, d, o->per_frame);
    o->frames = s.frames;
    if (picture > 0)
        draw_picture(f, picture, title, &s);
    scan_free(&s);
    return rms(d, n);
}

static void draw_frames(FILE *f, double left, const outcome *exact, const outcome *box) {
    static double x[FRAMES];
    plot p =
        plot_panel(f, left, 40, 400, 300, "all pictures", (plot_axis){"picture", 0, 135, false},
                   (plot_axis){"RMS distance / px", 1e-3, 3, true});
    for (int i = 0; i < FRAMES; i++)
        x[i] = i;
    plot_curve(&p, PLOT_RED, "", box->frames, x, box->per_frame);
    plot_curve(&p, PLOT_BLUE, "", exact->frames, x, exact->per_frame);
    plot_legend(&p, true, PLOT_RED, "", "box");
    plot_legend(&p, true, PLOT_BLUE, "", "exact");
    plot_end(&p);
}

int main(void) {
    static outcome exact, box, thesis;
    scene s = scene_new();
    motion m = motion_along_x(135, 4.1);
    scene_scatter(&s, 670, 1000, 3);
    char *list = scene_render(&s, &m, 1, "projection");
    FILE *f = plot_open("projection", 1420, 400);
    double e = test(f, 55, &exact, list, "exact: the middle picture", "");
    double b = test(f, 525, &box, BOX, "box: the middle picture", "");
    printf("with the thesis's segments: exact %.3f px, box %.3f px\n",
           test(f, 0, &thesis, list, "", "mode=thesis"),
           test(f, 0, &thesis, BOX, "", "mode=thesis"));
    bool good = report("exact: RMS of the segments' ends from the lines", e, "px", "-", 0.05);
    good &= report("box: RMS of the segments' ends from the lines", b, "px", "-", 0.4);
    draw_frames(f, 995, &exact, &box);
    plot_close(f);
    free(list);
    return good ? 0 : 1;
}
