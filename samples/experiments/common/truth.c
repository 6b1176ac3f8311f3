/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * truth.c: what was measured beside the truth.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "plot.h"
#include "scan.h"

/* ---- lines and edges ------------------------------------------------------------------------ */

truth truth_of(const scene *s) {
    truth t = {0};
    for (int i = 0; i < s->n; i++)
        for (int k = 0; k < 4; k++) {
            edge *e = &t.edge[t.n++];
            memcpy(e->p, s->plate[i].corner[k], sizeof e->p);
            memcpy(e->q, s->plate[i].corner[(k + 1) % 4], sizeof e->q);
            e->observable = true;
        }
    return t;
}

/* The unit vector from p to q; returns their distance. */
static double direction(const double p[3], const double q[3], double u[3]) {
    for (int k = 0; k < 3; k++)
        u[k] = q[k] - p[k];
    return arris_unit(u);
}

/* Where the line's ends lie along the edge, mm from its p; u and *length are the edge's. */
static void place(const edge *e, const arris_line *l, double u[3], double *length, double at[2]) {
    *length = direction(e->p, e->q, u);
    at[0] = arris_dot(l->p, u) - arris_dot(e->p, u);
    at[1] = arris_dot(l->q, u) - arris_dot(e->p, u);
}

/* The stretch that both have, mm along the edge; empty when to < from. */
static void common_stretch(const double at[2], double length, double *from, double *to) {
    *from = fmax(0, fmin(at[0], at[1]));
    *to = fmin(length, fmax(at[0], at[1]));
}

double edge_distance(const edge *e, const arris_line *l) {
    double u[3], length, at[2], from, to, sum = 0;
    place(e, l, u, &length, at);
    common_stretch(at, length, &from, &to);
    for (int i = 0; i < 3; i++) {
        double d[3], t = from + (to - from) * i / 2, w = (t - at[0]) / (at[1] - at[0]);
        for (int k = 0; k < 3; k++)
            d[k] = (1 - w) * l->p[k] + w * l->q[k] - e->p[k] - t * u[k];
        sum += arris_dot(d, d);
    }
    return sqrt(sum / 3);
}

/* Whether the two are parallel to 8 degrees and at least half of the line lies beside the edge. */
static bool beside(const edge *e, const arris_line *l) {
    double u[3], v[3], length, at[2], from, to;
    direction(l->p, l->q, v);
    place(e, l, u, &length, at);
    common_stretch(at, length, &from, &to);
    return fabs(arris_dot(u, v)) > cos(8 * M_PI / 180) && to - from > fabs(at[1] - at[0]) / 2;
}

int truth_match(const truth *t, const arris_line *l, double tau) {
    int best = -1;
    for (int i = 0; i < t->n; i++) {
        double d = beside(&t->edge[i], l) ? edge_distance(&t->edge[i], l) : INFINITY;
        if (d < tau) {
            tau = d;
            best = i;
        }
    }
    return best;
}

score scan_score(const scan *s, const truth *t, double tau) {
    score r = {0};
    bool found[EDGES] = {0};
    int n = 0;
    for (int i = 0; i < s->n; i++) {
        if (s->line[i].state != ARRIS_MEASURED)
            continue;
        int e = truth_match(t, &s->line[i], tau);
        r.lines++;
        r.wrong += e < 0;
        if (e < 0)
            continue;
        found[e] = true;
        if (!t->edge[e].observable)
            continue;
        double d = edge_distance(&t->edge[e], &s->line[i]);
        r.rms += d * d;
        n++;
    }
    r.rms = n > 0 ? sqrt(r.rms / n) : NAN;
    for (int i = 0; i < t->n; i++) {
        r.edges += t->edge[i].observable;
        r.found += t->edge[i].observable && found[i];
    }
    return r;
}

int depth_errors(const scan *s, const truth *t, double tau, int most, double *error) {
    int n = 0;
    for (int i = 0; i < s->n && n < most; i++) {
        const arris_line *l = &s->line[i];
        int k = l->state == ARRIS_MEASURED ? truth_match(t, l, tau) : -1;
        const edge *e = &t->edge[k < 0 ? 0 : k];
        if (k < 0 || fabs(e->q[1] - e->p[1]) < fabs(e->q[0] - e->p[0]))
            continue;
        double u[3], length, at[2];
        place(e, l, u, &length, at);
        error[n++] = (l->p[2] + l->q[2]) / 2 - e->p[2] - (at[0] + at[1]) / 2 * u[2];
    }
    return n;
}

/* Element (i, j) of the 6x6 covariance. */
static double cov_at(const arris_line *l, int i, int j) {
    int a = i < j ? i : j, b = i < j ? j : i;
    return l->cov[a * 6 - a * (a - 1) / 2 + b - a];
}

double middle_variance(const arris_line *l, const double u[3]) {
    double var = 0;
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++)
            var += u[i % 3] * u[j % 3] * cov_at(l, i, j) / 4;
    return var;
}

/* ---- telling -------------------------------------------------------------------------------- */

bool report(const char *what, double value, const char *unit, const char *thesis, double most) {
    bool good = value <= most;
    printf("%-52s %9.4g %-2s  thesis %-8s at most %-6g %s\n", what, value, unit, thesis, most,
           good ? "ok" : "FAILED");
    return good;
}

text_mm in_mm(double v) {
    text_mm t = {"none"};
    if (!isnan(v))
        snprintf(t.s, sizeof t.s, "%.3f mm", v);
    return t;
}

static int ascending(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

double median(double *v, int n) {
    qsort(v, (size_t)n, sizeof *v, ascending);
    return n ? (v[(n - 1) / 2] + v[n / 2]) / 2 : NAN;
}

double rms(const double *v, int n) {
    double sum = 0;
    for (int i = 0; i < n; i++)
        sum += v[i] * v[i];
    return sqrt(sum / n);
}

/* ---- views ---------------------------------------------------------------------------------- */

static void include(double low[3], double high[3], const double p[3]) {
    for (int k = 0; k < 3; k++) {
        low[k] = fmin(low[k], p[k]);
        high[k] = fmax(high[k], p[k]);
    }
}

static void draw_view(plot *p, const scan *s, const truth *t, int a, int b) {
    for (int i = 0; i < t->n; i++) {
        const edge *e = &t->edge[i];
        plot_segment(p, e->observable ? "#bbbbbb" : "#e0e0e0", 5, e->p[a], e->p[b], e->q[a],
                     e->q[b]);
        plot_dot(p, e->observable ? "#bbbbbb" : "#e0e0e0", 2.5, e->p[a], e->p[b]);
    }
    for (int i = 0; i < s->n; i++)
        if (s->line[i].state == ARRIS_MEASURED) {
            const arris_line *l = &s->line[i];
            plot_segment(p, PLOT_BLUE, 2, l->p[a], l->p[b], l->q[a], l->q[b]);
            plot_dot(p, PLOT_BLUE, 2, l->p[a], l->p[b]);
            plot_dot(p, PLOT_BLUE, 2, l->q[a], l->q[b]);
        }
    for (int i = 0; i < s->frames; i++)
        plot_dot(p, PLOT_RED, 1.2, s->pose[i].C[a], s->pose[i].C[b]);
}

void scan_draw(const scan *s, const truth *t, const char *figure) {
    static const char *const title[] = {"xy: as the camera looks", "yz: from the side",
                                        "zx: from above"};
    static const char *const label[] = {"x / mm", "y / mm", "z / mm"};
    static const int axes[3][2] = {{0, 1}, {2, 1}, {0, 2}};
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (int i = 0; i < t->n; i++)
        include(low, high, t->edge[i].p), include(low, high, t->edge[i].q);
    for (int i = 0; i < s->frames; i++)
        include(low, high, s->pose[i].C);
    FILE *f = plot_open(figure, 1140, 400);
    for (int v = 0; v < 3; v++) {
        int a = axes[v][0], b = axes[v][1];
        plot_axis x = {label[a], low[a] - 40, high[a] + 40, false};
        plot_axis y = {label[b], high[b] + 40, low[b] - 40, false};
        plot_equal(300, 300, &x, &y);
        plot p = plot_panel(f, 65 + 375 * v, 40, 300, 300, title[v], x, y);
        draw_view(&p, s, t, a, b);
        if (v == 1) {
            plot_legend(&p, true, "#bbbbbb", "", "true edges, pale: not to be found");
            plot_legend(&p, true, PLOT_BLUE, "", "measured lines");
            plot_legend(&p, true, PLOT_RED, NULL, "cameras");
        }
        plot_end(&p);
    }
    plot_close(f);
}
