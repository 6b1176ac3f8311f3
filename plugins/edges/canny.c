/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * canny.c: Canny's edges, put together: noise, thresholds, gradient, links.
 */
#include "canny.h"

#include <math.h>
#include <stdlib.h>

#include "link.h"
#include "noise.h"

/* The automatic thresholds, in standard deviations of the gradient's noise, and the least they can
 * be, as a share of white: for pictures without noise, where rounding makes steps of one level. */
static const double LOW = 6, HIGH = 7.5, FLOOR_LOW = 2.25 / 255, FLOOR_HIGH = 2.6 / 255;

struct canny {
    canny_params p;
    gradient g;
    edgels e;
    linker l;
    enum path path;
};

size_t canny_max_points(int width, int height) {
    return 64 + (size_t)width * (size_t)height / 8;
}

size_t canny_max_chains(int width, int height) {
    return 16 + canny_max_points(width, height) / 8;
}

canny *canny_new(int width, int height, const canny_params *p) {
    canny *c = calloc(1, sizeof *c);
    if (!c)
        return NULL;
    c->p = *p;
    c->path = path_fastest();
    size_t max = 2 * canny_max_points(width, height);
    c->e.max = (uint32_t)max;
    c->e.item = malloc(max * sizeof *c->e.item);
    c->e.row = malloc(((size_t)height + 1) * sizeof *c->e.row);
    if (c->e.item && c->e.row && gradient_init(&c->g, width, p->sigma) == 0 &&
        link_init(&c->l, width, max) == 0)
        return c;
    canny_free(c);
    return NULL;
}

bool canny_set_path(canny *c, enum path path) {
    if (path_available(path))
        c->path = path;
    return c->path == path;
}

void canny_free(canny *c) {
    if (!c)
        return;
    gradient_free(&c->g);
    link_free(&c->l);
    free(c->e.item);
    free(c->e.row);
    free(c);
}

/* The part of `im` inside roi (x, y, width, height). */
static arris_image crop(const arris_image *im, const int32_t roi[4]) {
    arris_image part = *im;
    if (roi[2] == 0)
        return part;
    int x0 = roi[0] < im->width ? roi[0] : im->width,
        y0 = roi[1] < im->height ? roi[1] : im->height;
    part.width = roi[2] < im->width - x0 ? roi[2] : im->width - x0;
    part.height = roi[3] < im->height - y0 ? roi[3] : im->height - y0;
    part.data += y0 * im->stride + x0 * (int)im->format;
    return part;
}

void canny_run(canny *c, const arris_image *im, arris_edges *out) {
    const int32_t *roi = c->p.roi;
    arris_image part = crop(im, roi);
    int shift = gradient_shift(&part), white = (1 << (GRADIENT_BITS - shift)) - 1;
    float unit = gradient_unit(shift);
    out->n = out->lost = out->n_chains = out->lost_chains = 0;
    out->camera = im->camera;
    out->noise = noise_of_pixels(&part, white);
    double noise = noise_of_gradients(&part, white, c->p.sigma) * gradient_noise(&c->g);
    double high = c->p.high >= 0 ? c->p.high : fmax(HIGH * noise, FLOOR_HIGH * white);
    double low = c->p.low >= 0 ? c->p.low : fmin(fmax(LOW * noise, FLOOR_LOW * white), high);
    gradient_edgels(&c->g, &part, shift, (float)low / unit, &c->e, c->path);
    link_edgels(&c->l, &c->e, part.height);
    link_chains(&c->l, &c->e, unit, (float)high / unit, (uint32_t)c->p.min_length,
                roi[2] ? (float)roi[0] : 0, roi[2] ? (float)roi[1] : 0, out, c->path);
    out->lost += c->e.lost;
}
