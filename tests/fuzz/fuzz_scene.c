/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * fuzz_scene.c: any triangles, in any light, before any camera: patches, shadows and a picture.
 */
#include <stdlib.h>
#include <string.h>

#include "arris_geometry.h"
#include "scene/view.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n);

enum { W = 40, H = 30, STRIDE = 64, POINTS = 24, TRIANGLES = 40 };

/* The next byte as a number from -128 to 127; 0 when there is none. */
static double next(const uint8_t **at, size_t *left) {
    if (*left == 0)
        return 0;
    --*left;
    return (double)*(const int8_t *)(*at)++;
}

static mesh read_mesh(const uint8_t **at, size_t *left) {
    static double point[POINTS][3];
    static mesh_triangle triangle[TRIANGLES];
    mesh m = {.point = point, .triangle = triangle};
    while (m.n_points<POINTS && * left> 0) {
        double *p = point[m.n_points++];
        p[0] = 8 * next(at, left), p[1] = 8 * next(at, left), p[2] = 300 + 4 * next(at, left);
        if (m.n_points >= 3 && *left % 4 == 0)
            break;
    }
    while (m.n_points > 0 && m.n_triangles<TRIANGLES && * left> 12) {
        mesh_triangle *t = &triangle[m.n_triangles++];
        for (int k = 0; k < 3; k++)
            t->v[k] = (uint32_t)(128 + next(at, left)) % (uint32_t)m.n_points;
        t->grey = (float)(t->v[0] % 3) / 3;
        if (t->v[0] == t->v[1] || t->v[1] == t->v[2] || t->v[2] == t->v[0])
            m.n_triangles--;
    }
    return m;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n) {
    static uint8_t pixels[STRIDE * (H + 1)];
    arris_camera c = {.width = W, .height = H, .fx = 40, .fy = 39, .cx = 20, .cy = 15, .k1 = -0.1};
    arris_image image = {ARRIS_GREY8, W, H, STRIDE, NULL, pixels};
    mesh m = read_mesh(&data, &n);
    cell set;
    view *v = NULL;
    fault f;
    double light[3] = {next(&data, &n), next(&data, &n), next(&data, &n) + 0.5};
    arris_pose pose = {.valid = true, .C = {next(&data, &n), next(&data, &n), next(&data, &n)}};
    arris_rotation(next(&data, &n) / 40, next(&data, &n) / 40, next(&data, &n) / 40, pose.R);
    view_light shade = {.ambient = 0.3, .background = 10};
    if (m.n_triangles > 0 && cell_build(&set, &m, &f) == 0) {
        if (cell_light_up(&set, light, &f) == 0 && view_new(&v, &set, &c, 0.8, &shade, &f) == 0)
            view_take(v, &pose, 1, 1, &image);
        view_free(v);
        cell_free(&set);
    }
    return 0;
}
