/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * regions.c: rectangles that are joined where they overlap (regions.h).
 */
#include "regions.h"

#include <math.h>

#define MOST 0.6 /* of the picture: more of it is no cheaper than all */

void regions_clear(regions *r, int width, int height) {
    *r = (regions){.width = width, .height = height};
}

static int32_t least(int32_t a, int32_t b) {
    return a < b ? a : b;
}

static int32_t most(int32_t a, int32_t b) {
    return a > b ? a : b;
}

/* What both span, with no gap. */
static canny_region hull(const canny_region *a, const canny_region *b) {
    int32_t x = least(a->x, b->x), y = least(a->y, b->y);
    return (canny_region){x, y, most(a->x + a->width, b->x + b->width) - x,
                          most(a->y + a->height, b->y + b->height) - y};
}

static bool overlap(const canny_region *a, const canny_region *b) {
    canny_region h = hull(a, b);
    return h.width < a->width + b->width && h.height < a->height + b->height;
}

static int64_t area(const canny_region *a) {
    return (int64_t)a->width * a->height;
}

static int32_t to_pixel(double v, int32_t size) {
    return (int32_t)fmax(0, fmin(size, floor(v)));
}

void regions_add(regions *r, double x0, double y0, double x1, double y1, double margin) {
    canny_region a;
    if (r->full)
        return;
    a.x = to_pixel(fmin(x0, x1) - margin, r->width);
    a.y = to_pixel(fmin(y0, y1) - margin, r->height);
    a.width = to_pixel(fmax(x0, x1) + margin + 1, r->width) - a.x;
    a.height = to_pixel(fmax(y0, y1) + margin + 1, r->height) - a.y;
    if (a.width <= 0 || a.height <= 0)
        return;
    for (uint32_t i = 0; i < r->n; i++)
        if (overlap(&a, &r->item[i])) { /* the larger one may overlap others */
            a = hull(&a, &r->item[i]);
            r->area -= area(&r->item[i]);
            r->item[i] = r->item[--r->n];
            i = UINT32_MAX;
        }
    r->full = r->n == REGIONS;
    if (r->full)
        return;
    r->item[r->n++] = a;
    r->area += area(&a);
    r->full = (double)r->area > MOST * r->width * r->height;
}

bool regions_have(const regions *r, double x0, double y0, double x1, double y1, double margin) {
    double left = (x0 < x1 ? x0 : x1) - margin, right = (x0 < x1 ? x1 : x0) + margin;
    double top = (y0 < y1 ? y0 : y1) - margin, bottom = (y0 < y1 ? y1 : y0) + margin;
    for (uint32_t i = 0; i < r->n; i++) {
        const canny_region *a = &r->item[i];
        if (left >= a->x && right < a->x + a->width && top >= a->y && bottom < a->y + a->height)
            return true;
    }
    return false;
}
