/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * epipolar.c: the epipolar test (thesis, section 3.1): does a point of one picture lie on its
 * epipolar line in another, by the poses that the robot reported?
 *
 * The points are the ends of tracked segments, as in the thesis, and the crossings of two segments
 * that meet in a corner. Ends scatter along their segment, crossings do not: so the ends say what a
 * detector does, the crossings what poses, camera model and eq. 2.5 to 2.7 are worth. An exact scan
 * with rotation, and the box.
 */
#include <math.h>
#include <stdlib.h>

#include "../common/plot.h"
#include "../common/scan.h"

enum { APART = 12, MOST = 100000 }; /* frames between the two pictures; points */

/* A point of one frame: a crossing of the tracks a < b, or an end (b is -1 or -2) of track a. */
typedef struct point {
    int frame, a, b;
    double x, y;
} point;

typedef struct points {
    int n;
    point *item;
} points;

static void add(points *p, int frame, int a, int b, double x, double y) {
    if (p->n == MOST)
        die("too many points");
    p->item[p->n++] = (point){frame, a, b, x, y};
}

/* Ends at the picture's border are where the picture ends. */
static void add_end(points *p, const scan *s, const seen *g, int end) {
    double x = g->e[2 * end], y = g->e[2 * end + 1];
    if (x > 10 && y > 10 && x < s->camera.width - 11 && y < s->camera.height - 11)
        add(p, g->frame, g->track, -1 - end, x, y);
}

/* Whether an end of g is within 4 px of an end of h. */
static bool meet(const seen *g, const seen *h) {
    bool near = false;
    for (int i = 0; i < 4; i += 2)
        for (int j = 0; j < 4; j += 2)
            near |= hypot(g->e[i] - h->e[j], g->e[i + 1] - h->e[j + 1]) < 4;
    return near;
}

static void add_crossing(points *p, const seen *g, const seen *h) {
    double gx = g->e[2] - g->e[0], gy = g->e[3] - g->e[1];
    double hx = h->e[2] - h->e[0], hy = h->e[3] - h->e[1], cross = gx * hy - gy * hx;
    if (!meet(g, h) || fabs(cross) < 0.5 * hypot(gx, gy) * hypot(hx, hy))
        return;
    double t = ((h->e[0] - g->e[0]) * hy - (h->e[1] - g->e[1]) * hx) / cross;
    int a = g->track < h->track ? g->track : h->track;
    add(p, g->frame, a, g->track + h->track - a, g->e[0] + t * gx, g->e[1] + t * gy);
}

static points collect(const scan *s) {
    points p = {0, malloc(MOST * sizeof(point))};
    if (!p.item)
        die("out of memory");
    for (int i = 0; i < s->n_seen; i++) {
        const seen *g = &s->seen[i];
        if (g->track < 0)
            continue;
        add_end(&p, s, g, 0);
        add_end(&p, s, g, 1);
        for (int j = i + 1; j < s->n_seen && s->seen[j].frame == g->frame; j++)
            if (s->seen[j].track >= 0)
                add_crossing(&p, g, &s->seen[j]);
    }
    return p;
}

/* The epipolar line in picture `to` of a point of picture `from`: two pixels on it, those of the
 * points 300 and 3000 mm away. */
static void epipolar_line(const scan *s, const point *p, int to, double e[4]) {
    double d[3], X[3];
    const arris_pose *from = &s->pose[p->frame];
    arris_bearing(&s->camera, from, p->x, p->y, d);
    for (int i = 0; i < 2; i++) {
        for (int k = 0; k < 3; k++)
            X[k] = from->C[k] + (i ? 3000 : 300) * d[k];
        arris_project(&s->camera, &s->pose[to], X, &e[2 * i], &e[2 * i + 1]);
    }
}

static double distance(const double e[4], double x, double y) {
    double dx = e[2] - e[0], dy = e[3] - e[1];
    return fabs((x - e[0]) * dy - (y - e[1]) * dx) / hypot(dx, dy);
}

/* The same point APART frames later; NULL when it was not seen. */
static const point *later(const points *p, int i) {
    const point *a = &p->item[i];
    for (int j = i + 1; j < p->n && p->item[j].frame <= a->frame + APART; j++)
        if (p->item[j].frame == a->frame + APART && p->item[j].a == a->a && p->item[j].b == a->b)
            return &p->item[j];
    return NULL;
}

/* The distances of all pairs of ends, or of crossings; `d` holds p->n. Returns how many. */
static int distances(const scan *s, const points *p, bool crossings, double *d) {
    int n = 0;
    double e[4];
    for (int i = 0; i < p->n; i++) {
        const point *b = (p->item[i].b >= 0) == crossings ? later(p, i) : NULL;
        if (b) {
            epipolar_line(s, &p->item[i], b->frame, e);
            d[n++] = distance(e, b->x, b->y);
        }
    }
    return n;
}

/* ---- the figure ----------------------------------------------------------------------------- */

/* The picture in the scan's middle: its points, and the epipolar lines of the same points before.
 */
static void draw_picture(FILE *f, double left, const char *title, const scan *s, const points *p) {
    plot q = plot_panel(f, left, 40, 400, 300, title,
                        (plot_axis){"x / px", 0, s->camera.width - 1, false},
                        (plot_axis){"y / px", s->camera.height - 1, 0, false});
    for (int i = 0; i < p->n; i++) {
        double e[4];
        const point *b = p->item[i].frame == s->frames / 2 ? later(p, i) : NULL;
        if (!b)
            continue;
        epipolar_line(s, &p->item[i], b->frame, e);
        double u = (e[2] - e[0]) * 10, v = (e[3] - e[1]) * 10;
        plot_segment(&q, "#9ecae1", 0.8, e[0] - u, e[1] - v, e[2] + u, e[3] + v);
        plot_dot(&q, b->b < 0 ? PLOT_RED : PLOT_GREEN, 2.2, b->x, b->y);
    }
    plot_legend(&q, true, "#9ecae1", "", "epipolar lines");
    plot_legend(&q, true, PLOT_RED, NULL, "ends");
    plot_legend(&q, true, PLOT_GREEN, NULL, "crossings");
    plot_end(&q);
}

/* The distances of a scan's ends [0] and crossings [1], sorted. */
typedef struct outcome {
    int n[2];
    double *d[2];
} outcome;

/* The share of the points that are at most so far from their lines. */
static void draw_shares(plot *q, const outcome *o, const char *dash) {
    for (int kind = 0; kind < 2; kind++) {
        double *y = malloc((size_t)(o->n[kind] + 1) * sizeof *y);
        if (!y)
            die("out of memory");
        for (int i = 0; i < o->n[kind]; i++)
            y[i] = 100. * (i + 1) / o->n[kind];
        plot_curve(q, kind ? PLOT_GREEN : PLOT_RED, dash, o->n[kind], o->d[kind], y);
        free(y);
    }
}

static void draw_all(FILE *f, double left, outcome o[2]) {
    plot q = plot_panel(f, left, 40, 360, 300, "all pictures",
                        (plot_axis){"distance from the epipolar line / px", 1e-3, 10, true},
                        (plot_axis){"share of the points / %", 0, 100, false});
    draw_shares(&q, &o[0], "");
    draw_shares(&q, &o[1], "6 3");
    plot_legend(&q, true, PLOT_GREEN, "", "crossings, exact");
    plot_legend(&q, true, PLOT_GREEN, "6 3", "crossings, box");
    plot_legend(&q, true, PLOT_RED, "", "ends, exact");
    plot_legend(&q, true, PLOT_RED, "6 3", "ends, box");
    plot_end(&q);
}

/* ---- the test ------------------------------------------------------------------------------- */

/* Measures a scan and draws a picture of it; the arrays of *o are for free. `most`: px, the median
 * of the ends and of the crossings. */
static bool test(FILE *f, double left, outcome *o, const char *list, const char *name,
                 const double most[2]) {
    bool good = true;
    char title[100];
    scan s = scan_measure(list, "", "", "");
    points p = collect(&s);
    snprintf(title, sizeof title, "%s: one picture", name);
    draw_picture(f, left, title, &s, &p);
    for (int kind = 0; kind < 2; kind++) {
        double *d = o->d[kind] = malloc((size_t)(p.n + 1) * sizeof *d);
        if (!d)
            die("out of memory");
        int n = o->n[kind] = distances(&s, &p, kind, d);
        snprintf(title, sizeof title, "%s: median of %d %s from their lines", name, n,
                 kind ? "crossings" : "ends");
        good &= report(title, median(d, n), "px", "-", most[kind]);
    }
    free(p.item);
    scan_free(&s);
    return good;
}

int main(void) {
    outcome o[2];
    scene s = scene_new();
    motion turning = motion_along_x(60, 4.1);
    turning.turn = -0.0045;
    turning.step[1] = 1.2;
    scene_scatter(&s, 670, 1000, 3);
    char *exact = scene_render(&s, &turning, 1, "epipolar");
    FILE *f = plot_open("epipolar", 1400, 400);
    bool good = test(f, 55, &o[0], exact, "exact", (double[]){0.5, 0.03});
    good &= test(f, 535, &o[1], "samples/box/frames.csv", "box", (double[]){1, 0.5});
    draw_all(f, 1015, o);
    plot_close(f);
    for (int i = 0; i < 4; i++)
        free(o[i / 2].d[i % 2]);
    free(exact);
    return good ? 0 : 1;
}
