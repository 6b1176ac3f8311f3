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
enum { EM_STEPS = 3 };

/* A shift d of a frame: A d = v. */
typedef struct normal {
    double A[9], v[3];
    uint32_t n; /* lines */
} normal;

struct shifts {
    uint32_t max, frames;
    normal prior;
    normal place[];
};

shifts *shifts_new(uint32_t max) {
    shifts *t = malloc(sizeof *t + max * sizeof *t->place);
    if (t)
        t->max = max;
    return t;
}

void shifts_free(shifts *t) {
    free(t);
}

/* The inverse of a symmetric matrix. */
static void invert(const double A[9], double inverse[9]) {
    for (int i = 0; i < 3; i++)
        arris_cross(A + 3 * ((i + 1) % 3), A + 3 * ((i + 2) % 3), inverse + 3 * i);
    double det = arris_dot(A, inverse);
    for (int i = 0; i < 9; i++)
        inverse[i] /= det;
}

uint32_t shifts_places(const shifts *t) {
    return t->frames < t->max ? t->frames : t->max;
}

void shifts_begin(shifts *t, uint32_t frames, const double S[9]) {
    t->frames = frames;
    t->prior = (normal){{0}, {0}, 0};
    invert(S, t->prior.A);
    for (uint32_t i = 0; i < shifts_places(t); i++)
        t->place[i] = t->prior;
}

static normal *of_frame(const shifts *t, const view *v) {
    uint64_t i = v->frame;
    if (t->frames > t->max)
        i = i * t->max / t->frames;
    return (normal *)&t->place[i];
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
            of_frame(t, &l->kept[i])->n += add(of_frame(t, &l->kept[i]), &l->kept[i], l, s, 1, n);
}

/* C is the inverse of a->A. */
static void solve(const normal *a, double C[9], double shift[3]) {
    invert(a->A, C);
    for (int k = 0; k < 3; k++)
        shift[k] = arris_dot(C + 3 * k, a->v);
}

void shifts_set(const shifts *t, line *l, const scene *s, bool added) {
    for (uint32_t i = 0; i < l->n_kept; i++) {
        view *v = &l->kept[i];
        normal a = *of_frame(t, v);
        double C[9], n[3], variance = 0;
        if (!(added && l->inlier[i] && add(&a, v, l, s, -1, n)))
            memcpy(n, v->plane, sizeof n), arris_unit(n);
        solve(&a, C, v->shift);
        for (int k = 0; k < 3; k++)
            variance += n[k] * arris_dot(C + 3 * k, n);
        v->left = sqrt(variance) / s->noise.position;
    }
}

bool shifts_at(const shifts *t, uint32_t place, uint32_t *at_frame, double shift[3]) {
    double C[9];
    solve(&t->place[place], C, shift);
    *at_frame = t->frames > t->max ? (uint32_t)((uint64_t)place * t->frames / t->max) : place;
    return t->place[place].n > 0;
}

double shifts_lines(const shifts *t) {
    double lines = 0, places = 0;
    for (uint32_t k = 0; k < shifts_places(t); k++) {
        lines += t->place[k].n;
        places += t->place[k].n > 0;
    }
    return places > 0 ? lines / places : 1;
}

void shifts_prior(const shifts *t, double inverse[9]) {
    memcpy(inverse, t->prior.A, sizeof t->prior.A);
}

/* As if the prior had been the inverse of S. */
static void spread_once(const shifts *t, double S[9]) {
    double sum[9], prior[9];
    uint32_t n = 1; /* as it was counts as one */
    invert(S, prior);
    memcpy(sum, S, sizeof sum);
    for (uint32_t k = 0; k < shifts_places(t); k++) {
        normal a = t->place[k];
        double C[9], d[3];
        if (a.n == 0)
            continue;
        for (int i = 0; i < 9; i++)
            a.A[i] += prior[i] - t->prior.A[i];
        solve(&a, C, d);
        for (int i = 0; i < 9; i++)
            sum[i] += d[i / 3] * d[i % 3] + C[i];
        n++;
    }
    for (int i = 0; i < 9; i++)
        S[i] = sum[i] / n;
}

void shifts_spread(const shifts *t, double S[9]) {
    for (int i = 0; i < EM_STEPS; i++)
        spread_once(t, S);
}
