/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * strip.h: pictures of straight edges that are known exactly, the Cramér-Rao bound of their lines,
 * and what a segment is off by.
 *
 * An edge is one end of a long bright strip on a dark ground. Each pixel is the exact blurred step
 * across it, lens and pixel box as one normal distribution.
 */
#ifndef STRIP_H
#define STRIP_H

#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "arris_types.h"

/* ---- chance, the same in every run ---------------------------------------------------------- */

static inline double rng_uniform(uint64_t *s) {
    *s ^= *s << 13, *s ^= *s >> 7, *s ^= *s << 17;
    return (double)(*s >> 11) / 9007199254740992.;
}

static inline double rng_normal(uint64_t *s) {
    double a = rng_uniform(s), b = rng_uniform(s);
    return sqrt(-2 * log(1 - a)) * cos(2 * M_PI * b);
}

/* ---- pictures ------------------------------------------------------------------------------- */

/* The grey level of a scene at a pixel. */
typedef double scene_level(const void *scene, double x, double y);

static inline arris_image picture_new(int width, int height, enum arris_format format) {
    ptrdiff_t stride = ((ptrdiff_t)width * (ptrdiff_t)format + 63) / 64 * 64;
    uint8_t *data = (uint8_t *)calloc(1, (size_t)stride * (size_t)height + 64);
    if (!data)
        abort();
    arris_image im = {format, width, height, stride, NULL, data};
    return im;
}

/* Draws the scene with noise (sigma), rounded and clipped. */
static inline void picture_draw(arris_image *im, scene_level *level, const void *scene,
                                double noise, uint64_t *seed) {
    double top = im->format == ARRIS_GREY16 ? 65535 : 255;
    for (int y = 0; y < im->height; y++)
        for (int x = 0; x < im->width; x++) {
            double g = level(scene, x, y) + (noise > 0 ? noise * rng_normal(seed) : 0);
            g = fmax(0, fmin(top, rint(g)));
            uint8_t *p = im->data + y * im->stride;
            if (im->format == ARRIS_GREY16)
                ((uint16_t *)(void *)p)[x] = (uint16_t)g;
            else
                p[x] = (uint8_t)g;
        }
}

/* ---- the strip ------------------------------------------------------------------------------ */

typedef struct strip {
    double x, y, angle, length; /* the edge's middle, direction (bright on its right), px */
    double dark, bright;        /* grey levels at the edge */
    double psf;                 /* sigma of the lens's blur, px */
    double slope[2];            /* levels per px, away from the edge on the dark and bright side */
} strip;

static inline double normal_below(double z) {
    return 0.5 * erfc(-z * M_SQRT1_2);
}

/* Sigma of the blurred step. */
static inline double strip_blur(const strip *s) {
    return sqrt(s->psf * s->psf + 1. / 12);
}

static inline double strip_level(const void *scene, double x, double y) {
    const strip *s = (const strip *)scene; /* the cast is for C++ */
    double c = cos(s->angle), d = sin(s->angle), b = strip_blur(s), h = s->length / 2;
    double t = (x - s->x) * c + (y - s->y) * d, v = (y - s->y) * c - (x - s->x) * d;
    double inside = normal_below((t + h) / b) * normal_below((h - t) / b);
    double ramp = v * normal_below(v / b) + b * exp(-v * v / (2 * b * b)) / sqrt(2 * M_PI);
    return s->dark + (s->bright - s->dark) * normal_below(v / b) * inside + s->slope[1] * ramp +
           s->slope[0] * (ramp - v);
}

/* A strip of this size somewhere near the middle of a picture, in any direction. */
static inline strip strip_anywhere(int width, int height, double length, double contrast,
                                   uint64_t *seed) {
    strip s = {.length = length, .dark = 20 + 60 * rng_uniform(seed), .psf = 0.8};
    s.x = width / 2. + 4 * rng_uniform(seed) - 2;
    s.y = height / 2. + 4 * rng_uniform(seed) - 2;
    s.angle = 2 * M_PI * rng_uniform(seed);
    s.bright = s.dark + contrast;
    return s;
}

/* Sigma of the best unbiased estimate of the offset from `fitted` px of the edge and `half` px to
 * either side of it, both levels free, from whole grey levels; that of the angle is sqrt(12) /
 * fitted times this. */
static inline double strip_bound(const strip *s, double noise, double fitted, double half) {
    double c = s->bright - s->dark;
    double information = 1 / (2 * sqrt(M_PI) * strip_blur(s)) - 1 / (2 * half);
    return sqrt((noise * noise + 1. / 12) / (fitted * c * c * information));
}

/* ---- segments ------------------------------------------------------------------------------- */

typedef struct strip_error {
    double offset; /* of the segment's middle, px, to the right of the true line */
    double angle;  /* rad */
    double nees;   /* squared in units of the stated covariance, per degree of freedom */
} strip_error;

static inline strip_error strip_compare(const strip *s, const arris_segment *g) {
    double c = cos(s->angle), d = sin(s->angle), ux = g->x2 - g->x1, uy = g->y2 - g->y1;
    double x = (g->x1 + g->x2) / 2 - s->x, y = (g->y1 + g->y2) / 2 - s->y;
    strip_error e = {.offset = y * c - x * d, .angle = atan2(c * uy - d * ux, c * ux + d * uy)};
    const double *v = g->cov;
    e.nees =
        (e.offset * e.offset * v[2] - 2 * e.offset * e.angle * v[1] + e.angle * e.angle * v[0]) /
        (2 * (v[0] * v[2] - v[1] * v[1]));
    return e;
}

/* The segment that is the strip's edge: the same direction, within 2 px, and more than half of its
 * length. NULL when there is none. */
static inline const arris_segment *strip_find(const strip *s, const arris_segments *all) {
    double c = cos(s->angle), d = sin(s->angle), near = 2;
    const arris_segment *found = NULL;
    for (uint32_t i = 0; i < all->n; i++) {
        const arris_segment *g = &all->item[i];
        double x = (g->x1 + g->x2) / 2 - s->x, y = (g->y1 + g->y2) / 2 - s->y;
        double along = (g->x2 - g->x1) * c + (g->y2 - g->y1) * d;
        strip_error e = strip_compare(s, g);
        if (fabs(e.angle) < 0.25 && fabs(e.offset) < near && along > s->length / 2 &&
            fabs(x * c + y * d) < s->length / 2) {
            near = fabs(e.offset);
            found = g;
        }
    }
    return found;
}

static inline arris_segments segments_new(size_t max) {
    arris_segments s = {.max = (uint32_t)max,
                        .item = (arris_segment *)calloc(max, sizeof(arris_segment))};
    if (!s.item)
        abort();
    return s;
}

#endif
