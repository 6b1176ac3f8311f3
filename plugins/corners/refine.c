/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * refine.c: Förstner's point (1987): the gradient g at every pixel p of an edge is perpendicular to
 * the edge, so the corner q, where the edges meet, minimises the sum of w (g (p - q))². The weight
 * leaves out the corner's own pixels: blur rounds a corner, and they would pull it inwards, which
 * is why cv::cornerSubPix is off by 0.2 px at the corner of a rectangle.
 */
#include "refine.h"

#include <math.h>

enum {
    REACH = 6, /* px to each side */
    ROUNDS = 10
};

static const double spread = 2.2; /* px, sigma of the weight */
static const double still = 0.01; /* px, a step that ends it */
static const double strayed = 3;  /* px, further from the first place it is another corner */

/* The sums of w g g' and of w g g' p; p counts from the present place. */
typedef struct sums {
    double xx, xy, yy, x, y;
} sums;

static double grey(const arris_image *im, int x, int y) {
    const uint8_t *row = im->data + y * im->stride;
    return im->format == ARRIS_GREY8 ? row[x] : ((const uint16_t *)(const void *)row)[x];
}

/* Scharr's gradient: its direction is true at any angle. dx, dy step along it, 1, 0 or 0, 1. */
static double gradient(const arris_image *im, int x, int y, int dx, int dy) {
    double sum = 0;
    for (int k = -1; k <= 1; k++)
        sum += (k ? 3 : 10) * (grey(im, x + dx + k * dy, y + dy + k * dx) -
                               grey(im, x - dx + k * dy, y - dy + k * dx));
    return sum;
}

/* Adds the pixel (x, y), which lies at (dx, dy) from the corner's present place. */
static void add(sums *s, const arris_image *im, int x, int y, double dx, double dy) {
    double r2 = dx * dx + dy * dy, w = r2 * exp(-r2 / (2 * spread * spread));
    double gx = gradient(im, x, y, 1, 0), gy = gradient(im, x, y, 0, 1), g = gx * dx + gy * dy;
    s->xx += w * gx * gx;
    s->xy += w * gx * gy;
    s->yy += w * gy * gy;
    s->x += w * gx * g;
    s->y += w * gy * g;
}

static int most(int a, int b) {
    return a > b ? a : b;
}

static sums sums_around(const arris_image *im, double x, double y) {
    sums s = {0};
    int x0 = (int)lround(x), y0 = (int)lround(y);
    for (int v = most(y0 - REACH, 1); v <= y0 + REACH && v < im->height - 1; v++)
        for (int u = most(x0 - REACH, 1); u <= x0 + REACH && u < im->width - 1; u++)
            add(&s, im, u, v, u - x, v - y);
    return s;
}

void refine_corner(const arris_image *im, arris_corner *c) {
    double x = (double)c->x, y = (double)c->y, step = 1;
    for (int i = 0; i < ROUNDS && step > still; i++) {
        sums s = sums_around(im, x, y);
        double det = s.xx * s.yy - s.xy * s.xy;
        if (!(det > 1e-3 * (s.xx + s.yy) * (s.xx + s.yy))) /* one edge, or none */
            return;
        double dx = (s.yy * s.x - s.xy * s.y) / det, dy = (s.xx * s.y - s.xy * s.x) / det;
        step = hypot(dx, dy);
        x += dx;
        y += dy;
        if (!(hypot(x - (double)c->x, y - (double)c->y) < strayed))
            return;
    }
    c->x = (float)x;
    c->y = (float)y;
}
