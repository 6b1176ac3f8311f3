/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * canny.c: Canny's edges, put together: noise, thresholds, gradient, links.
 */
#include "canny.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "link.h"
#include "noise.h"

/* The automatic thresholds, in standard deviations of the gradient's noise. Noise alone exceeds 6
 * of them in exp(-18) of the pixels: in no point of a picture, let alone in a chain. */
static const double LOW = 6, HIGH = 7.5;
/* The least they are, as shares of white: the gradient of a step of 10 levels in 255 behind a lens
 * that blurs by 0.8 px is above them, and what rounding makes of a ramp is not. */
static const double FLOOR_LOW = 2.25 / 255, FLOOR_HIGH = 2.6 / 255;
/* px: the blur of a common lens, with the box of the pixel. */
static const double LENS = 0.85;
/* How many times the noise of pixels smeared noise can be; what is more is texture. In an enlarged
 * picture the pixels tell nothing, so what is below a share of white always counts as noise. */
static const double SMEARED = 3, FAINT = 5. / 255;

struct canny {
    canny_params p;
    gradient g;
    edgels e;
    linker l;
    enum path path;
    float noise;      /* of the last whole picture, grey levels */
    double low, high; /* its thresholds, grey levels per px */
};

size_t canny_max_points(int width, int height) {
    return 64 + (size_t)width * (size_t)height / 8;
}

size_t canny_max_chains(int width, int height) {
    return 16 + canny_max_points(width, height) / 8;
}

bool canny_set_roi(canny_params *p, const char *text, int width, int height) {
    char rest;
    return sscanf(text, "%9d,%9d,%9d,%9d%c", &p->x, &p->y, &p->width, &p->height, &rest) == 4 &&
           p->x >= 0 && p->x < width && p->y >= 0 && p->y < height && p->width > 0 && p->height > 0;
}

canny *canny_new(int width, int height, const canny_params *p) {
    canny *c = calloc(1, sizeof *c);
    if (!c)
        return NULL;
    c->p = *p;
    c->path = path_fastest();
    size_t max = 2 * canny_max_points(width, height);
    c->e.max = (uint32_t)max;
    c->e.item = malloc((max + EDGELS_BATCH) * sizeof *c->e.item);
    c->e.point = malloc((max + EDGELS_BATCH) * sizeof *c->e.point);
    c->e.row = malloc(((size_t)height + EDGELS_AFTER) * sizeof *c->e.row);
    if (c->e.item && c->e.point && c->e.row && gradient_init(&c->g, width, p->sigma) == 0 &&
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
    free(c->e.point);
    free(c->e.row);
    free(c);
}

static int32_t least(int32_t a, int32_t b) {
    return a < b ? a : b;
}

/* The part of `im` that lies in the region of interest. */
static arris_image crop(const arris_image *im, const canny_params *p) {
    arris_image part = *im;
    if (p->width == 0)
        return part;
    int x0 = least(p->x, im->width), y0 = least(p->y, im->height);
    part.width = least(p->width, im->width - x0);
    part.height = least(p->height, im->height - y0);
    part.data += y0 * im->stride + x0 * (int)im->format;
    return part;
}

/* Sets the thresholds where they are automatic. */
static void set_thresholds(canny *c, const arris_image *im, int white) {
    double most = fmax(SMEARED * (double)c->noise, FAINT * white);
    double g = fmin(noise_of_gradients(im, white, c->p.sigma), most);
    g *= gradient_noise(&c->g);
    c->low = c->p.low >= 0 ? c->p.low : fmax(LOW * g, FLOOR_LOW * white);
    c->high = c->p.high >= 0 ? c->p.high : fmax(fmax(HIGH * g, FLOOR_HIGH * white), c->low);
    c->low = fmin(c->low, c->high);
}

/* Sets what is asked of an edge in this picture. Returns the shift of its gradients. */
static int begin(canny *c, const arris_image *im, const arris_image *part, arris_edges *out) {
    int shift = gradient_shift(part), white = (1 << (GRADIENT_BITS - shift)) - 1;
    c->noise = noise_of_pixels(part, white);
    set_thresholds(c, part, white);
    out->n = out->lost = out->n_chains = out->lost_chains = 0;
    out->camera = im->camera;
    out->noise = c->noise;
    return shift;
}

void canny_skip(canny *c, const arris_image *im, arris_edges *out) {
    arris_image part = crop(im, &c->p);
    begin(c, im, &part, out);
}

void canny_run(canny *c, const arris_image *im, arris_edges *out) {
    arris_image part = crop(im, &c->p);
    int shift = begin(c, im, &part, out);
    gradient_edgels(&c->g, &part, shift, (float)(c->low / gradient_unit(shift)), (float)c->p.x,
                    (float)c->p.y, &c->e, c->path);
    link_edgels(&c->l, &c->e, part.height, c->path);
    link_chains(&c->l, &c->e, (float)c->high, (uint32_t)c->p.min_length, out);
    out->lost += c->e.lost;
}

float canny_least_step(const canny *c) {
    double square = LENS * LENS + c->p.sigma * c->p.sigma + 1. / 3; /* central differences */
    return (float)(c->low * sqrt(2 * M_PI * square));
}
