/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * scan.h: measures a recorded scan with the `arris` that was built, reads what came of it, and lays
 * it beside the truth. Whatever fails ends the program with 2 and a message.
 */
#ifndef SCAN_H
#define SCAN_H

#include <stdio.h>

#include "arris_geometry.h"
#include "scene.h"

/* ---- files ---------------------------------------------------------------------------------- */

_Noreturn void die(const char *format, ...) __attribute__((format(printf, 1, 2)));

/* A path in the folder of the build, which the environment's B names (build). For
 * free. */
char *in_build(const char *format, ...) __attribute__((format(printf, 1, 2)));

/* The folder experiments/NAME in the build, made when there is none. For free. */
char *make_folder(const char *name);

FILE *create(const char *format, ...) __attribute__((format(printf, 1, 2)));
void finish(FILE *f);

/* ---- what a scan measures ------------------------------------------------------------------- */

/* A segment of a picture, without the lens's distortion. */
typedef struct seen {
    int frame, track; /* track: -1, none */
    double e[4];      /* its ends, px */
} seen;

typedef struct scan {
    arris_camera camera; /* without distortion */
    int frames, n_seen, n;
    arris_pose *pose; /* as reported, of each frame */
    seen *seen;       /* by ascending frame */
    arris_line *line; /* id, state, p, q, cov */
} scan;

/* Measures the scan of a frames.csv, with camera.json beside it, by
 *     imagesrc ! edges ! undistort ! segments ! track ! reconstruct
 * `source`, `segments` and `reconstruct` are properties of those stages, or "". For scan_free. */
scan scan_measure(const char *list, const char *source, const char *segments,
                  const char *reconstruct);
void scan_free(scan *s);

/* ---- the truth ------------------------------------------------------------------------------ */

typedef struct edge {
    double p[3], q[3]; /* mm */
    bool observable;   /* false: it need not be found */
} edge;

enum { EDGES = 256 };
typedef struct truth {
    int n;
    edge edge[EDGES];
} truth;

/* The edges of all plates, all of them observable. */
truth truth_of(const scene *s);

/* Reads a truth.json. */
truth truth_load(const char *path);

/* RMS distance, mm, of a measured line from the true edge: at the ends and the middle of the
 * stretch that both have. The two must not be at right angles. */
double edge_distance(const edge *e, const arris_line *l);

/* The edge that the line lies on: parallel to 8 degrees, beside half of it, and nearest and nearer
 * than tau (mm) by edge_distance. -1: none. */
int truth_match(const truth *t, const arris_line *l, double tau);

/* What the measured lines of a scan are worth. */
typedef struct score {
    int edges, found; /* observable ones, and those of them on which a measured line lies */
    int lines, wrong; /* measured ones, and those that lie on no edge */
    double rms;       /* mm, over the lines on an observable one: of edge_distance; NAN: none */
} score;
score scan_score(const scan *s, const truth *t, double tau);

/* The errors in depth, mm, at the middle of the measured lines that lie on a true edge steeper than
 * 45 degrees in xy, within tau; at most `most`. Returns how many. */
int depth_errors(const scan *s, const truth *t, double tau, int most, double *error);

/* The variance of the line's middle along the unit vector u, mm². */
double middle_variance(const arris_line *l, const double u[3]);

/* ---- telling -------------------------------------------------------------------------------- */

/* Prints a figure beside the thesis's (a text; "-": none is known) and the most that it may be.
 * Returns whether it is at most that; NAN is not. */
bool report(const char *what, double value, const char *unit, const char *thesis, double most);

/* "0.123 mm", or "none" for NAN. */
typedef struct text_mm {
    char s[24];
} text_mm;
text_mm in_mm(double v);

/* The median of n values, which it sorts; NAN of none. */
double median(double *v, int n);
double rms(const double *v, int n);

/* The views xy, yz and zx of the truth and the measured lines, and where the cameras stood. */
void scan_draw(const scan *s, const truth *t, const char *figure);

#endif
