/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * detect.h: the corners of a picture.
 */
#ifndef DETECT_H
#define DETECT_H

#include "arris_types.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { DETECT_HARRIS, DETECT_SHI_TOMASI };

typedef struct detect_params {
    int32_t method;
    double quality;      /* the weakest corner's measure over the strongest's */
    double min_distance; /* px between corners */
} detect_params;

/* Once before the first call of detect_corners: keeps OpenCV to one thread. Returns 0 or
 * ARRIS_E_INTERNAL. */
int detect_setup(void);

/* Fills `out` with the strongest corners of a picture of any size, the strongest first, and counts
 * those that don't fit. Returns 0 or ARRIS_E_INTERNAL (OpenCV failed). */
int detect_corners(const detect_params *p, const arris_image *in, arris_corners *out);

#ifdef __cplusplus
}
#endif
#endif
