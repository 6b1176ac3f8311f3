/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * scene.c: renders exact scans.
 */
#include "scene.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "scan.h"

/* ---- chance, the same in every run
 * --------------------------------------------------------------------------------- */

/* splitmix64 (Steele, Lea and Flood, 2014): any seed is a good one. */
static double rng_uniform(uint64_t *state) {
    uint64_t z = *state += 0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return (double)((z ^ z >> 31) >> 11) * 0x1p-53;
}

/* Box and Muller. */
static double rng_normal(uint64_t *state) {
    double a = rng_uniform(state), b = rng_uniform(state);
    return sqrt(-2 * log(1 - a)) * cos(2 * M_PI * b);
}

static double between(uint64_t *seed, double low, double high) {
    return low + (high - low) * rng_uniform(seed);
}

/* ---- the scene ------------------------------------------------------------------------------ */

motion motion_along_x(int frames, double step) {
    return (motion){
        .frames = frames, .from = {-(frames - 1) / 2. * step, 0, 0}, .step = {step, 0, 0}};
}

scene scene_new(void) {
    return (scene){.camera = {.width = 320,
                              .height = 240,
                              .fx = 380.60892,
                              .fy = 378.42038,
                              .skew = 0.05367,
                              .cx = 153.27998,
                              .cy = 119.84683},
                   .ground = 110,
                   .psf = 0.8,
                   .noise = 2};
}

void scene_add(scene *s, double x, double y, double z, double a, double b, double angle,
               double level) {
    static const double sign[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    plate *p = &s->plate[s->n++];
    double c = cos(angle), d = sin(angle);
    for (int k = 0; k < 4; k++) {
        double u = sign[k][0] * a, v = sign[k][1] * b;
        memcpy(p->corner[k], (double[3]){x + c * u - d * v, y + d * u + c * v, z},
               sizeof p->corner[k]);
    }
    p->level = level;
}

void scene_scatter(scene *s, double near, double far, uint64_t seed) {
    for (int i = 0; i < 6; i++) {
        double z = between(&seed, near, far), angle = between(&seed, -0.3, 0.3);
        double x = 0.23 * (i % 3 - 1), y = i < 3 ? -0.14 : 0.14; /* of the picture at z = 1 */
        double a = between(&seed, 0.05, 0.08), b = between(&seed, 0.06, 0.09);
        double level = (rng_uniform(&seed) < 0.5 ? 30 : 215) + between(&seed, -12, 12);
        scene_add(s, x * z, y * z, z, a * z, b * z, angle, level);
    }
}

void scene_column(scene *s, double z, uint64_t seed) {
    double half = SCENE_COLUMN_LENGTH / 2 * z;
    for (int i = -1; i <= 1; i++)
        scene_add(s, between(&seed, -5, 5), 0.2 * i * z, z, half, half, between(&seed, -0.2, 0.2),
                  s->ground + 105);
}

/* Sigma of the blurred step, px. */
static double scene_blur(const scene *s) {
    return sqrt(s->psf * s->psf + 1. / 12);
}

double bound_offset(const scene *s, double contrast, double length) {
    double information = 1 / (2 * sqrt(M_PI) * scene_blur(s)) - 1 / (2 * 7.);
    return sqrt((s->noise * s->noise + 1. / 12) / ((length - 5) * information)) / contrast;
}

double bound_depth(const scene *s, const motion *m, int frames, double z, double offset) {
    double f = s->camera.fx, n = frames, spread = m->step[0] * sqrt((n * n - 1) / 12);
    return hypot(offset, f * m->jitter / z) * z * z / (f * sqrt(n) * spread);
}

/* ---- a picture ------------------------------------------------------------------------------ */

/* A side of a plate in the picture: u x + v y + w is the distance to it, inwards, in sigmas. */
typedef struct side {
    double u, v, w;
} side;

static const double REACH = 6; /* sigmas: beyond it a step is over to 1e-9 */

/* The share of a pixel that the plate covers. */
static double cover(const side of[4], double x, double y) {
    double share = 1;
    for (int k = 0; k < 4 && share > 0; k++) {
        double d = of[k].u * x + of[k].v * y + of[k].w;
        if (d < REACH)
            share *= d < -REACH ? 0 : 0.5 * erfc(-d * M_SQRT1_2);
    }
    return share;
}

/* The sides of the plate as `pose` sees it. */
static void sides_of(const scene *s, const plate *p, const arris_pose *pose, side of[4]) {
    double q[4][2], middle[2] = {0, 0}, blur = scene_blur(s);
    for (int k = 0; k < 4; k++) {
        if (arris_project(&s->camera, pose, p->corner[k], &q[k][0], &q[k][1]) <= 0)
            die("a plate lies behind the camera");
        middle[0] += q[k][0] / 4;
        middle[1] += q[k][1] / 4;
    }
    for (int k = 0; k < 4; k++) {
        const double *a = q[k], *b = q[(k + 1) % 4];
        double n = hypot(b[0] - a[0], b[1] - a[1]) * blur;
        of[k].u = -(b[1] - a[1]) / n;
        of[k].v = (b[0] - a[0]) / n;
        of[k].w = -of[k].u * a[0] - of[k].v * a[1];
        if (of[k].u * middle[0] + of[k].v * middle[1] + of[k].w < 0)
            of[k].u *= -1, of[k].v *= -1, of[k].w *= -1;
    }
}

static void draw(const scene *s, const arris_pose *pose, uint64_t *seed, uint8_t *pixel) {
    side of[SCENE_PLATES][4];
    for (int i = 0; i < s->n; i++)
        sides_of(s, &s->plate[i], pose, of[i]);
    for (int y = 0; y < s->camera.height; y++)
        for (int x = 0; x < s->camera.width; x++) {
            double g = s->ground;
            for (int i = 0; i < s->n; i++)
                g += (s->plate[i].level - g) * cover(of[i], x, y);
            g += s->noise * rng_normal(seed);
            *pixel++ = (uint8_t)fmax(0, fmin(255, rint(g)));
        }
}

/* ---- the scan ------------------------------------------------------------------------------- */

static void write_camera(const arris_camera *c, const char *folder) {
    FILE *f = create("%s/camera.json", folder);
    fprintf(f,
            "{\"width\": %d, \"height\": %d, \"fx\": %.9g, \"fy\": %.9g, \"skew\": %.9g, "
            "\"cx\": %.9g, \"cy\": %.9g, \"k1\": 0, \"k2\": 0, \"p1\": 0, \"p2\": 0, \"k3\": 0}\n",
            c->width, c->height, c->fx, c->fy, c->skew, c->cx, c->cy);
    finish(f);
}

static void write_picture(const arris_camera *c, const uint8_t *pixel, const char *folder, int i) {
    FILE *f = create("%s/%04d.pgm", folder, i);
    fprintf(f, "P5 %d %d 255\n", c->width, c->height);
    fwrite(pixel, (size_t)c->width, (size_t)c->height, f);
    finish(f);
}

/* The reported pose of frame i, and in *at where the camera truly stood. */
static arris_pose pose_of(const motion *m, int i, double theta, uint64_t *seed, arris_pose *at) {
    arris_pose pose = {.valid = true};
    double n = sqrt(arris_dot(m->step, m->step)), off = m->jitter > 0 ? rng_normal(seed) : 0;
    arris_rotation(0, theta, 0, pose.R);
    *at = pose;
    for (int k = 0; k < 3; k++) {
        pose.C[k] = m->from[k] + i * m->step[k];
        at->C[k] = pose.C[k] + (n > 0 ? off * m->jitter * m->step[k] / n : 0);
    }
    return pose;
}

char *scene_render(const scene *s, const motion *m, uint64_t seed, const char *name) {
    char *folder = make_folder(name);
    uint8_t *pixel = malloc((size_t)s->camera.width * (size_t)s->camera.height);
    FILE *list = create("%s/frames.csv", folder);
    if (!pixel)
        die("out of memory");
    write_camera(&s->camera, folder);
    fprintf(list, "index,file,utime,x,y,z,omega,theta,kappa\n");
    for (int i = 0; i < m->frames; i++) {
        arris_pose at;
        double theta = (i - (m->frames - 1) / 2.) * m->turn;
        arris_pose told = pose_of(m, i, theta, &seed, &at);
        draw(s, &at, &seed, pixel);
        write_picture(&s->camera, pixel, folder, i);
        fprintf(list, "%d,%04d.pgm,%d,%.6f,%.6f,%.6f,0,%.9f,0\n", i, i, i * 200000, told.C[0],
                told.C[1], told.C[2], theta);
    }
    finish(list);
    free(pixel);
    free(folder);
    return in_build("experiments/%s/frames.csv", name);
}
