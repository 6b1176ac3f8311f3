/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * grey.c: displacements as grey levels (thesis, section 2.3).
 */
#include "grey.h"

#include <math.h>

static uint8_t level(double share) {
    double g = GREY_NONE + share * (share < 0 ? GREY_NONE : 255 - GREY_NONE);
    return (uint8_t)lround(fmin(fmax(g, 0), 255));
}

void grey_of(const float *px, size_t n, double range, uint8_t *grey) {
    for (size_t i = 0; i < n; i++)
        grey[i] = isnan(px[i]) ? GREY_NONE : level((double)px[i] / range);
}
