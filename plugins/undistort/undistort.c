/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * undistort.c: the stage `undistort`: takes out the lens (Bouguet's model; thesis, section 2.2).
 * After `edges` it moves the edge points, which is faster and loses nothing (inverse.h); before, it
 * resamples the picture (remap.h). What it gives follows the ideal camera.
 */
#include "arris_plugin.h"

#include "inverse.h"
#include "remap.h"

enum { AUTO, POINTS, IMAGE };

struct undistort {
    int32_t what;
    arris_camera lens, ideal;
    inverse *inverse;
    remap *remap;
};

static const arris_prop props[] = {
    ARRIS_P_ENUM(struct undistort, what, "what", "auto", "auto|points|image",
                 "points after `edges`, otherwise the image"),
};

static int settle(arris_stage *s, void *self, arris_layers *l) {
    struct undistort *u = self;
    if (u->what == AUTO)
        u->what = arris_has(s, ARRIS_EDGES) ? POINTS : IMAGE;
    l->needs = l->gives = ARRIS_BIT(u->what == POINTS ? ARRIS_EDGES : ARRIS_IMAGE);
    l->wants = 0;
    return 0;
}

static int setup(arris_stage *s, void *self, arris_caps *caps) {
    struct undistort *u = self;
    if (!caps->camera)
        return arris_fail(s, ARRIS_E_INPUT,
                          "put a camera.json beside the images, or take undistort out",
                          "the camera's lens is not known");
    u->lens = *caps->camera;
    u->ideal = arris_camera_ideal(&u->lens);
    size_t chains = 0, points = arris_capacity(s, ARRIS_EDGES, &chains);
    if (!arris_camera_distorts(&u->lens))
        return arris_reserve(s, u->what == POINTS ? ARRIS_EDGES : ARRIS_IMAGE, 1, 1);
    if (u->what == POINTS) {
        u->inverse = inverse_new(&u->lens);
    } else {
        u->remap = remap_new(&u->lens);
        caps->camera = &u->ideal;
    }
    if (!u->inverse && !u->remap)
        return arris_fail(s, ARRIS_E_MEMORY, NULL, "no memory for the map of the lens");
    return u->what == POINTS ? arris_reserve(s, ARRIS_EDGES, points, chains)
                             : arris_reserve(s, ARRIS_IMAGE, 0, 0);
}

static int undistort_points(arris_stage *s, struct undistort *u, arris_frame *f,
                            const arris_edges *in) {
    arris_edges *out = arris_layer_give(s, f, ARRIS_EDGES);
    uint32_t dropped = inverse_edges(u->inverse, in, &u->ideal, out);
    if (dropped)
        arris_count(s, "points outside of the lens", dropped);
    if (out->lost > in->lost)
        arris_count(s, "points lost", out->lost - in->lost);
    return 0;
}

static int undistort_image(arris_stage *s, struct undistort *u, arris_frame *f,
                           const arris_image *in) {
    arris_image *out = arris_layer_give(s, f, ARRIS_IMAGE);
    out->camera = &u->ideal;
    if (remap_image(u->remap, in, out))
        return arris_fail(s, ARRIS_E_INTERNAL, NULL, "OpenCV cannot resample the picture");
    return 0;
}

static int process(arris_stage *s, void *self, arris_frame *f) {
    struct undistort *u = self;
    const arris_edges *edges = arris_layer_get(f, ARRIS_EDGES);
    const arris_image *image = arris_layer_get(f, ARRIS_IMAGE);
    const arris_camera *lens = u->what == POINTS ? edges->camera : image->camera;
    if (lens && !arris_camera_distorts(lens)) /* it is ideal already */
        return 0;
    if (!arris_camera_same(lens, &u->lens))
        return arris_fail(s, ARRIS_E_INPUT, "put it right behind the stage whose layer it undoes",
                          "the lens is not the one that the stream has here");
    return u->what == POINTS ? undistort_points(s, u, f, edges) : undistort_image(s, u, f, image);
}

static void close_undistort(arris_stage *s, void *self) {
    struct undistort *u = self;
    (void)s;
    inverse_free(u->inverse);
    remap_free(u->remap);
}

const arris_stage_desc stage_undistort = {
    .size = sizeof(arris_stage_desc),
    .name = "undistort",
    .summary = "takes out the lens: of the edge points after `edges`, otherwise of the picture",
    .example = "imagesrc location=frames.csv ! edges ! undistort ! fakesink",
    .layers = {.wants = ARRIS_BIT(ARRIS_IMAGE) | ARRIS_BIT(ARRIS_EDGES),
               .gives = ARRIS_BIT(ARRIS_IMAGE) | ARRIS_BIT(ARRIS_EDGES)},
    .self_size = sizeof(struct undistort),
    .props = props,
    .n_props = sizeof props / sizeof *props,
    .settle = settle,
    .setup = setup,
    .process = process,
    .close = close_undistort,
};
