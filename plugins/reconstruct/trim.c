/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * trim.c: where a line ends. End points scatter, and lines enter and leave the picture: so a line
 * reaches to where still a good part of those views saw it that could.
 */
#include <math.h>

#include "line.h"

static const double SUPPORT = 0.3; /* of the views that could see a place must have seen it */

/* Of one view: places on the line, from and to. */
typedef struct reach {
    double seen[2], visible[2];
    double pixel[2]; /* mm that a pixel measures along the line at its ends */
} reach;

static bool reach_of(const view *v, const line *l, reach *r) {
    double outside[2] = {v->from, v->to}, ends[2] = {-v->half, v->half};
    for (int i = 0; i < 2; i++) {
        r->seen[i] = view_place(v, &l->f, l->x, ends[i]);
        r->visible[i] = view_place(v, &l->f, l->x, outside[i]);
        r->pixel[i] = fabs(view_place(v, &l->f, l->x, ends[i] + 1) - r->seen[i]) * l->f.h;
    }
    /* beyond its vanishing point a line is seen no more */
    r->visible[0] = fmin(r->visible[0], r->seen[0]);
    r->visible[1] = fmax(r->visible[1], r->seen[1]);
    return isfinite(r->seen[0] + r->seen[1] + r->pixel[0] + r->pixel[1]);
}

static bool supported(const reach *v, uint32_t n, double place) {
    uint32_t seen = 0, visible = 0;
    for (uint32_t i = 0; i < n; i++) {
        seen += v[i].seen[0] <= place && place <= v[i].seen[1];
        visible += v[i].visible[0] <= place && place <= v[i].visible[1];
    }
    return seen >= SUPPORT * visible && (seen > 1 || n < 3);
}

void line_trim(line *l) {
    reach v[LINE_KEPT];
    uint32_t n = 0;
    for (uint32_t i = 0; i < l->n_kept; i++)
        if (l->inlier[i] && reach_of(&l->kept[i], l, &v[n]))
            n++;
    double ends[2] = {(double)INFINITY, -(double)INFINITY};
    for (uint32_t i = 0; i < n; i++) {
        if (v[i].seen[0] < ends[0] && supported(v, n, v[i].seen[0]))
            ends[0] = v[i].seen[0], l->pixel[0] = v[i].pixel[0];
        if (v[i].seen[1] > ends[1] && supported(v, n, v[i].seen[1]))
            ends[1] = v[i].seen[1], l->pixel[1] = v[i].pixel[1];
    }
    bool found = ends[0] < ends[1];
    l->ends[0] = found ? ends[0] : -1;
    l->ends[1] = found ? ends[1] : 1;
    l->next_trim = l->seen + 1 + l->seen / 8;
}
