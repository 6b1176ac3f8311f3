/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * drift.c: what the views of a line say against each other. An edge wanders slowly in the picture
 * as the view changes: by shading, by a neighbour that is not resolved; and where a face comes into
 * sight, another edge takes its place. That does not average out as noise does, and the variance of
 * single residuals does not tell. So the views are cut, in their order, into a few parts, whose
 * sums are compared with what their variances let expect (batch means; the middle of White's
 * sandwich of 1980, a cluster a part). The run of parts that leaves the least uncertainty is the
 * line.
 */
#include <math.h>
#include <string.h>

#include "line.h"

static const double PRIOR_DOF = 4; /* weight of the expected size against the parts' own */
static const double WORTH = 0.7;   /* a shorter run must bring the variance to this share */
static const double SUSPECT = 1.6; /* the excess over the expected at which a run is looked for */
enum { LEAST = 3 };                /* parts of a run */

/* All views that take part, by parts; how many parts there are. */
static uint32_t divide(const line *l, const scene *s, info part[LINE_PARTS]) {
    linear r;
    memcpy(part, l->past, sizeof l->past);
    for (uint32_t i = 0; i < l->n_kept; i++)
        if (l->inlier[i] && view_linearise(&l->kept[i], &l->f, l->x, &s->noise, &r))
            info_add(&part[i / LINE_PART], &r, l->x);
    return (l->n_kept + LINE_PART - 1) / LINE_PART;
}

/* The trace of (H C)². */
static double trace_of_square(const mat4 *H, const mat4 *C) {
    double M[4][4], sum = 0;
    for (int i = 0; i < 4; i++)
        mat4_times(C, H->m[i], M[i]);
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++)
            sum += M[i][j] * M[j][i];
    return sum;
}

/* The variance of what n parts say over the stated one, where `expected` is the usual; their
 * estimate's covariance by the stated one goes to *C. 0 when they don't determine a line. */
static double disagreement(const info *part, uint32_t n, double expected, mat4 *C) {
    info all = {0};
    double x[4], slope[4], found = 0, share = 4, dof = 2.0 * n - 4;
    for (uint32_t k = 0; k < n; k++)
        info_sum(&all, &part[k]);
    if (n < LEAST || !mat4_invert(&all.H, C))
        return 0;
    mat4_times(C, all.g, x);
    for (uint32_t k = 0; k < n; k++) {
        info_slope(&part[k], x, slope);
        found += mat4_form(C, slope, slope);
        share -= trace_of_square(&part[k].H, C);
    }
    return (dof * found / fmax(share, 0.1) + PRIOR_DOF * expected) / (dof + PRIOR_DOF);
}

double line_drift(const line *l, const scene *s) {
    info part[LINE_PARTS];
    mat4 C;
    return disagreement(part, divide(l, s, part), l->scale * s->memory, &C);
}

static double worse_end(const mat4 *C) {
    return fmax(C->m[0][0] + C->m[1][1], C->m[2][2] + C->m[3][3]);
}

bool line_best_run(const line *l, const scene *s, uint32_t *from, uint32_t *to) {
    info part[LINE_PARTS];
    mat4 C;
    uint32_t n = divide(l, s, part);
    double usual = s->scale * s->memory, whole = disagreement(part, n, usual, &C);
    double least = whole * worse_end(&C) * WORTH;
    *from = 0, *to = n;
    for (uint32_t i = 0; whole > SUSPECT * usual && i < n; i++)
        for (uint32_t j = i + LEAST; j <= n; j++) {
            double v = disagreement(part + i, j - i, usual, &C);
            if (v > 0 && v * worse_end(&C) < least)
                least = v * worse_end(&C), *from = i, *to = j;
        }
    return *to - *from < n;
}
