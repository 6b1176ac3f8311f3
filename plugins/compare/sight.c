/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * sight.c: a depth buffer of the nominal's faces from poses of the path.
 */
#include "sight.h"

#include <math.h>
#include <stdlib.h>

#include "arris_geometry.h"

enum { SIDE = 480, SAMPLES = 9 };  /* px of the greater side of the buffer; points of an edge */
static const float GRACE = 0.005F; /* of its depth, by which a point may lie behind a face */

void sight_add(sight *s, const arris_pose *pose) {
    if (!pose->valid)
        return;
    if (s->n == SIGHT_POSES) {
        s->n /= 2;
        s->every *= 2;
        for (uint32_t i = 0; i < s->n; i++)
            s->pose[i] = s->pose[2 * i];
    }
    s->every = s->every ? s->every : 1;
    if (s->seen++ % s->every == 0)
        s->pose[s->n++] = *pose;
}

double sight_swing(const sight *s, const piece *e) {
    double first[3] = {0}, n[3], low = 0, high = 0;
    for (uint32_t i = 0; i < s->n; i++) {
        double d[3], side[3];
        for (int k = 0; k < 3; k++)
            d[k] = e->p[k] - s->pose[i].C[k];
        arris_cross(d, e->u, n);
        if (!(arris_unit(n) > 0))
            continue;
        if (arris_dot(first, first) < 0.5)
            for (int k = 0; k < 3; k++)
                first[k] = n[k];
        arris_cross(first, n, side);
        double angle = atan2(arris_dot(side, e->u), arris_dot(first, n));
        low = fmin(low, angle);
        high = fmax(high, angle);
    }
    return high - low;
}

/* ---- the depth buffer ------------------------------------------------------------------------ */

typedef struct buffer {
    int width, height;
    arris_camera camera; /* of the buffer's own pixels */
    float *depth;
} buffer;

static double edge_function(const double a[2], const double b[2], double x, double y) {
    return (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]);
}

/* 1 / depth is linear in the picture. */
static void fill_triangle(buffer *b, const double v[3][2], const double inverse[3]) {
    double area = edge_function(v[0], v[1], v[2][0], v[2][1]);
    double low[2], high[2], size[2] = {b->width - 1, b->height - 1};
    for (int k = 0; k < 2; k++) {
        low[k] = ceil(fmax(0, fmin(v[0][k], fmin(v[1][k], v[2][k]))));
        high[k] = floor(fmin(size[k], fmax(v[0][k], fmax(v[1][k], v[2][k]))));
    }
    for (int y = (int)low[1]; fabs(area) > 1e-12 && y <= (int)high[1]; y++)
        for (int x = (int)low[0]; x <= (int)high[0]; x++) {
            double w0 = edge_function(v[1], v[2], x, y) / area;
            double w1 = edge_function(v[2], v[0], x, y) / area, w2 = 1 - w0 - w1;
            float *d = &b->depth[y * b->width + x];
            if (w0 >= 0 && w1 >= 0 && w2 >= 0)
                *d = fminf(*d, (float)(1 / (w0 * inverse[0] + w1 * inverse[1] + w2 * inverse[2])));
        }
}

static void draw(buffer *b, const nominal *m, const place *where, const arris_pose *pose) {
    for (int i = 0; i < b->width * b->height; i++)
        b->depth[i] = INFINITY;
    for (uint32_t t = 0; t < m->n_triangles; t++) {
        double v[3][2], inverse[3];
        bool before = true;
        for (int k = 0; k < 3 && before; k++) {
            double X[3];
            place_point(where, m->vertex[m->triangle[t][k]], X);
            double z = arris_project(&b->camera, pose, X, &v[k][0], &v[k][1]);
            before = z > 1 && fabs(v[k][0]) < 1e6 && fabs(v[k][1]) < 1e6;
            inverse[k] = 1 / z;
        }
        if (before)
            fill_triangle(b, (const double(*)[2])v, inverse);
    }
}

/* A point of an edge is seen when some pixel beside it shows nothing nearer: the edge's own faces
 * end there. */
static bool shows(const buffer *b, const arris_pose *pose, const double X[3]) {
    double x, y, z = arris_project(&b->camera, pose, X, &x, &y);
    if (!(z > 1 && x > 1 && y > 1 && x < b->width - 2 && y < b->height - 2))
        return false;
    for (int i = 0; i < 9; i++) {
        int at = ((int)lround(y) + i / 3 - 1) * b->width + (int)lround(x) + i % 3 - 1;
        if (b->depth[at] >= (float)z * (1 - GRACE))
            return true;
    }
    return false;
}

static bool half_shows(const buffer *b, const arris_pose *pose, const piece *e) {
    int n = 0;
    for (int i = 0; i < SAMPLES; i++) {
        double X[3], s = e->length * (i + 0.5) / SAMPLES;
        for (int k = 0; k < 3; k++)
            X[k] = e->p[k] + s * e->u[k];
        n += shows(b, pose, X);
    }
    return 2 * n > SAMPLES;
}

int sight_count(const sight *s, const arris_camera *c, const nominal *m, const place *where,
                const piece *e, uint32_t *seen) {
    double scale = fmin(1, (double)SIDE / fmax(c->width, c->height));
    buffer b = {.width = (int)fmax(1, c->width * scale), .height = (int)fmax(1, c->height * scale)};
    b.camera = arris_camera_ideal(c);
    b.camera.fx *= scale;
    b.camera.fy *= scale;
    b.camera.skew *= scale;
    b.camera.cx = (c->cx + 0.5) * scale - 0.5;
    b.camera.cy = (c->cy + 0.5) * scale - 0.5;
    b.depth = malloc((size_t)b.width * (size_t)b.height * sizeof *b.depth);
    if (!b.depth)
        return ARRIS_E_MEMORY;
    for (uint32_t k = 0; k < m->n_edges; k++)
        seen[k] = 0;
    for (uint32_t i = 0; i < s->n; i++) {
        draw(&b, m, where, &s->pose[i]);
        for (uint32_t k = 0; k < m->n_edges; k++)
            seen[k] += half_shows(&b, &s->pose[i], &e[k]);
    }
    free(b.depth);
    return 0;
}
