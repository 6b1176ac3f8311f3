/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * drift.c: what the views of a line say against each other. An edge wanders slowly in the picture
 * as the view changes: by shading, by a neighbour that is not resolved. That does not average out
 * as noise does, and the variance of single residuals does not tell. So the views are cut, in their
 * order, into a few parts, whose sums are compared with what their variances let expect (batch
 * means; the middle of White's sandwich of 1980, a cluster a part).
 */
#include <math.h>

#include "line.h"

static const double PRIOR_DOF = 4; /* weight of the expected size against the parts' own */
enum { PARTS = 8, LEAST = 3 };     /* parts: at most, at least */

void line_groups(const line *l, const scene *s, info group[LINE_KEPT]) {
    linears r;
    linear one;
    for (uint32_t i = 0; i < l->n_kept; i++) {
        if (i % VIEWS == 0)
            views_linearise(&l->kept[i], l->n_kept - i, 1, &l->f, l->x, &s->noise, &r);
        group[i] = l->stride > 1 ? l->rest[i] : (info){0};
        if (group[i].n > 0)
            info_weigh(&group[i], line_rest_weight(l, s));
        if (l->inlier[i] && views_pick(&r, i % VIEWS, &one))
            info_add(&group[i], &one, l->x);
    }
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

static uint32_t divide(const info *group, uint32_t n, info part[PARTS]) {
    uint32_t parts = n / 2 < PARTS ? n / 2 : PARTS;
    for (uint32_t k = 0; k < parts; k++) {
        part[k] = (info){0};
        for (uint32_t i = k * n / parts; i < (k + 1) * n / parts; i++)
            info_sum(&part[k], &group[i]);
    }
    return parts;
}

double line_disagreement(const info *group, uint32_t n, double expected, mat4 *C) {
    info part[PARTS], all = {0};
    uint32_t parts = divide(group, n, part);
    double x[4], slope[4], found = 0, share = 4, dof = 2.0 * parts - 4;
    for (uint32_t k = 0; k < parts; k++)
        info_sum(&all, &part[k]);
    if (parts < LEAST || !mat4_invert(&all.H, C))
        return 0;
    mat4_times(C, all.g, x);
    for (uint32_t k = 0; k < parts; k++) {
        info_slope(&part[k], x, slope);
        found += mat4_form(C, slope, slope);
        share -= trace_of_square(&part[k].H, C);
    }
    return (dof * found / fmax(share, 0.1) + PRIOR_DOF * expected) / (dof + PRIOR_DOF);
}
