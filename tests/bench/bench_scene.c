/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * bench_scene.c: what a simulated picture costs, beside what finding its edges does: a camera of
 * 640x480 that sweeps over the sample cell. Both come in turn, in the time of this thread alone,
 * and the ratio is taken picture by picture. A picture that takes more than GOAL is marked.
 */
#include <stdio.h>
#include <time.h>

#include "../strip.h"
#include "camera.h"
#include "edges/canny.h"
#include "scene/view.h"

enum { FRAMES = 300 };
static const double GOAL = 8; /* ms: a quarter of what 30 pictures a second leave */

static double thread_ms(void) {
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

static int by_value(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* The value below which the share q is; sorts. */
static double quantile(double v[FRAMES], double q) {
    qsort(v, FRAMES, sizeof *v, by_value);
    return v[(int)(q * (FRAMES - 1))];
}

static arris_edges edges_new(int width, int height) {
    arris_edges e = {.max = (uint32_t)canny_max_points(width, height),
                     .max_chains = (uint32_t)canny_max_chains(width, height)};
    e.point = malloc(e.max * sizeof *e.point);
    e.chain = malloc(e.max_chains * sizeof *e.chain);
    if (!e.point || !e.chain)
        abort();
    return e;
}

int main(void) {
    static double picture[FRAMES], edges[FRAMES], ratio[FRAMES];
    const view_light light = {.ambient = 0.4, .background = 20};
    const double sun[3] = {0.35, 0.25, 0.9};
    const canny_params params = CANNY_DEFAULTS;
    arris_camera c;
    mesh m;
    cell set;
    view *v;
    fault f;
    if (camera_load("samples/cell/camera.json", &c, &f) ||
        mesh_load(&m, "samples/cell/box.obj", &f) || cell_build(&set, &m, &f) ||
        cell_light_up(&set, sun, &f) || view_new(&v, &set, &c, 0.8, &light, &f)) {
        fprintf(stderr, "bench_scene: %s\n", f.text);
        return 1;
    }
    arris_image image = picture_new(c.width, c.height, ARRIS_GREY8);
    arris_edges found = edges_new(c.width, c.height);
    canny *search = canny_new(c.width, c.height, &params);
    for (int i = 0; i < FRAMES; i++) {
        arris_pose pose = {
            .valid = true, .C = {2.0 * i - FRAMES}, .R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
        double begin = thread_ms();
        view_take(v, &pose, 2, (uint64_t)i, &image);
        double middle = thread_ms();
        canny_run(search, &image, &found);
        picture[i] = middle - begin;
        edges[i] = thread_ms() - middle;
        ratio[i] = picture[i] / edges[i];
    }
    double median = quantile(picture, 0.5);
    printf("a picture of %dx%d: median %.2f ms%s, 99 of 100 within %.2f ms; finding its edges %.2f "
           "ms, %.1f times less\n",
           c.width, c.height, median, median > GOAL ? "!" : "", quantile(picture, 0.99),
           quantile(edges, 0.5), quantile(ratio, 0.5));
    canny_free(search);
    view_free(v);
    cell_free(&set);
    mesh_free(&m);
    free(image.data), free(found.point), free(found.chain);
    return 0;
}
