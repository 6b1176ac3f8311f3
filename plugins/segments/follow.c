/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * follow.c: every foreseen line is looked for, then fitted (follow.h).
 */
#include "follow.h"

/* The ends as a lens has them. */
static void distort(const arris_camera *camera, arris_segment *s) {
    arris_distort(camera, s->x1, s->y1, &s->x1, &s->y1);
    arris_distort(camera, s->x2, s->y2, &s->x2, &s->y2);
}

void follow(support *s, const arris_guide *guide, const arris_image *image,
            const arris_camera *camera, double noise, double min_length, refitter *r,
            arris_segments *out) {
    bool bent = image->camera && arris_camera_distorts(image->camera);
    s->image = image;
    s->lens = bent ? image->camera : NULL;
    refitter_set_lens(r, s->lens);
    for (uint32_t i = 0; i < guide->n && out->n < out->max; i++) {
        const arris_foreseen *line = &guide->item[i];
        arris_segment *found = &out->item[out->n];
        refit_start start;
        if (!support_find(s, line, (double)guide->step, min_length, &start))
            continue;
        start.noise = noise;
        start.dx = line->dx, start.dy = line->dy;
        if (!refit(r, &start, found))
            continue;
        found->chain = UINT32_MAX;
        if (bent && camera && arris_camera_distorts(camera))
            distort(camera, found);
        out->n++;
    }
}
