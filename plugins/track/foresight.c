/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * foresight.c: a running 3D line reprojected (foresight.h).
 */
#include "foresight.h"

#include <math.h>

static const double DETECTED = 0.3; /* px: sigma of a segment across, whatever it says itself */
static const double GRAZING = 0.02; /* of the farther end's depth: nothing nearer is looked at */

void blur_forecast(const viewpoint *v, double depth, forecast *f) {
    double px = v->camera->fx, shift = px * v->position / depth, turn = px * v->rotation;
    double var = DETECTED * DETECTED + shift * shift + turn * turn;
    for (int i = 0; i < 3; i++)
        f->cov[i] += var;
}

/* n' C n of the 3x3 blocks C of the covariance of (p, q): of p, of p and q, of q. */
static void along(const double c[21], const double n[3], double v[3]) {
    double x = n[0], y = n[1], z = n[2];
    v[0] =
        x * (c[0] * x + 2 * (c[1] * y + c[2] * z)) + y * (c[6] * y + 2 * c[7] * z) + c[11] * z * z;
    v[1] = x * (c[3] * x + c[4] * y + c[5] * z) + y * (c[8] * x + c[9] * y + c[10] * z) +
           z * (c[12] * x + c[13] * y + c[14] * z);
    v[2] = x * (c[15] * x + 2 * (c[16] * y + c[17] * z)) + y * (c[18] * y + 2 * c[19] * z) +
           c[20] * z * z;
}

/* What is in front of the camera, as places between p (0) and q (1); z is their depths. */
static bool in_front(const arris_line *l, const arris_pose *pose, double place[2], double z[2]) {
    const double *end[2] = {l->p, l->q};
    for (int i = 0; i < 2; i++) {
        double d[3];
        for (int k = 0; k < 3; k++)
            d[k] = end[i][k] - pose->C[k];
        z[i] = arris_dot(pose->R + 6, d);
        place[i] = i;
    }
    double least = GRAZING * fmax(z[0], z[1]), slope = z[1] - z[0];
    for (int i = 0; i < 2; i++)
        if (z[i] < least && slope != 0)
            place[i] += (least - z[i]) / slope, z[i] = least;
    return least > 0;
}

bool in_picture(const arris_camera *c, const arris_segment *s) {
    return (s->x1 > 0 || s->x2 > 0) && (s->x1 < c->width || s->x2 < c->width) &&
           (s->y1 > 0 || s->y2 > 0) && (s->y1 < c->height || s->y2 < c->height);
}

bool foresee(const arris_line *l, const viewpoint *v, forecast *f, double *depth) {
    double place[2], z[2], e[4], n[3], w[2], var[3];
    if (!in_front(l, v->pose, place, z))
        return false;
    for (int i = 0; i < 2; i++) {
        double P[3];
        for (int k = 0; k < 3; k++)
            P[k] = l->p[k] + place[i] * (l->q[k] - l->p[k]);
        arris_project(v->camera, v->pose, P, &e[2 * i], &e[2 * i + 1]);
        w[i] = v->camera->fx / z[i];
    }
    if (arris_view_plane(v->camera, v->pose, e, n))
        return false;
    along(l->cov, n, var);
    *f = (forecast){.line = true};
    for (int i = 0; i < 3; i++) {
        double a = place[i / 2], b = place[(i + 1) / 2];
        f->cov[i] = w[i / 2] * w[(i + 1) / 2] *
                    ((1 - a) * (1 - b) * var[0] + (a + b - 2 * a * b) * var[1] + a * b * var[2]);
    }
    *depth = (z[0] + z[1]) / 2;
    blur_forecast(v, *depth, f);
    arris_distort(v->camera, e[0], e[1], &f->where.x1, &f->where.y1);
    arris_distort(v->camera, e[2], e[3], &f->where.x2, &f->where.y2);
    return isfinite(f->cov[0] + f->cov[1] + f->cov[2] + f->where.x1 + f->where.y1 + f->where.x2 +
                    f->where.y2) &&
           in_picture(v->camera, &f->where);
}
