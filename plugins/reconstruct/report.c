/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * report.c: what is told of a line: its ends, their covariance, its state.
 */
#include <math.h>

#include "line.h"

static const double END = 1.5;     /* px: end points scatter by 0.6 to 2.3 px along the line */
static const double GRAZING = 25;  /* a line looked along at 2.3° is foreshortened by so much; */
static const double NARROW = 8;    /* at 7°, and what is beside it is too narrow to be resolved */
static const double STRAY = 0.5;   /* px, rms, by which no edge does */
static const double LIMIT = 0.003; /* of its distance */

/* The greatest sigma across the line, of the offsets i and i + 1. */
static double across(const mat4 *P, int i) {
    double mean = (P->m[i][i] + P->m[i + 1][i + 1]) / 2;
    double half = (P->m[i][i] - P->m[i + 1][i + 1]) / 2;
    return sqrt(mean + hypot(half, P->m[i][i + 1]));
}

/* Whether an end is foreshortened by more than `limit`. */
static bool along(const line *l, double limit) {
    double pixel = l->depth * sqrt(arris_dot(l->kept[0].step, l->kept[0].step));
    return l->pixel[0] > limit * pixel || l->pixel[1] > limit * pixel;
}

/* Whether the ends are where one can say that they are: not so when the line was looked along. */
static bool has_ends(const line *l, const arris_line *o) {
    double sum = 0;
    for (int i = 0; i < 3; i++)
        sum += o->p[i] + o->q[i];
    for (int i = 0; i < 21; i++)
        sum += o->cov[i];
    return isfinite(sum) && !along(l, GRAZING);
}

/* Whether the views are of no one edge: what slides, as an arc or a texture does, strays by more
 * than the poses explain. */
static bool strays(const line *l, const scene *s) {
    double pose = 2 * line_pose_px(l, s);
    return l->all.squares > (STRAY * STRAY + pose * pose) * 2 * l->all.n;
}

static enum arris_line_state state(const line *l, const scene *s, const mat4 *P, double limit) {
    double allowed = limit < 0 ? LIMIT * l->depth : limit;
    if (!l->settled || !line_observable(l))
        return ARRIS_UNOBSERVABLE;
    bool sure = across(P, 0) < allowed && across(P, 2) < allowed;
    return sure && !l->parted && !strays(l, s) && !along(l, NARROW) ? ARRIS_MEASURED : ARRIS_WEAK;
}

/* The covariance of (p, q): P across the line, END along it. */
static void spread(const line *l, const mat4 *P, const double u[3], double cov[21]) {
    const double *a = l->f.a, *b = l->f.b;
    for (int i = 0, n = 0; i < 6; i++) {
        int end = i / 3, k = i % 3;
        double row[4], along = END * l->pixel[end];
        for (int m = 0; m < 4; m++)
            row[m] = a[k] * P->m[2 * end][m] + b[k] * P->m[2 * end + 1][m];
        for (int j = i; j < 6; j++) {
            const double *at = row + j / 3 * 2;
            cov[n++] = at[0] * a[j % 3] + at[1] * b[j % 3] +
                       (end == j / 3 ? along * along * u[k] * u[j % 3] : 0);
        }
    }
}

bool line_report(const line *l, const scene *s, double limit, arris_line *out) {
    double u[3];
    /* a line that is not observable lies somewhere within its own distance */
    mat4 P = line_covariance(l, s, l->depth, l->ends);
    frame_point(&l->f, l->x, l->ends[0], out->p);
    frame_point(&l->f, l->x, l->ends[1], out->q);
    for (int i = 0; i < 3; i++)
        u[i] = out->q[i] - out->p[i];
    arris_unit(u);
    spread(l, &P, u, out->cov);
    out->state = state(l, s, &P, limit);
    out->views = l->settled ? l->all.n : l->all.n * l->stride; /* unsettled: of those kept */
    out->baseline = line_baseline(l);
    out->rms = l->all.n ? sqrt(l->all.squares / (2.0 * l->all.n)) : 0;
    return has_ends(l, out);
}
