/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * regions.h: parts of a picture, as a few rectangles that do not overlap.
 */
#ifndef REGIONS_H
#define REGIONS_H

#include "canny.h"

enum { REGIONS = 32 };

typedef struct regions {
    int32_t width, height; /* of the picture, px */
    int64_t area;          /* px² */
    uint32_t n;
    bool full; /* they come near the whole picture, or are too many: more is not taken in */
    canny_region item[REGIONS];
} regions;

void regions_clear(regions *r, int width, int height);

/* Takes in the rectangle from corner to corner, and `margin` px around it. */
void regions_add(regions *r, double x0, double y0, double x1, double y1, double margin);

/* Whether the stretch from (x0, y0) to (x1, y1) and `margin` px around it lie in one of them. */
bool regions_have(const regions *r, double x0, double y0, double x1, double y1, double margin);

#endif
