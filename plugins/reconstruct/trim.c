/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * trim.c: where a line ends. End points scatter, and lines enter and leave the picture: so a line
 * reaches to where still a good part of those views saw it that could. Where it is foreshortened a
 * view tells little of that, and counts little.
 */
#include <math.h>

#include "line.h"

static const double SUPPORT = 0.3; /* of the views that could see a place must have seen it */

static const double SCATTER = 4; /* px along a line within which end points scatter */

/* Of one view: places on the line, from and to. */
typedef struct reach {
    double seen[2], visible[2];
    double pixel[2]; /* mm that a pixel measures along the line at its ends */
} reach;

static bool reach_of(const view *v, const line *l, reach *r) {
    const double px[6] = {-v->half, v->half, v->from, v->to, 1 - v->half, 1 + v->half};
    double s[6];
    view_places(v, &l->f, l->x, px, 6, s);
    for (int i = 0; i < 2; i++) {
        r->seen[i] = s[i];
        r->visible[i] = s[2 + i];
        r->pixel[i] = fabs(s[4 + i] - s[i]) * l->f.h;
    }
    /* beyond its vanishing point a line is seen no more */
    r->visible[0] = fmin(r->visible[0], r->seen[0]);
    r->visible[1] = fmax(r->visible[1], r->seen[1]);
    return isfinite(r->seen[0] + r->seen[1] + r->pixel[0] + r->pixel[1]);
}

/* What a view tells of where an end is, mm⁻². */
static double weight(const reach *v, int end) {
    return 1 / (v->pixel[end] * v->pixel[end]);
}

/* Whether enough of the views that could see the place, which one of them saw as an end, did. */
static bool supported(const reach *v, uint32_t n, int end, double place) {
    double seen = 0, visible = 0;
    uint32_t views = 0;
    for (uint32_t i = 0; i < n; i++) {
        if (v[i].visible[0] <= place && place <= v[i].visible[1])
            visible += weight(&v[i], end);
        if (v[i].seen[0] <= place && place <= v[i].seen[1])
            seen += weight(&v[i], end), views++;
    }
    return seen >= SUPPORT * visible && (views > 1 || n < 3);
}

/* Moves an end from the outermost place that is supported to the mean of what was seen as the end
 * there; the ends scatter. */
static void settle_end(line *l, const reach *v, uint32_t n, int end) {
    double sum = 0, all = 0;
    uint32_t views = 0;
    for (uint32_t i = 0; i < n; i++) {
        double w = weight(&v[i], end);
        if (fabs(v[i].seen[end] - l->ends[end]) * l->f.h > SCATTER * v[i].pixel[end])
            continue;
        sum += w * v[i].seen[end];
        all += w;
        views++;
    }
    l->ends[end] = sum / all;
    l->pixel[end] = sqrt(views / all);
}

void line_trim(line *l) {
    reach v[LINE_KEPT];
    uint32_t n = 0;
    for (uint32_t i = 0; i < l->n_kept; i++)
        if (l->inlier[i] && reach_of(&l->kept[i], l, &v[n]))
            n++;
    double ends[2] = {(double)INFINITY, -(double)INFINITY};
    for (uint32_t i = 0; i < n; i++) {
        if (v[i].seen[0] < ends[0] && supported(v, n, 0, v[i].seen[0]))
            ends[0] = v[i].seen[0];
        if (v[i].seen[1] > ends[1] && supported(v, n, 1, v[i].seen[1]))
            ends[1] = v[i].seen[1];
    }
    bool found = ends[0] < ends[1];
    l->ends[0] = found ? ends[0] : -1;
    l->ends[1] = found ? ends[1] : 1;
    for (int end = 0; found && end < 2; end++)
        settle_end(l, v, n, end);
}
