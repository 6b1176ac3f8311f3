/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * step.c: the filters of a blurred step (step.h), by Gram-Schmidt.
 */
#include "step.h"

#include <math.h>
#include <string.h>

#define BESIDE 1.5   /* px from the step, where a second one is asked for */
#define RESOLVED 4.5 /* blurs that a row reaches from the step to tell a kink from its offset */

typedef double row[STEP_WIDTH];

static double dot(const row a, const row b) {
    double sum = 0;
    for (int j = 0; j < STEP_WIDTH; j++)
        sum += a[j] * b[j];
    return sum;
}

/* What each part changes at the distance d from a step of blur s. */
static void parts_at(double d, double s, double part[STEP_FILTERS]) {
    double z = d / s, Phi = 0.5 * erfc(-z * M_SQRT1_2), phi = exp(-z * z / 2) / sqrt(2 * M_PI);
    double bright = d * Phi + s * phi; /* a ramp on the bright side only, blurred */
    part[STEP_MEAN] = 1;
    part[STEP_CONTRAST] = Phi;
    part[STEP_OFFSET] = phi / s;
    part[STEP_BLUR] = -z * phi;
    part[STEP_KINK] = 2 * bright - d;
    part[STEP_SLOPE] = d;
    part[STEP_BEFORE] = 0.5 * erfc(-(d + BESIDE) / s * M_SQRT1_2);
    part[STEP_BEHIND] = 0.5 * erfc(-(d - BESIDE) / s * M_SQRT1_2);
}

/* Takes the first k directions, or those of the parts, out of q[k] and scales the rest to length 1;
 * a rest that is nothing but rounding becomes 0. Returns the length. */
static double orthogonal(row *q, int k) {
    double before = sqrt(dot(q[k], q[k]));
    for (int twice = 0; twice < 2; twice++)
        for (int i = 0; i < k && i < STEP_PARTS; i++) {
            double c = dot(q[i], q[k]);
            for (int j = 0; j < STEP_WIDTH; j++)
                q[k][j] -= c * q[i][j];
        }
    double length = sqrt(dot(q[k], q[k]));
    if (length < 1e-6 * before)
        length = 0;
    for (int j = 0; j < STEP_WIDTH; j++)
        q[k][j] = length > 0 ? q[k][j] / length : 0;
    return length;
}

/* The parts over a row, from a step that is `shift` px before the middle. */
static void model(row *v, double s, int half, double shift, int parts) {
    double part[STEP_FILTERS];
    memset(v, 0, STEP_FILTERS * sizeof *v);
    for (int j = STEP_HALF - half; j < STEP_HALF + half; j++) {
        parts_at(j - STEP_HALF + shift, s, part);
        for (int k = 0; k < parts; k++)
            v[k][j] = part[k];
    }
}

static void make(step_filter *f, double s, int half, double shift) {
    row v[STEP_FILTERS], q[STEP_FILTERS], wider[STEP_FILTERS];
    double length[STEP_FILTERS] = {0};
    /* narrow rows have too few pixels to tell slopes; a kink, where the step leaves some of them */
    bool kinked = half > STEP_MIN && half >= RESOLVED * s;
    for (int j = STEP_HALF - half; j < STEP_HALF + half; j++)
        f->inside[j] = -1;
    int parts = half >= 5 ? STEP_FILTERS : kinked ? STEP_SLOPE : STEP_KINK;
    model(v, s, half, shift, parts);
    model(wider, 1.01 * s, half, shift, parts);
    memcpy(q, v, sizeof q);
    for (int k = 0; k < parts; k++)
        length[k] = orthogonal(q, k);
    for (int k = 0; k < parts; k++) {
        f->response[k] = (float)length[k];
        for (int j = 0; j < STEP_WIDTH; j++)
            f->w[j / 2][k][j % 2] = (int16_t)fmin(rint(STEP_UNIT * q[k][j]), INT16_MAX);
    }
    double gain = dot(q[STEP_OFFSET], wider[STEP_OFFSET]) / length[STEP_OFFSET];
    f->offset[STEP_RESPONSE] = f->response[STEP_OFFSET];
    f->offset[STEP_GAIN] = (float)((gain - 1) / log(1.01));
    f->part[STEP_SUM] = (float)dot(v[STEP_MEAN], v[STEP_CONTRAST]);
    f->part[STEP_DOF] = (float)(2 * half - (parts < STEP_PARTS ? parts : STEP_PARTS));
    if (parts <= STEP_KINK)
        return;
    double per_slope = parts > STEP_SLOPE ? 1 / length[STEP_SLOPE] : 0;
    double kink = dot(q[STEP_OFFSET], v[STEP_KINK]), slope = dot(q[STEP_OFFSET], v[STEP_SLOPE]);
    f->offset[STEP_BY_KINK] = (float)kink, f->offset[STEP_BY_SLOPE] = (float)slope;
    kink /= length[STEP_KINK];
    slope = (slope - kink * dot(q[STEP_KINK], v[STEP_SLOPE])) * per_slope;
    f->offset[STEP_PER_KINK] = (float)kink, f->offset[STEP_PER_SLOPE] = (float)slope;
    f->offset[STEP_UNSURE] = (float)(sqrt(1 + kink * kink + slope * slope) - 1);
    f->part[STEP_TILT] =
        (float)(length[STEP_CONTRAST] * dot(q[STEP_CONTRAST], v[STEP_SLOPE]) * per_slope);
    f->part[STEP_FLARE] = (float)(length[STEP_BLUR] * dot(q[STEP_BLUR], v[STEP_SLOPE]) * per_slope);
}

void step_init(step_table *t) {
    memset(t, 0, sizeof *t);
    for (int k = 0; k < STEP_SCALES; k++)
        for (int half = STEP_MIN; half <= STEP_HALF; half++)
            for (int p = 0; p < STEP_PHASES; p++)
                make(&t->f[k][half - STEP_MIN][p], (double)step_blur(k), half,
                     (p + 0.5) / STEP_PHASES);
}
