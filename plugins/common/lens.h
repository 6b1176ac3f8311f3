/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * lens.h: the lens model of arris_geometry.h for eight points at once, in single precision. Only
 * displacements are calculated in it, so that the points are as good as floats are.
 */
#ifndef LENS_H
#define LENS_H

#include "arris_types.h"
#include "lanes.h"

typedef struct lens {
    float fx, fy, skew, cx, cy; /* px */
    float per_fx, per_fy;
    float k1, k2, k3, p1, p2;
} lens;

static inline lens lens_of(const arris_camera *c) {
    return (lens){(float)c->fx, (float)c->fy,       (float)c->skew,     (float)c->cx,
                  (float)c->cy, (float)(1 / c->fx), (float)(1 / c->fy), (float)c->k1,
                  (float)c->k2, (float)c->k3,       (float)c->p1,       (float)c->p2};
}

INLINE void lens_normalise(const lens *c, const eight *u, const eight *v, eight *x, eight *y) {
    *y = (*v - c->cy) * c->per_fy;
    *x = (*u - c->cx - c->skew * *y) * c->per_fx;
}

/* By how much the normalised point (x, y) is displaced, and the symmetric Jacobian of that. */
INLINE void lens_displace(const lens *c, const eight *x, const eight *y, eight d[2], eight J[3]) {
    eight xx = *x * *x, yy = *y * *y, xy = *x * *y, r2 = xx + yy;
    eight radial = r2 * (c->k1 + r2 * (c->k2 + r2 * c->k3));
    eight slope = 2 * (c->k1 + r2 * (2 * c->k2 + r2 * (3 * c->k3))); /* (1/r) d radial / dr */
    d[0] = *x * radial + 2 * c->p1 * xy + c->p2 * (r2 + 2 * xx);
    d[1] = *y * radial + c->p1 * (r2 + 2 * yy) + 2 * c->p2 * xy;
    J[0] = radial + xx * slope + 2 * c->p1 * *y + 6 * c->p2 * *x;
    J[1] = xy * slope + 2 * c->p1 * *x + 2 * c->p2 * *y;
    J[2] = radial + yy * slope + 6 * c->p1 * *y + 2 * c->p2 * *x;
}

/* From ideal pixels to the lens's. */
INLINE void lens_distort(const lens *c, eight *u, eight *v) {
    eight x, y, d[2], J[3];
    lens_normalise(c, u, v, &x, &y);
    lens_displace(c, &x, &y, d, J);
    *u += c->fx * d[0] + c->skew * d[1];
    *v += c->fy * d[1];
}

#endif
