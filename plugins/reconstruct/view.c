/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * view.c: one sighting of a line (view.h).
 */
#include "view.h"

#include <math.h>

/* Added to the variance of the offset (px²): a ten-thousandth of a pixel, which nobody sees. Keeps
 * what claims to be exact from being infinitely heavy. */
static const double LEAST_VARIANCE = 1e-8;

/* The ray of the pixel (x, y), at depth 1, and by how much it turns along (dx, dy). */
static void set_ray(view *v, const arris_camera *c, const arris_pose *pose, double x, double y,
                    double dx, double dy) {
    const double *R = pose->R;
    double b = (y - c->cy) / c->fy, a = (x - c->cx - c->skew * b) / c->fx;
    double db = dy / c->fy, da = (dx - c->skew * db) / c->fx;
    for (int i = 0; i < 3; i++) {
        v->ray[i] = a * R[i] + b * R[3 + i] + R[6 + i];
        v->step[i] = da * R[i] + db * R[3 + i];
    }
}

/* Narrows from..to to where from + t speed stays within lo..hi. */
static void clip(double at, double speed, double lo, double hi, double *from, double *to) {
    double t0 = (lo - at) / speed, t1 = (hi - at) / speed;
    if (speed == 0)
        return;
    *from = fmax(*from, fmin(t0, t1));
    *to = fmin(*to, fmax(t0, t1));
}

/* Takes the lens out of the end points, where `undistort` has not. */
static int straighten(const arris_camera *c, arris_segment *s) {
    if (!arris_camera_distorts(c))
        return 0;
    int first = arris_undistort(c, s->x1, s->y1, &s->x1, &s->y1);
    int second = arris_undistort(c, s->x2, s->y2, &s->x2, &s->y2);
    return first ? first : second;
}

static bool usable(const arris_segment *s, double length) {
    return isfinite(length) && length > 0 && s->cov[0] >= 0 && s->cov[2] >= 0 &&
           isfinite(s->x1 + s->y1 + s->cov[0] + s->cov[1] + s->cov[2]);
}

static void set_covariance(view *v, const double cov[3]) {
    v->cov[0] = cov[0] + LEAST_VARIANCE;
    v->cov[1] = cov[1] * cov[1] < cov[0] * cov[2] ? cov[1] : 0;
    v->cov[2] = cov[2] + LEAST_VARIANCE / (v->half * v->half);
}

int view_make(view *v, const arris_segment *segment, const arris_camera *c, const arris_pose *pose,
              const double picture[4]) {
    arris_segment s = *segment;
    int bad = straighten(c, &s);
    double dx = s.x2 - s.x1, dy = s.y2 - s.y1, length = sqrt(dx * dx + dy * dy);
    double x = (s.x1 + s.x2) / 2, y = (s.y1 + s.y2) / 2;
    if (bad || !usable(&s, length))
        return ARRIS_E_INPUT;
    dx /= length, dy /= length;
    set_ray(v, c, pose, x, y, dx, dy);
    for (int i = 0; i < 3; i++) {
        v->C[i] = pose->C[i];
        v->axis[i] = pose->R[6 + i];
    }
    arris_cross(v->ray, v->step, v->plane);
    for (int i = 0; i < 3; i++)
        v->plane[i] *= c->fx * c->fy;
    v->half = length / 2;
    if (!isfinite(arris_dot(v->plane, v->plane) + arris_dot(v->C, v->C)))
        return ARRIS_E_INPUT;
    v->from = -(double)INFINITY, v->to = (double)INFINITY;
    clip(x, dx, picture[0], picture[2], &v->from, &v->to);
    clip(y, dy, picture[1], picture[3], &v->from, &v->to);
    v->from = fmin(v->from, -v->half);
    v->to = fmax(v->to, v->half);
    set_covariance(v, s.cov);
    v->misfit = s.chi2 > 0 ? 1 - 1 / s.chi2 : 0;
    v->level[0] = s.lo, v->level[1] = s.hi;
    v->blur = s.blur;
    v->beside[0] = s.beside[0], v->beside[1] = s.beside[1];
    v->frame = 0;
    v->shift[0] = v->shift[1] = v->shift[2] = 0;
    v->left = 1;
    return 0;
}

void view_turn(view *v) {
    double from = v->from, left = v->level[0];
    for (int i = 0; i < 3; i++) {
        v->step[i] = -v->step[i];
        v->plane[i] = -v->plane[i];
    }
    v->from = -v->to, v->to = -from;
    v->level[0] = v->level[1], v->level[1] = left;
    float beside = v->beside[0];
    v->beside[0] = v->beside[1], v->beside[1] = beside;
    v->cov[1] = -v->cov[1];
}

void view_move(view *v, double px, double variance, double share) {
    double across[3], along = arris_dot(v->plane, v->axis);
    for (int i = 0; i < 3; i++)
        across[i] = v->plane[i] - along * v->axis[i];
    double per_px = px / arris_dot(across, across);
    for (int i = 0; i < 3; i++) {
        v->ray[i] += per_px * across[i];
        v->plane[i] -= px * v->axis[i];
    }
    double systematic = v->misfit * v->cov[0] + share * variance;
    v->cov[0] += variance;
    v->misfit = systematic / v->cov[0];
}

void frame_line(const frame *f, const double x[4], double M[3], double D[3]) {
    double a = (x[0] + x[2]) / 2, b = (x[1] + x[3]) / 2, c = (x[2] - x[0]) / 2,
           d = (x[3] - x[1]) / 2;
    for (int i = 0; i < 3; i++) {
        M[i] = f->X[i] + a * f->a[i] + b * f->b[i];
        D[i] = f->h * f->u[i] + c * f->a[i] + d * f->b[i];
    }
}

void frame_point(const frame *f, const double x[4], double s, double P[3]) {
    double p = (1 - s) / 2, q = (1 + s) / 2;
    double a = p * x[0] + q * x[2], b = p * x[1] + q * x[3], along = s * f->h;
    for (int i = 0; i < 3; i++)
        P[i] = f->X[i] + along * f->u[i] + a * f->a[i] + b * f->b[i];
}

/* As arris_line_at has it, in units of D. */
void view_places(const view *v, const frame *f, const double x[4], const double px[], int n,
                 double s[]) {
    double M[3], D[3], w[3], along[2][3], at[2][3]; /* each at the middle, and by px */
    frame_line(f, x, M, D);
    for (int i = 0; i < 3; i++)
        w[i] = v->C[i] - M[i];
    arris_cross(D, v->ray, along[0]);
    arris_cross(D, v->step, along[1]);
    arris_cross(w, v->ray, at[0]);
    arris_cross(w, v->step, at[1]);
    for (int k = 0; k < n; k++) {
        double s2 = 0, sum = 0;
        for (int i = 0; i < 3; i++) {
            double c = along[0][i] + px[k] * along[1][i];
            s2 += c * c;
            sum += c * (at[0][i] + px[k] * at[1][i]);
        }
        s[k] = s2 > VIEW_PARALLEL ? sum / s2 : (double)NAN;
    }
}

void view_ends(const view *v, const frame *f, const double x[4], double s[2]) {
    view_places(v, f, x, (const double[]){-v->half, v->half}, 2, s);
}

double linear_distance(const linear *l, const mat4 *P) {
    double c0 = l->cov[0], c1 = l->cov[1], c2 = l->cov[2];
    if (P) {
        c0 += mat4_form(P, l->J[0], l->J[0]);
        c1 += mat4_form(P, l->J[0], l->J[1]);
        c2 += mat4_form(P, l->J[1], l->J[1]);
    }
    double r0 = l->r[0], r1 = l->r[1];
    return (c2 * r0 * r0 - 2 * c1 * r0 * r1 + c0 * r1 * r1) / (c0 * c2 - c1 * c1);
}
