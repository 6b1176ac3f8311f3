/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * beside.c: takes out of a line's views what lies beside its edge.
 */
#include "beside.h"

#include "line.h"

static void list_views(const line *l, beside_view v[LINE_KEPT]) {
    for (uint32_t i = 0; i < l->n_kept; i++) {
        const view *k = &l->kept[i];
        v[i] = (beside_view){
            (double)k->blur, {(double)k->beside[0], (double)k->beside[1]}, l->inlier[i]};
    }
}

double line_blur(const line *l, double *weight) {
    beside_view v[LINE_KEPT];
    list_views(l, v);
    return beside_blur(v, l->n_kept, weight);
}

/* A view as one that is elsewhere; the views that are not kept with it likewise. */
static void move(line *l, uint32_t i, const scene *s, const beside_move *to) {
    pose_noise reported = s->noise;
    linear r;
    double before = l->kept[i].cov[0];
    reported.corrected = false;
    if (l->rest[i].n > 0 && view_linearise(&l->kept[i], &l->f, l->x, &reported, &r)) {
        info_move(&l->rest[i], &r, l->x, to->px);
        info_weigh(&l->rest[i], before / (before + to->variance));
    }
    view_move(&l->kept[i], to->px, to->variance, to->share);
}

void line_clear(line *l, const scene *s, double usual) {
    beside_view v[LINE_KEPT];
    beside_move to[LINE_KEPT];
    list_views(l, v);
    if (!beside_find(v, l->n_kept, usual, to))
        return;
    for (uint32_t i = 0; i < l->n_kept; i++)
        if (to[i].variance > 0)
            move(l, i, s, &to[i]);
    line_refine(l, s);
}
