/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * follow.c: first all lines are looked for, then each is fitted, so that every fit knows its
 * neighbours (follow.h).
 */
#include "follow.h"

#include <math.h>
#include <stdlib.h>

#define BESIDE 2.0    /* px from a segment within which a piece is its */
#define BEYOND 3.0    /* px that the piece's middle may be beyond the segment's ends */
#define COS_TURN 0.98 /* between their directions: 11 degrees */

enum { MOST = 1024 }; /* lines of a frame */

struct follower {
    support support;
    refit_start start[MOST];
};

follower *follower_new(int width, int height) {
    follower *f = calloc(1, sizeof *f);
    if (f && support_init(&f->support, width, height)) {
        follower_free(f);
        return NULL;
    }
    return f;
}

void follower_free(follower *f) {
    if (!f)
        return;
    support_free(&f->support);
    free(f);
}

/* The rows of the stretch are edge points of the picture. */
static void tell(const support *s, double gradient, refitter *r) {
    for (int v = s->from; v < s->to; v++)
        if (s->row[v].step > 0)
            refitter_add(r, s->columns ? (float)v : s->row[v].u,
                         s->columns ? s->row[v].u : (float)v, (float)gradient);
}

/* The ends as a lens has them. */
static void distort(const arris_camera *lens, arris_segment *s) {
    arris_distort(lens, s->x1, s->y1, &s->x1, &s->y1);
    arris_distort(lens, s->x2, s->y2, &s->x2, &s->y2);
}

void follow(follower *f, const arris_guide *guide, const arris_image *image,
            const arris_camera *camera, double noise, double min_length, refitter *r,
            arris_segments *out) {
    uint32_t n = 0;
    bool bent = image->camera && arris_camera_distorts(image->camera);
    f->support.image = image;
    f->support.lens = bent ? image->camera : NULL;
    for (uint32_t i = 0; i < guide->n && n < MOST; i++)
        if (support_find(&f->support, &guide->item[i], (double)guide->step, min_length,
                         &f->start[n])) {
            tell(&f->support, f->start[n].gradient, r);
            f->start[n++].noise = noise;
        }
    refitter_set_lens(r, f->support.lens);
    for (uint32_t i = 0; i < n && out->n < out->max; i++) {
        arris_segment *s = &out->item[out->n];
        if (!refit(r, &f->start[i], s))
            continue;
        s->chain = UINT32_MAX;
        if (bent && camera && arris_camera_distorts(camera))
            distort(camera, s);
        out->n++;
    }
}

bool follow_has(const arris_segments *found, double x1, double y1, double x2, double y2) {
    double length = sqrt((x2 - x1) * (x2 - x1) + (y2 - y1) * (y2 - y1));
    for (uint32_t i = 0; i < found->n && found->item[i].chain == UINT32_MAX; i++) {
        const arris_segment *s = &found->item[i];
        double dx = s->x2 - s->x1, dy = s->y2 - s->y1, d = hypot(dx, dy);
        double a = ((y1 - s->y1) * dx - (x1 - s->x1) * dy) / d;
        double b = ((y2 - s->y1) * dx - (x2 - s->x1) * dy) / d;
        double middle = (((x1 + x2) / 2 - s->x1) * dx + ((y1 + y2) / 2 - s->y1) * dy) / d;
        if (fabs(a) < BESIDE && fabs(b) < BESIDE && middle > -BEYOND && middle < d + BEYOND &&
            (x2 - x1) * dx + (y2 - y1) * dy > COS_TURN * d * length)
            return true;
    }
    return false;
}
