/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * board.h: simulated views of a chessboard, for the tests of `arris calibrate`.
 */
#ifndef BOARD_H
#define BOARD_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../plugins/calibrate/fit.h"
#include "chance.h"

static const arris_camera lens = {640,   480,   660,  658,    0.3,   310,
                                  236.5, -0.25, 0.12, 0.0006, -4e-4, 0.02};

/* The board's middle at (x, y, z) mm before the camera, turned by the rotation vector. */
static inline cal_pose board_at(const cal_board *b, double x, double y, double z, double wx,
                                double wy, double wz) {
    const double w[3] = {wx, wy, wz},
                 middle[3] = {(b->cols - 1) * b->square / 2, (b->rows - 1) * b->square / 2, 0};
    cal_pose p = {.t = {x, y, z}};
    cal_rotation(w, p.R);
    for (int i = 0; i < 3; i++)
        p.t[i] -= arris_dot(p.R + 3 * i, middle);
    return p;
}

/* Tilted by up to 40 degrees to any side, near and far, all over the picture. */
static inline cal_pose any_pose(const cal_board *b) {
    const double z = 450 + 250 * uniform(), x = 0.25 * z * (2 * uniform() - 1),
                 y = 0.15 * z * (2 * uniform() - 1), tilt = 0.2 + 0.5 * uniform(),
                 to = 2 * M_PI * uniform();
    return board_at(b, x, y, z, tilt * cos(to), tilt * sin(to), 0.5 * (2 * uniform() - 1));
}

/* Fills the corners of a view of the board at `pose`, with noise in px. */
static inline void see(const cal_board *b, const double *shape, const arris_camera *c,
                       const cal_pose *pose, double noise, double *corner) {
    double k[CAL_N];
    cal_from_camera(c, k);
    for (int i = 0; i < cal_corners(b); i++) {
        double X[3], p[2];
        cal_corner(b, shape, i, X, NULL);
        if (!cal_project(k, pose, X, p, NULL, NULL, NULL))
            abort();
        corner[2 * i] = p[0] + noise * normal();
        corner[2 * i + 1] = p[1] + noise * normal();
    }
}

enum { BOARD_VIEWS = 40, BOARD_CORNERS = 200 };

typedef struct shots {
    cal_board board;
    cal_options options;
    int n;
    cal_view view[BOARD_VIEWS];
    double corner[BOARD_VIEWS][2 * BOARD_CORNERS];
    char name[BOARD_VIEWS][16];
} shots;

/* n views of a 9x6 board at any poses. */
static inline void shoot(shots *s, int n, double noise) {
    memset(s, 0, sizeof *s);
    s->board = (cal_board){9, 6, 30};
    s->options.width = lens.width;
    s->options.height = lens.height;
    s->n = n;
    for (int i = 0; i < n; i++) {
        cal_pose p = any_pose(&s->board);
        snprintf(s->name[i], sizeof s->name[i], "view %d", i);
        s->view[i].name = s->name[i];
        s->view[i].corner = s->corner[i];
        see(&s->board, NULL, &lens, &p, noise, s->corner[i]);
    }
}

/* ---- pictures ------------------------------------------------------------------------------- */

/* The share of light that comes from the board's plane at (x, y) mm: squares, a margin of one
 * square around, and a grey room. The square in the corner is dark, so that of the inner corners 0,
 * 1, cols and cols + 1 is dark as well. */
static inline double board_light(const cal_board *b, double x, double y) {
    const double u = x / b->square + 1, v = y / b->square + 1;
    if (u < -1 || v < -1 || u > b->cols + 2 || v > b->rows + 2)
        return 0.4;
    if (u < 0 || v < 0 || u > b->cols + 1 || v > b->rows + 1)
        return 0.9;
    return ((int)floor(u) + (int)floor(v)) % 2 ? 0.9 : 0.1;
}

/* The light along the ray (x, y, 1) of a camera whose board is at p. */
static inline double light_along(const cal_board *b, const cal_pose *p, double x, double y) {
    const cal_pose camera = cal_inverse(p); /* its centre is camera.t, its axes are the columns */
    const double *R = camera.R, *C = camera.t, ray[3] = {x, y, 1};
    const double s = -C[2] / arris_dot(R + 6, ray);
    return s > 0 ? board_light(b, C[0] + s * arris_dot(R, ray), C[1] + s * arris_dot(R + 3, ray))
                 : 0.4;
}

/* Renders the view, each pixel from 6x6 rays, as a PGM file. */
static inline void render(const char *path, const cal_board *b, const arris_camera *c,
                          const cal_pose *p, double noise) {
    enum { RAYS = 6 };
    FILE *f = fopen(path, "wb");
    if (!f)
        abort();
    fprintf(f, "P5\n%d %d\n255\n", c->width, c->height);
    for (int i = 0; i < c->width * c->height; i++) {
        double x[3], y[3], light = 0; /* of the pixel, and one to the right and one below */
        for (int k = 0; k < 3; k++) {
            arris_undistort(c, i % c->width + (k == 1), i / c->width + (k == 2), &x[k], &y[k]);
            y[k] = (y[k] - c->cy) / c->fy;
            x[k] = (x[k] - c->cx - c->skew * y[k]) / c->fx;
        }
        for (int k = 0; k < RAYS * RAYS; k++) {
            const double u = (k % RAYS + 0.5) / RAYS - 0.5, v = (k / RAYS + 0.5) / RAYS - 0.5;
            light += light_along(b, p, x[0] + u * (x[1] - x[0]) + v * (x[2] - x[0]),
                                 y[0] + u * (y[1] - y[0]) + v * (y[2] - y[0]));
        }
        const double level = 230 * light / (RAYS * RAYS) + 10 + noise * normal();
        fputc((int)fmin(255, fmax(0, round(level))), f);
    }
    if (fclose(f))
        abort();
}

#endif
