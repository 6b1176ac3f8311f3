/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * linearise.c: how views bear on a line's parameters (view.h), four views at once.
 */
#include <math.h>
#include <stddef.h>

#include "lane.h"

_Static_assert(offsetof(view, half) == 15 * sizeof(double) &&
                   offsetof(view, misfit) == offsetof(view, cov) + 3 * sizeof(double) &&
                   offsetof(view, left) == offsetof(view, shift) + 3 * sizeof(double),
               "views are loaded in blocks of four numbers");

/* The numbers of the views: as they lie in a view, from where in `all`. */
enum { CENTRE = 0, AXIS = 3, RAY = 6, STEP = 9, PLANE = 12, HALF = 15, MISFIT = 3, LEFT = 3 };
typedef struct views {
    lane all[16], cov[4], shift[4];
    lane steep; /* plane² */
} views;

INLINE void load_views(const view *const v[VIEWS], const pose_noise *noise, views *u) {
    for (size_t k = 0; k < 16; k += 4)
        lane_load(v, k * sizeof(double), u->all + k);
    lane_load(v, offsetof(view, cov), u->cov);
    u->steep = DOT(u->all + PLANE, u->all + PLANE);
    u->shift[LEFT] = (lane){1, 1, 1, 1};
    if (!noise->corrected)
        return;
    lane_load(v, offsetof(view, shift), u->shift);
    for (int i = 0; i < 3; i++)
        u->all[CENTRE + i] += u->shift[i];
}

/* The variances at -half and half from those of offset and angle, to which the noise of the pose
 * adds: moving the camera by d moves the offset by plane d / depth, turning it moves the offset by
 * at most |plane| |ray| and turns the picture. */
INLINE void covariance(const views *u, const pose_noise *noise, linears *l) {
    const lane *depth = (const lane *)l->depth, *ray = u->all + RAY;
    lane half = u->all[HALF];
    lane position = noise->position * u->shift[LEFT] / *depth;
    double rotation = noise->rotation * noise->rotation;
    lane offset = u->cov[0] + u->steep * (position * position + DOT(ray, ray) * rotation);
    lane bend = half * half * (u->cov[2] + rotation), mixed = 2 * half * u->cov[1];
    *(lane *)l->cov[0] = offset - mixed + bend;
    *(lane *)l->cov[1] = offset - bend;
    *(lane *)l->cov[2] = offset + mixed + bend;
    *(lane *)l->misfit = u->cov[MISFIT] * (u->cov[0] + half * half * u->cov[2]) / (offset + bend);
}

/* The place on the line M + s D where the picture's point `px` from a segment's middle is nearest,
 * as arris_line_at has it; w is C - M. */
INLINE void place(const views *u, const lane w[3], const double D[3], const lane *px, lane *s) {
    lane d[3], n[3], m[3];
    for (int i = 0; i < 3; i++)
        d[i] = u->all[RAY + i] + *px * u->all[STEP + i];
    cross_fixed(D, d, n);
    cross(w, d, m);
    lane s2 = DOT(n, n);
    *s = (lane)((lane_bits)(DOT(m, n) / s2) | (s2 <= VIEW_PARALLEL)); /* all bits: not a number */
}

/* What the end at `px` of the segments tells; a, b: of the plane, along f->a and f->b. */
INLINE void linearise_end(const views *u, const lane w[3], const double D[3], const lane *px,
                          const lane *a, const lane *b, int end, linears *l, lane *z) {
    lane s, P[3];
    place(u, w, D, px, &s);
    for (int i = 0; i < 3; i++)
        P[i] = s * D[i] - w[i];
    *z = DOT(u->all + AXIS, P);
    lane per_depth = 1 / *z, p = (0.5 - 0.5 * s) * per_depth, q = (0.5 + 0.5 * s) * per_depth;
    *(lane *)l->r[end] = DOT(u->all + PLANE, P) * per_depth;
    *(lane *)l->s[end] = s;
    *(lane *)l->J[end][0] = p * *a;
    *(lane *)l->J[end][1] = p * *b;
    *(lane *)l->J[end][2] = q * *a;
    *(lane *)l->J[end][3] = q * *b;
}

INLINE void measure(linears *l, const lane_bits *ahead) {
    const lane *r = (const lane *)l->r, *c = (const lane *)l->cov;
    lane distance = (c[2] * r[0] * r[0] - 2 * c[1] * r[0] * r[1] + c[0] * r[1] * r[1]) /
                    (c[0] * c[2] - c[1] * c[1]);
    *(lane *)l->distance = (lane)((lane_bits)distance | ~*ahead);
}

/* The derivatives are by the plane of a segment that lies on the picture of the line, in the place
 * of the observed one's: so they do not have its noise in them, and are 0 in the directions of
 * which the view tells nothing. */
INLINE void linearise(const view *const v[VIEWS], const frame *f, const double x[4],
                      const pose_noise *noise, linears *l) {
    views u;
    double M[3], D[3];
    lane w[3], plane[3], z[2];
    load_views(v, noise, &u);
    frame_line(f, x, M, D);
    for (int i = 0; i < 3; i++)
        w[i] = u.all[CENTRE + i] - M[i];
    cross_fixed(D, w, plane);
    lane scale = u.steep / DOT(u.all + PLANE, plane), half = u.all[HALF], start = -half;
    lane a = scale * DOT(f->a, plane), b = scale * DOT(f->b, plane);
    linearise_end(&u, w, D, &start, &a, &b, 0, l, &z[0]);
    linearise_end(&u, w, D, &half, &a, &b, 1, l, &z[1]);
    *(lane *)l->depth = z[0] / 2 + z[1] / 2;
    covariance(&u, noise, l);
    lane_bits ahead = (z[0] > 0) & (z[1] > 0);
    measure(l, &ahead);
}

static void linearise_portable(const view *const v[VIEWS], const frame *f, const double x[4],
                               const pose_noise *noise, linears *l) {
    linearise(v, f, x, noise, l);
}

AVX2_PATH static void linearise_avx2(const view *const v[VIEWS], const frame *f, const double x[4],
                                     const pose_noise *noise, linears *l) {
    linearise(v, f, x, noise, l);
}

void views_linearise(const view *first, uint32_t n, uint32_t stride, const frame *f,
                     const double x[4], const pose_noise *noise, linears *l) {
    const view *v[VIEWS];
    for (uint32_t k = 0; k < VIEWS; k++)
        v[k] = first + (k < n ? k : 0) * stride;
    (HAS_AVX2 ? linearise_avx2 : linearise_portable)(v, f, x, noise, l);
}

bool views_pick(const linears *l, uint32_t k, linear *one) {
    for (int end = 0; end < 2; end++) {
        one->r[end] = l->r[end][k];
        one->s[end] = l->s[end][k];
        for (int i = 0; i < 4; i++)
            one->J[end][i] = l->J[end][i][k];
    }
    for (int i = 0; i < 3; i++)
        one->cov[i] = l->cov[i][k];
    one->misfit = l->misfit[k];
    one->depth = l->depth[k];
    return !isnan(l->distance[k]);
}

bool view_linearise(const view *v, const frame *f, const double x[4], const pose_noise *noise,
                    linear *l) {
    linears one;
    views_linearise(v, 1, 1, f, x, noise, &one);
    return views_pick(&one, 0, l);
}
