/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * draw.c: a picture from the borders of its regions (draw.h).
 *
 * A bit of border at (x, y) is laid down with the cubic B-spline in x and, over dy, the integral of
 * the quadratic one in y. The sum along x turns cubic into quadratic, whose variance is 1/4 px²:
 * what is wanted, psf² + 1/12, less 1/4 is left to the Gaussian, whose discrete form gets exactly
 * that variance. Cardinal splines have the same moments wherever they stand between pixels.
 */
#include "draw.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "arris_geometry.h"
#include "mix.h"

enum { MAX_RADIUS = 32, LANES = 16, MAX_BITS = 1 << 16 };
static const double STEP = 0.5; /* px, of the bits that a piece is cut into */

struct draw {
    arris_camera camera;
    double window[4];
    double edge_r, edge_stretch; /* normalised: where one ceases to follow the model */
    int radius;                  /* of the kernel, px */
    float kernel[MAX_RADIUS + 1];
    int pad;           /* px, around the picture on all sides */
    int columns, rows; /* of `sum` */
    int stride;        /* of both, in floats */
    float *sum, *blurred;
};

/* ---- the lens -------------------------------------------------------------------------------- */

/* Where the lens puts a point. Far outside of the picture, where its model means nothing and may
 * fold back into the picture, points go straight outwards instead. */
static void through_lens(const draw *d, double x, double y, double *u, double *v) {
    const arris_camera *c = &d->camera;
    double yn = (y - c->cy) / c->fy, xn = (x - c->cx - c->skew * yn) / c->fx;
    double r2 = xn * xn + yn * yn, s = 1, beyond = 0;
    if (r2 > d->edge_r * d->edge_r) {
        s = d->edge_r / sqrt(r2);
        beyond = 1 / s - 1;
        xn *= s, yn *= s, r2 = d->edge_r * d->edge_r;
    }
    double radial = 1 + r2 * (c->k1 + r2 * (c->k2 + r2 * c->k3));
    double xd = xn * radial + 2 * c->p1 * xn * yn + c->p2 * (r2 + 2 * xn * xn) + beyond * xn;
    double yd = yn * radial + c->p1 * (r2 + 2 * yn * yn) + 2 * c->p2 * xn * yn + beyond * yn;
    *u = c->fx * xd + c->skew * yd + c->cx;
    *v = c->fy * yd + c->cy;
}

static double radius_of(const arris_camera *c, double x, double y) {
    double yn = (y - c->cy) / c->fy, xn = (x - c->cx - c->skew * yn) / c->fx;
    return hypot(xn, yn);
}

/* Takes a point of the picture's border into the window. */
static int include(draw *d, double u, double v) {
    double x, y;
    if (arris_undistort(&d->camera, u, v, &x, &y) < 0)
        return ARRIS_E_INPUT;
    d->window[0] = fmin(d->window[0], x), d->window[1] = fmin(d->window[1], y);
    d->window[2] = fmax(d->window[2], x), d->window[3] = fmax(d->window[3], y);
    d->edge_r = fmax(d->edge_r, radius_of(&d->camera, x, y));
    return 0;
}

/* The window reaches beyond the picture's border by what the blur needs and more, and the model is
 * followed there as long as it goes on outwards. */
static int find_window(draw *d) {
    const arris_camera *c = &d->camera;
    double w = c->width - 0.5, h = c->height - 0.5, margin = 4 * (d->pad + 8);
    int r = 0;
    d->window[0] = d->window[1] = INFINITY, d->window[2] = d->window[3] = -INFINITY;
    for (int i = 0; i <= 64 && r == 0; i++) {
        double x = -0.5 + (w + 0.5) * i / 64, y = -0.5 + (h + 0.5) * i / 64;
        r = include(d, x, -0.5) | include(d, x, h) | include(d, -0.5, y) | include(d, w, y);
    }
    for (int i = 0; i < 64 && r == 0; i++) {
        double s = d->edge_r, s2 = s * s;
        double slope = 1 + s2 * (3 * c->k1 + s2 * (5 * c->k2 + s2 * 7 * c->k3));
        if (slope > 0.3)
            d->edge_r += margin / 64 / fmax(c->fx, c->fy);
    }
    d->window[0] -= margin, d->window[1] -= margin, d->window[2] += margin, d->window[3] += margin;
    return r;
}

/* ---- making one ------------------------------------------------------------------------------ */

/* Samples of a Gaussian, of unit sum and, to 1e-9, the variance wanted. */
static void make_kernel(draw *d, double variance) {
    double low = 0, high = 2 * variance + 1, k[MAX_RADIUS + 1] = {1};
    d->radius = variance > 0 ? (int)fmin(MAX_RADIUS, ceil(4 * sqrt(variance))) : 0;
    for (int turn = 0; turn < 60 && variance > 0; turn++) {
        double middle = (low + high) / 2, sum = 1, moment = 0;
        for (int i = 1; i <= d->radius; i++) {
            k[i] = exp(-i * i / (2 * middle));
            sum += 2 * k[i];
            moment += 2 * k[i] * i * i;
        }
        *(moment / sum < variance ? &low : &high) = middle;
        for (int i = 0; i <= d->radius; i++)
            d->kernel[i] = (float)((i ? k[i] : 1) / sum);
    }
    if (variance <= 0)
        d->kernel[0] = 1;
}

int draw_new(draw **made, const arris_camera *camera, double psf, fault *f) {
    draw *d = *made = calloc(1, sizeof *d);
    if (!d)
        return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory to draw with");
    d->camera = *camera;
    make_kernel(d, psf * psf + 1. / 12 - 1. / 4);
    d->pad = d->radius + 4;
    d->columns = camera->width + 2 * d->pad;
    d->rows = camera->height + 2 * d->radius;
    d->stride = (d->columns + LANES - 1) / LANES * LANES;
    if (find_window(d) < 0)
        return fault_set(f, ARRIS_E_INPUT, "calibrate it again, or give a smaller picture",
                         "the lens model folds back within the picture");
    size_t n = (size_t)d->stride * (size_t)d->rows;
    d->sum = calloc(n, sizeof *d->sum);
    d->blurred = calloc(n, sizeof *d->blurred);
    return d->sum && d->blurred ? 0 : fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for a picture");
}

void draw_free(draw *d) {
    if (!d)
        return;
    free(d->sum);
    free(d->blurred);
    free(d);
}

const double *draw_window(const draw *d) {
    return d->window;
}

void draw_clear(draw *d) {
    memset(d->sum, 0, (size_t)d->stride * (size_t)d->rows * sizeof *d->sum);
}

/* ---- borders --------------------------------------------------------------------------------- */

/* The integral of the quadratic B-spline from -infinity to t. */
static double spline_integral(double t) {
    if (t <= -1.5)
        return 0;
    if (t >= 1.5)
        return 1;
    if (t < -0.5)
        return (t + 1.5) * (t + 1.5) * (t + 1.5) / 6;
    if (t <= 0.5)
        return 0.5 + t * (0.75 - t * t / 3);
    return 1 - (1.5 - t) * (1.5 - t) * (1.5 - t) / 6;
}

/* One bit of border from (x, y0) to (x, y1), in rows of `sum`. The shares of the rows add up to
 * y1 - y0 over any closed way, so that nothing is left over beside a region. */
static void lay(draw *d, double x, double y0, double y1, double jump) {
    y0 = fmin(fmax(y0, -2), d->rows + 1), y1 = fmin(fmax(y1, -2), d->rows + 1);
    if (y0 == y1 || !(x < d->columns - 4))
        return;
    int first = (int)ceil(fmin(y0, y1) - 1.5), last = (int)floor(fmax(y0, y1) + 1.5);
    x = fmax(x, 1);
    int column = (int)x;
    double t = x - column, s = 1 - t;
    float w[4] = {(float)(jump * s * s * s / 6), (float)(jump * (2. / 3 - t * t * (1 - t / 2))),
                  (float)(jump * (2. / 3 - s * s * (1 - s / 2))), (float)(jump * t * t * t / 6)};
    first = first < 0 ? 0 : first;
    last = last < d->rows ? last : d->rows - 1;
    for (int j = first; j <= last; j++) {
        float *p = d->sum + (ptrdiff_t)j * d->stride + column - 1;
        float share = (float)(spline_integral(y1 - j) - spline_integral(y0 - j));
        for (int i = 0; i < 4; i++)
            p[i] += w[i] * share;
    }
}

void draw_piece(draw *d, double x0, double y0, double x1, double y1, double jump) {
    int n = 1 + (int)fmin(hypot(x1 - x0, y1 - y0) / STEP, MAX_BITS);
    double u0, v0, u1, v1;
    through_lens(d, x0, y0, &u0, &v0);
    for (int i = 1; i <= n; i++) {
        double t = (double)i / n;
        through_lens(d, i < n ? x0 + t * (x1 - x0) : x1, i < n ? y0 + t * (y1 - y0) : y1, &u1, &v1);
        lay(d, (u0 + u1) / 2 + 0.5 + d->pad, v0 + d->radius, v1 + d->radius, jump);
        u0 = u1, v0 = v1;
    }
}

/* ---- the picture ----------------------------------------------------------------------------- */

/* Sums a row up, and blurs it along x. */
static void finish_row(const draw *d, float *row, float *out, double background) {
    double level = background;
    for (int x = 0; x < d->columns; x++) {
        level += (double)row[x];
        row[x] = (float)level;
    }
    const float *in = row + d->pad;
    int width = d->camera.width;
    for (int x = 0; x < width; x++)
        out[x] = d->kernel[0] * in[x];
    for (int i = 1; i <= d->radius; i++)
        for (int x = 0; x < width; x++)
            out[x] += d->kernel[i] * (in[x - i] + in[x + i]);
}

/* Adds noise: the sum of the eight bytes of a random number is normal enough, to 4.9 sigma. */
static void add_noise(float *level, int n, double noise, uint64_t seed) {
    const float scale = (float)(noise / sqrt(8 * 65535. / 12)), middle = 8 * 127.5f;
    for (int x = 0; x < n; x++) {
        uint64_t h = mix_at(seed, (uint64_t)x), even = 0x00ff00ff00ff00ff;
        uint64_t sums = (h & even) + ((h >> 8) & even);
        level[x] += scale * ((float)(int)(sums * 0x0001000100010001 >> 48) - middle);
    }
}

static void to_grey(const float *level, int n, uint8_t *out) {
    for (int x = 0; x < n; x++) {
        float g = level[x] < 0 ? 0 : level[x] > 255 ? 255 : level[x];
        out[x] = (uint8_t)(int)(g + 0.5f);
    }
}

void draw_finish(draw *d, double background, double noise, uint64_t seed, const arris_image *out) {
    int width = d->camera.width;
    for (int y = 0; y < d->rows; y++)
        finish_row(d, d->sum + (ptrdiff_t)y * d->stride, d->blurred + (ptrdiff_t)y * d->stride,
                   background);
    for (int y = 0; y < d->camera.height; y++) {
        const float *in = d->blurred + (ptrdiff_t)(y + d->radius) * d->stride;
        float *level = d->sum; /* its rows are no longer needed */
        for (int x = 0; x < width; x++)
            level[x] = d->kernel[0] * in[x];
        for (int i = 1; i <= d->radius; i++)
            for (int x = 0; x < width; x++)
                level[x] += d->kernel[i] * (in[x - i * d->stride] + in[x + i * d->stride]);
        if (noise > 0)
            add_noise(level, width, noise, mix_at(seed, (uint64_t)y));
        to_grey(level, width, out->data + y * out->stride);
    }
}
