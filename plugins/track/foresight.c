/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * foresight.c: a running 3D line reprojected (foresight.h).
 */
#include "foresight.h"

#include <math.h>

/* Variance of the end P of a line, with covariance cov, along the unit vector n, mm². `end` is 0
 * for p, 1 for q. */
static double variance_along(const double cov[21], int end, const double n[3]) {
    double sum = 0;
    for (int i = 0, k = 0; i < 6; i++)
        for (int j = i; j < 6; j++, k++)
            if (i / 3 == end && j / 3 == end)
                sum += (i == j ? 1 : 2) * cov[k] * n[i % 3] * n[j % 3];
    return sum;
}

bool foresee(const arris_line *l, const arris_camera *c, const arris_pose *pose, double sigmas,
             arris_segment *where, double *reach) {
    double e[4], n[3], z[2], worst = 0;
    if (l->state == ARRIS_UNOBSERVABLE || l->change == ARRIS_MERGED || l->change == ARRIS_RETIRED)
        return false;
    z[0] = arris_project(c, pose, l->p, &e[0], &e[1]);
    z[1] = arris_project(c, pose, l->q, &e[2], &e[3]);
    if (!(z[0] > 0) || !(z[1] > 0) || arris_view_plane(c, pose, e, n))
        return false;
    for (int i = 0; i < 2; i++)
        worst = fmax(worst, variance_along(l->cov, i, n) / (z[i] * z[i]));
    *reach = sigmas * c->fx * sqrt(worst);
    arris_distort(c, e[0], e[1], &where->x1, &where->y1);
    arris_distort(c, e[2], e[3], &where->x2, &where->y2);
    return isfinite(*reach + where->x1 + where->y1 + where->x2 + where->y2);
}
