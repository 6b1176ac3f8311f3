/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * plot.h: figures as SVG: panels with axes, curves, points and segments.
 */
#ifndef PLOT_H
#define PLOT_H

#include <stdbool.h>
#include <stdio.h>

typedef struct plot_axis {
    const char *label;
    double low, high; /* low > high: it grows to the left, or downwards */
    bool log;
} plot_axis;

/* A panel: where it lies in the figure, px, and its axes. */
typedef struct plot {
    FILE *file;
    double left, top, width, height;
    plot_axis x, y;
    int entries; /* of its legend */
} plot;

/* Colours that differ for the colour-blind too (Okabe and Ito, 2008). */
#define PLOT_BLUE "#0072b2"
#define PLOT_RED "#d55e00"
#define PLOT_GREEN "#009e73"
#define PLOT_GREY "#999999"
#define PLOT_BLACK "#000000"

/* Opens $B/experiments/NAME.svg (B: build), of `width` by `height` px. Ends the program when it
 * can't. */
FILE *plot_open(const char *name, int width, int height);
void plot_close(FILE *f);

/* Draws a panel's frame, ticks, grid and labels; all later drawing is clipped to it. */
plot plot_panel(FILE *f, double left, double top, double width, double height, const char *title,
                plot_axis x, plot_axis y);
void plot_end(plot *p);

/* Both axes with the same scale, so that [low, high] of each is inside. */
void plot_equal(double width, double height, plot_axis *x, plot_axis *y);

/* `dash` as SVG's stroke-dasharray, "" for a full line. What isn't finite is left out. */
void plot_curve(plot *p, const char *colour, const char *dash, int n, const double *x,
                const double *y);
void plot_segment(plot *p, const char *colour, double width, double x1, double y1, double x2,
                  double y2);
void plot_dot(plot *p, const char *colour, double radius, double x, double y);
void plot_ring(plot *p, const char *colour, double radius, double x, double y);

/* An entry of the legend, in the upper right corner or, with `left`, the upper left one; `dash` as
 * above, or NULL for a dot. */
void plot_legend(plot *p, bool left, const char *colour, const char *dash, const char *text);

#endif
