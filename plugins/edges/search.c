/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * search.c: guided search in the runtime (search.h).
 */
#include "search.h"

void search_settle(search *e, bool in_part, arris_layers *l) {
    e->guided = e->guided && !in_part;
    if (e->guided)
        return;
    l->wants = l->asks = 0;
    l->gives = ARRIS_BIT(ARRIS_EDGES);
}

static bool can_be_guided(const arris_stage *s, const arris_caps *caps) {
    return caps->camera && arris_has(s, ARRIS_POSE) && arris_has_feedback(s, ARRIS_LINES) &&
           arris_wanted(s, ARRIS_GUIDE);
}

int search_setup(arris_stage *s, search *e, const canny_params *p, const arris_caps *caps) {
    bool guided = e->guided && can_be_guided(s, caps);
    e->canny = canny_new(caps->width, caps->height, p);
    e->guide = guided ? guide_new(caps->camera) : NULL;
    if (!e->canny || (guided && !e->guide))
        return arris_fail(s, ARRIS_E_MEMORY, NULL, "no memory for the edges of a picture");
    int r = e->guided ? arris_reserve(s, ARRIS_GUIDE, guided ? GUIDE_LINES : 1, 0) : 0;
    return r < 0 ? r
                 : arris_reserve(s, ARRIS_EDGES, canny_max_points(caps->width, caps->height),
                                 canny_max_chains(caps->width, caps->height));
}

/* Searches the picture, unless the guide says where lines are. */
static void search_guided(arris_stage *s, search *e, arris_frame *f, arris_edges *out) {
    const arris_image *image = arris_layer_get(f, ARRIS_IMAGE);
    const arris_lines *lines = arris_feedback(s, ARRIS_LINES);
    arris_guide *foreseen = arris_layer_give(s, f, ARRIS_GUIDE);
    if (!guide_decide(e->guide, lines, arris_layer_get(f, ARRIS_POSE), foreseen)) {
        canny_run(e->canny, image, out);
        e->searched = arris_frame_seq(f);
        return;
    }
    canny_skip(e->canny, image, out);
    foreseen->searched = e->searched;
    foreseen->step = canny_least_step(e->canny);
    arris_count(s, "pictures not searched", 1);
    arris_count(s, "lines foreseen", foreseen->n);
}

int search_run(arris_stage *s, search *e, arris_frame *f) {
    arris_edges *out = arris_layer_give(s, f, ARRIS_EDGES);
    if (e->guide)
        search_guided(s, e, f, out);
    else
        canny_run(e->canny, arris_layer_get(f, ARRIS_IMAGE), out);
    if (out->lost)
        arris_count(s, "points lost", out->lost);
    return 0;
}

void search_free(search *e) {
    canny_free(e->canny);
    guide_free(e->guide);
}
