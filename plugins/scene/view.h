/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * view.h: the picture that a camera at a pose takes of a cell.
 */
#ifndef VIEW_H
#define VIEW_H

#include "cell.h"
#include "draw.h"

typedef struct view view;

typedef struct view_light {
    double ambient;    /* 0 to 1: the share of a patch's grey level that needs no light on it */
    double background; /* grey level where there is nothing */
} view_light;

/* The cell must outlive it and no longer change. `camera` and `psf` as in draw_new, `light` is
 * copied. Returns 0, ARRIS_E_INPUT or _MEMORY. */
int view_new(view **made, const cell *c, const arris_camera *camera, double psf,
             const view_light *light, fault *f);
void view_free(view *v);

/* Takes the picture, of the camera's size and grey in 8 bits. The same pose, noise and seed give
 * the same bytes. Allocates nothing. */
void view_take(view *v, const arris_pose *pose, double noise, uint64_t seed,
               const arris_image *out);

#endif
