/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * plot.c: figures as SVG.
 */
#include "plot.h"

#include <math.h>
#include <stdlib.h>

#include "scan.h"

FILE *plot_open(const char *name, int width, int height) {
    char *path = in_build("experiments/%s.svg", name);
    FILE *f = fopen(path, "w");
    if (!f)
        die("cannot write %s", path);
    fprintf(f,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%d\" height=\"%d\" "
            "viewBox=\"0 0 %d %d\" font-family=\"sans-serif\" font-size=\"12\">\n"
            "<rect width=\"100%%\" height=\"100%%\" fill=\"white\"/>\n",
            width, height, width, height);
    printf("figure: %s\n", path);
    free(path);
    return f;
}

void plot_close(FILE *f) {
    fprintf(f, "</svg>\n");
    if (ferror(f) | fclose(f))
        die("the figure could not be written");
}

/* ---- axes ----------------------------------------------------------------------------------- */

/* The share of the axis at which v lies: 0 at low, 1 at high. */
static double share(const plot_axis *a, double v) {
    return a->log ? log(v / a->low) / log(a->high / a->low) : (v - a->low) / (a->high - a->low);
}

static double px(const plot *p, double x) {
    return p->left + p->width * share(&p->x, x);
}

static double py(const plot *p, double y) {
    return p->top + p->height * (1 - share(&p->y, y));
}

static void tick_x(const plot *p, double v) {
    fprintf(p->file,
            "<path stroke=\"#e4e4e4\" d=\"M%.1f %.1fv%.1f\"/>"
            "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">%g</text>\n",
            px(p, v), p->top, p->height, px(p, v), p->top + p->height + 16, v);
}

static void tick_y(const plot *p, double v) {
    fprintf(p->file,
            "<path stroke=\"#e4e4e4\" d=\"M%.1f %.1fh%.1f\"/>"
            "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\">%g</text>\n",
            p->left, py(p, v), p->width, p->left - 6, py(p, v) + 4, v);
}

/* 1, 2 or 5 times a power of ten. */
static double round_step(double v) {
    double power = pow(10, floor(log10(v))), m = v / power;
    return power * (m < 1.5 ? 1 : m < 3.5 ? 2 : m < 7.5 ? 5 : 10);
}

static void linear_ticks(const plot *p, const plot_axis *a, void (*tick)(const plot *, double)) {
    double low = fmin(a->low, a->high), high = fmax(a->low, a->high);
    double step = round_step((high - low) / 6);
    for (double i = ceil(low / step - 1e-9); i <= high / step + 1e-9; i++)
        tick(p, i == 0 ? 0 : i * step);
}

/* The powers of ten, and over less than three of them 2 and 5 of each too. */
static void log_ticks(const plot *p, const plot_axis *a, void (*tick)(const plot *, double)) {
    static const double m[] = {1, 2, 5};
    int kinds = log10(a->high / a->low) < 3 ? 3 : 1;
    for (double e = floor(log10(a->low)); e <= ceil(log10(a->high)); e++)
        for (int k = 0; k < kinds; k++) {
            double v = m[k] * pow(10, e);
            if (v >= a->low * (1 - 1e-9) && v <= a->high * (1 + 1e-9))
                tick(p, v);
        }
}

static void ticks(const plot *p, const plot_axis *a, void (*tick)(const plot *, double)) {
    (a->log ? log_ticks : linear_ticks)(p, a, tick);
}

plot plot_panel(FILE *f, double left, double top, double width, double height, const char *title,
                plot_axis x, plot_axis y) {
    plot p = {f, left, top, width, height, x, y, 0};
    double middle = left + width / 2;
    ticks(&p, &x, tick_x);
    ticks(&p, &y, tick_y);
    fprintf(f,
            "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"none\" "
            "stroke=\"black\"/>\n<g text-anchor=\"middle\">"
            "<text x=\"%.1f\" y=\"%.1f\" font-weight=\"bold\">%s</text>"
            "<text x=\"%.1f\" y=\"%.1f\">%s</text>"
            "<text transform=\"translate(%.1f %.1f) rotate(-90)\">%s</text></g>\n",
            left, top, width, height, middle, top - 10, title, middle, top + height + 34, x.label,
            left - 44, top + height / 2, y.label);
    fprintf(f,
            "<svg x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" "
            "viewBox=\"%.1f %.1f %.1f %.1f\">\n",
            left, top, width, height, left, top, width, height);
    return p;
}

void plot_end(plot *p) {
    fprintf(p->file, "</svg>\n");
}

void plot_equal(double width, double height, plot_axis *x, plot_axis *y) {
    double sx = fabs(x->high - x->low) / width, sy = fabs(y->high - y->low) / height;
    plot_axis *a = sx < sy ? x : y; /* the one that is widened */
    double more = sx < sy ? sy / sx : sx / sy;
    double middle = (a->low + a->high) / 2, half = (a->high - a->low) / 2 * more;
    a->low = middle - half;
    a->high = middle + half;
}

/* ---- drawing -------------------------------------------------------------------------------- */

void plot_curve(plot *p, const char *colour, const char *dash, int n, const double *x,
                const double *y) {
    fprintf(p->file,
            "<polyline fill=\"none\" stroke=\"%s\" stroke-width=\"1.5\" stroke-dasharray=\"%s\" "
            "points=\"",
            colour, dash);
    for (int i = 0; i < n; i++) {
        double u = px(p, x[i]), v = py(p, y[i]);
        if (isfinite(u) && isfinite(v))
            fprintf(p->file, "%.2f,%.2f ", u, v);
    }
    fprintf(p->file, "\"/>\n");
}

void plot_segment(plot *p, const char *colour, double width, double x1, double y1, double x2,
                  double y2) {
    fprintf(p->file, "<path stroke=\"%s\" stroke-width=\"%g\" d=\"M%.2f %.2fL%.2f %.2f\"/>\n",
            colour, width, px(p, x1), py(p, y1), px(p, x2), py(p, y2));
}

void plot_dot(plot *p, const char *colour, double radius, double x, double y) {
    fprintf(p->file, "<circle fill=\"%s\" cx=\"%.2f\" cy=\"%.2f\" r=\"%g\"/>\n", colour, px(p, x),
            py(p, y), radius);
}

void plot_ring(plot *p, const char *colour, double radius, double x, double y) {
    fprintf(p->file, "<circle fill=\"none\" stroke=\"%s\" cx=\"%.2f\" cy=\"%.2f\" r=\"%g\"/>\n",
            colour, px(p, x), py(p, y), radius);
}

void plot_legend(plot *p, bool left, const char *colour, const char *dash, const char *text) {
    double y = p->top + 18 + 17 * p->entries++;
    double x = left ? p->left + 12 : p->left + p->width - 12, mark = left ? x : x - 26;
    if (dash)
        fprintf(p->file,
                "<path stroke=\"%s\" stroke-width=\"1.5\" stroke-dasharray=\"%s\" "
                "d=\"M%.1f %.1fh26\"/>",
                colour, dash, mark, y - 4);
    else
        fprintf(p->file, "<circle fill=\"%s\" cx=\"%.1f\" cy=\"%.1f\" r=\"3\"/>", colour, mark + 13,
                y - 4);
    fprintf(p->file,
            "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\" stroke=\"white\" stroke-width=\"3\" "
            "paint-order=\"stroke\">%s</text>\n",
            left ? x + 34 : x - 34, y, left ? "start" : "end", text);
}
