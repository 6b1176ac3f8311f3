/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * shift.c: the poses' errors from the lines' (shift.h): for every frame the least squares over the
 * distances of its lines, with the poses' own sigma as a prior.
 */
#include "shift.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double BIAS = 0.05; /* px, of any line: what it sees of its surroundings */
static const double OUTLIER = 3; /* sigmas from which a line counts less */

/* A shift d of a frame: A d = v. */
typedef struct normal {
    double A[9], v[3];
} normal;

struct shifts {
    uint32_t max, frames;
    normal prior;
    normal frame[];
};

shifts *shifts_new(uint32_t max) {
    shifts *t = malloc(sizeof *t + max * sizeof *t->frame);
    if (t)
        t->max = max;
    return t;
}

void shifts_free(shifts *t) {
    free(t);
}

void shifts_begin(shifts *t, uint32_t frames, const scene *s) {
    double variance = s->noise.position * s->noise.position;
    t->frames = frames;
    t->prior = (normal){{0}, {0}};
    for (int i = 0; i < 3; i++)
        t->prior.A[4 * i] = 1 / fmax(variance, 1e-12);
    for (uint32_t i = 0; i < t->max && i < frames; i++)
        t->frame[i] = t->prior;
}

static normal *of_frame(const shifts *t, const view *v) {
    uint64_t i = v->frame;
    if (t->frames > t->max)
        i = i * t->max / t->frames;
    return (normal *)&t->frame[i];
}

/* Adds `sign` times what a view says: n d = the line's distance in mm, n the normal of its plane;
 * its noise is what is not the pose's. False when it says nothing. */
static bool add(normal *a, const view *v, const line *l, const scene *s, double sign, double n[3]) {
    linear r;
    pose_noise none = {0, s->noise.rotation, false};
    if (!view_linearise(v, &l->f, l->x, &none, &r))
        return false;
    memcpy(n, v->plane, sizeof v->plane);
    double mm = r.depth / arris_unit(n), offset = (r.r[0] + r.r[1]) / 2 * mm;
    double variance = ((r.cov[0] + 2 * r.cov[1] + r.cov[2]) / 4 + BIAS * BIAS) * mm * mm;
    double pose = s->noise.position * s->noise.position;
    double far = fabs(offset) / (OUTLIER * sqrt(variance + pose)), w = sign / variance;
    w = far > 1 ? w / (far * far) : w;
    for (int i = 0; i < 3; i++) {
        a->v[i] += w * offset * n[i];
        for (int j = 0; j < 3; j++)
            a->A[3 * i + j] += w * n[i] * n[j];
    }
    return true;
}

void shifts_add(shifts *t, const line *l, const scene *s) {
    double n[3];
    for (uint32_t i = 0; i < l->n_kept; i++)
        if (l->inlier[i])
            add(of_frame(t, &l->kept[i]), &l->kept[i], l, s, 1, n);
}

/* The inverse of a symmetric matrix. */
static void invert(const double A[9], double inverse[9]) {
    for (int i = 0; i < 3; i++)
        arris_cross(A + 3 * ((i + 1) % 3), A + 3 * ((i + 2) % 3), inverse + 3 * i);
    double det = arris_dot(A, inverse);
    for (int i = 0; i < 9; i++)
        inverse[i] /= det;
}

void shifts_set(const shifts *t, line *l, const scene *s, bool added) {
    for (uint32_t i = 0; i < l->n_kept; i++) {
        view *v = &l->kept[i];
        normal a = *of_frame(t, v);
        double C[9], n[3], variance = 0;
        bool known = s->noise.position > 0;
        if (added && l->inlier[i])
            known &= add(&a, v, l, s, -1, n);
        else
            memcpy(n, v->plane, sizeof n), arris_unit(n);
        invert(a.A, C);
        for (int k = 0; k < 3; k++) {
            v->shift[k] = known ? arris_dot(C + 3 * k, a.v) : 0;
            variance += n[k] * arris_dot(C + 3 * k, n);
        }
        v->left = known ? sqrt(variance) / s->noise.position : 1;
    }
}
