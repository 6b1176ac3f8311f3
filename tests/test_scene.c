/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_scene.c: the simulated camera: its pictures against rays that are traced one by one, its
 * edges against geometry as our own stages find them, a scan measured with it, recordings, bad
 * scenes.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <jansson.h>
#include <math.h>

#include "arris_geometry.h"
#include "arris_plugin.h"
#include "bytes.h"
#include "csv.h"
#include "frames.h"
#include "lcmtypes/arris_robot_state_t.h"
#include "link.h"
#include "one_error.h"
#include "scene/follow.h"
#include "scene/mesh.h"
#include "scene/view.h"
#include "scratch.h"
#include "strip.h"

#define COUNT(a) (sizeof(a) / sizeof *(a))
#define CELL "samples/cell/box.obj"

static const double sun[3] = {0.35, 0.25, 0.9};
static const view_light shade = {.ambient = 0.4, .background = 20};

/* ---- a scene by rays ------------------------------------------------------------------------- */

enum { W = 48, H = 36, FINE = 8, MARGIN = 5 };

typedef struct hit {
    int triangle; /* -1: nothing */
    double at;
} hit;

/* The nearest triangle along the ray X + t d, t > from; of those equally near the last. */
static hit trace(const mesh *m, const double X[3], const double d[3], double from) {
    hit best = {-1, INFINITY};
    for (size_t i = 0; i < m->n_triangles; i++) {
        const double *a = m->point[m->triangle[i].v[0]], *b = m->point[m->triangle[i].v[1]],
                     *c = m->point[m->triangle[i].v[2]];
        double u[3], v[3], w[3], p[3], q[3];
        for (int k = 0; k < 3; k++)
            u[k] = b[k] - a[k], v[k] = c[k] - a[k], w[k] = X[k] - a[k];
        arris_cross(d, v, p);
        double det = arris_dot(u, p);
        if (fabs(det) < 1e-12)
            continue;
        double s = arris_dot(w, p) / det;
        arris_cross(w, u, q);
        double t = arris_dot(d, q) / det, at = arris_dot(v, q) / det;
        if (s >= 0 && t >= 0 && s + t <= 1 && at > from && at < best.at + 1e-3)
            best = (hit){(int)i, at};
    }
    return best;
}

/* What the camera's ray along d gets to see, by Lambert's law. */
static double level_of_ray(const mesh *m, const double C[3], const double d[3]) {
    hit h = trace(m, C, d, 1);
    if (h.triangle < 0)
        return shade.background;
    const mesh_triangle *t = &m->triangle[h.triangle];
    double u[3], v[3], n[3], X[3], up[3], l[3] = {sun[0], sun[1], sun[2]};
    arris_unit(l);
    for (int k = 0; k < 3; k++) {
        u[k] = m->point[t->v[1]][k] - m->point[t->v[0]][k];
        v[k] = m->point[t->v[2]][k] - m->point[t->v[0]][k];
        X[k] = C[k] + h.at * d[k];
        up[k] = -l[k];
    }
    arris_cross(u, v, n);
    arris_unit(n);
    double falls = arris_dot(n, l), direct = 0;
    if (falls * arris_dot(n, d) > 0 && trace(m, X, up, 0.01).triangle < 0)
        direct = (1 - shade.ambient) * fabs(falls);
    return 255 * (double)t->grey * (shade.ambient + direct);
}

static double gauss(double x, double sigma) {
    return exp(-x * x / (2 * sigma * sigma));
}

/* The picture from FINE x FINE rays a pixel, a Gaussian over those, and their mean. */
static void picture_by_rays(const mesh *m, const arris_camera *c, const arris_pose *pose,
                            double psf, double picture[H][W]) {
    enum { FW = (W + 2 * MARGIN) * FINE, FH = (H + 2 * MARGIN) * FINE };
    static double fine[FH][FW], across[FH][W];
    double weight[2 * MARGIN * FINE], sum = 0;
    for (int j = 0; j < FH; j++)
        for (int i = 0; i < FW; i++) {
            double u = (i + 0.5) / FINE - 0.5 - MARGIN, v = (j + 0.5) / FINE - 0.5 - MARGIN;
            double x, y, d[3];
            arris_undistort(c, u, v, &x, &y);
            arris_bearing(c, pose, x, y, d);
            fine[j][i] = level_of_ray(m, pose->C, d);
        }
    enum { N = 2 * MARGIN * FINE };
    for (int k = 0; k < N; k++) { /* pixel box and Gaussian */
        weight[k] = 0;
        for (int b = 0; b < FINE; b++)
            weight[k] += gauss((k - N / 2 + 0.5 - (b - FINE / 2 + 0.5)) / FINE, psf);
        sum += weight[k];
    }
    for (int j = 0; j < FH; j++)
        for (int x = 0; x < W; x++) {
            across[j][x] = 0;
            for (int k = 0; k < N; k++)
                across[j][x] += weight[k] / sum * fine[j][x * FINE + FINE / 2 + k];
        }
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++) {
            picture[y][x] = 0;
            for (int k = 0; k < N; k++)
                picture[y][x] += weight[k] / sum * across[y * FINE + FINE / 2 + k][x];
        }
}

/* A room with the camera in it, its walls behind and beside; a plate that pierces another. */
static const char *write_room(void) {
    scratch_write("room.mtl",
                  "newmtl a\nKd .8 .8 .8\nnewmtl b\nKd .3 .3 .3\nnewmtl c\nKd .55 .55 .55\n");
    return scratch_write("room.obj", "mtllib room.mtl\n"
                                     "v -900 -700 -500\nv 800 -700 -500\nv 800 600 -500\n"
                                     "v -900 600 -500\nv -900 -700 1100\nv 800 -700 1100\n"
                                     "v 800 600 1100\nv -900 600 1100\n"
                                     "usemtl b\nf 5 6 7 8\nusemtl c\nf 1 4 8 5\nf 2 3 7 6\n"
                                     "f 4 3 7 8\n"
                                     "v -200 -80 800\nv 150 -120 700\nv 180 130 760\n"
                                     "v -170 170 860\nusemtl a\nf 9 10 11 12\n"
                                     "v -60 -150 600\nv 20 -140 1000\nv 40 160 980\n"
                                     "v -40 150 580\nusemtl b\nf 13 14 15 16\n");
}

static double wide(uint64_t *seed, double size) {
    return size * (2 * rng_uniform(seed) - 1);
}

/* The greatest difference of a picture from that by rays. */
static double compare_with_rays(const char *scene, bool lens, double tilt, double psf,
                                uint64_t seed) {
    arris_camera c = {.width = W, .height = H, .fx = 46, .fy = 45, .skew = 0.3, .cx = 24, .cy = 17};
    if (lens)
        c.k1 = -0.2, c.k2 = 0.08, c.p1 = 0.002, c.p2 = -0.003;
    arris_pose pose = {.valid = true, .C = {wide(&seed, 120), wide(&seed, 90), wide(&seed, 80)}};
    arris_rotation(wide(&seed, tilt), wide(&seed, tilt), wide(&seed, 3), pose.R);
    static double truth[H][W];
    arris_image image = picture_new(W, H, ARRIS_GREY8);
    mesh m;
    cell set;
    view *v = NULL;
    fault f;
    if (mesh_load(&m, scene, &f) || cell_build(&set, &m, &f) || cell_light_up(&set, sun, &f) ||
        view_new(&v, &set, &c, psf, &shade, &f))
        fail_msg("%s", f.text);
    view_take(v, &pose, 0, 0, &image);
    picture_by_rays(&m, &c, &pose, psf, truth);
    double worst = 0;
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++)
            worst = fmax(worst, fabs(image.data[y * image.stride + x] - truth[y][x]));
    view_free(v);
    cell_free(&set);
    mesh_free(&m);
    free(image.data);
    return worst;
}

/* Rays are as far apart as 1/8 px; a shadow, an edge or a patch in the wrong place, or a streak
 * from a border that does not close, would show by more. */
static void pictures_are_what_rays_see(void **state) {
    (void)state;
    const char *room = write_room();
    for (uint64_t i = 0; i < 4; i++) {
        double table = compare_with_rays(CELL, i % 2, 0.2, 0.6 + 0.2 * (double)i, 11 + i);
        double inside = compare_with_rays(room, i % 2, 0.7, 0.6 + 0.2 * (double)i, 77 + i);
        print_message("  worst pixel: the cell %.2f, in the room %.2f levels\n", table, inside);
        assert_true(table < 4 && inside < 4);
    }
}

/* ---- edges as our own stages find them ------------------------------------------------------- */

typedef struct edge3 {
    double p[3], q[3];
} edge3;

enum { PLATES = 2, EDGES = 8 * PLATES, FLOOR = 1000 };

/* Tilted plates high over a floor, so that each edge and each shadow's stands alone. */
static void write_plates(uint64_t seed, edge3 edge[EDGES]) {
    char text[4000] = "v -900 -900 1000\nv 900 -900 1000\nv 900 900 1000\nv -900 900 1000\n"
                      "mtllib plates.mtl\nusemtl m1\nf 1 2 3 4\n";
    for (int i = 0, n = 0; i < PLATES; i++) {
        double angle = wide(&seed, 3), tx = wide(&seed, 0.25), ty = wide(&seed, 0.25), P[4][3];
        for (int k = 0; k < 4; k++) {
            double x = k == 0 || k == 3 ? -60 : 60, y = k < 2 ? -45 : 45;
            double u = cos(angle) * x - sin(angle) * y, v = sin(angle) * x + cos(angle) * y;
            P[k][0] = (i ? 60 : -150) + u;
            P[k][1] = (i ? -90 : 40) + v;
            P[k][2] = 590 + 20 * i + tx * u + ty * v;
            sprintf(text + strlen(text), "v %.6f %.6f %.6f\n", P[k][0], P[k][1], P[k][2]);
        }
        sprintf(text + strlen(text), "usemtl m%d\nf -4 -3 -2 -1\n", i ? 0 : 2);
        for (int k = 0; k < 4; k++, n += 2)
            for (int j = 0; j < 3; j++) {
                const double *p = P[k], *q = P[(k + 1) % 4];
                edge[n].p[j] = p[j], edge[n].q[j] = q[j];
                edge[n + 1].p[j] = p[j] + (FLOOR - p[2]) / sun[2] * sun[j];
                edge[n + 1].q[j] = q[j] + (FLOOR - q[2]) / sun[2] * sun[j];
            }
    }
    scratch_write("plates.obj", "%s", text);
    scratch_write("plates.mtl",
                  "newmtl m0\nKd .15 .15 .15\nnewmtl m1\nKd .5 .5 .5\nnewmtl m2\nKd .95 .95 .95\n");
}

static void write_poses(const char *name, int n, double size, double tilt, uint64_t seed) {
    char text[20000] = "index,file,utime,x,y,z,omega,theta,kappa\n";
    for (int i = 0; i < n; i++)
        sprintf(text + strlen(text), "%d,-,%d,%.5f,%.5f,%.5f,%.7f,%.7f,%.7f\n", i, 1000 * i,
                wide(&seed, size), wide(&seed, size), wide(&seed, size), wide(&seed, tilt),
                wide(&seed, tilt), wide(&seed, 3));
    scratch_write(name, "%s", text);
}

/* How far the segment's ends are from the line of the edge, px; far away when it is another edge.
 */
static double off_edge(const double s[4], const edge3 *e, const arris_camera *c,
                       const arris_pose *pose) {
    double a[2], b[2], worst = 0;
    if (!(arris_project(c, pose, e->p, &a[0], &a[1]) > 0 &&
          arris_project(c, pose, e->q, &b[0], &b[1]) > 0))
        return INFINITY;
    double dx = b[0] - a[0], dy = b[1] - a[1], l = hypot(dx, dy);
    for (int k = 0; k < 2; k++) {
        double x = s[2 * k] - a[0], y = s[2 * k + 1] - a[1], t = (x * dx + y * dy) / l;
        worst = fmax(worst, fabs(x * dy - y * dx) / l);
        if (t < -4 || t > l + 4)
            return INFINITY;
    }
    return worst;
}

typedef struct tally {
    int segments, edges; /* found at all: of EDGES */
    double worst, square;
} tally;

/* Each segment of at least 40 px against the edge that is nearest to it. */
static tally compare_segments(const char *segments, const char *poses, const arris_camera *c,
                              const edge3 edge[EDGES]) {
    static const char *const names[] = {"frame", "x1", "y1", "x2", "y2"};
    bool found[EDGES] = {false};
    tally t = {0};
    frame_list list;
    bytes b = {0};
    csv table;
    fault f;
    int column[5], r;
    if (frames_load(&list, poses, 0, &f) || bytes_read(&b, segments, 1 << 26, &f) ||
        csv_open(&table, segments, (char *)b.data, b.n, &f) ||
        csv_columns(&table, names, 5, column, &f))
        fail_msg("%s", f.text);
    while ((r = csv_next(&table, &f)) > 0) {
        double v[5], best = INFINITY;
        int which = 0;
        arris_pose pose;
        for (int k = 0; k < 5; k++)
            assert_int_equal(csv_number(&table, column[k], &v[k], &f), 0);
        if (hypot(v[3] - v[1], v[4] - v[2]) < 40)
            continue;
        frames_pose(&list.item[(int)v[0]], &pose);
        for (int k = 0; k < EDGES; k++) {
            double off = off_edge(v + 1, &edge[k], c, &pose);
            which = off < best ? k : which;
            best = fmin(best, off);
        }
        found[which] = true;
        t.segments++;
        t.worst = fmax(t.worst, best);
        t.square += best * best;
    }
    assert_int_equal(r, 0);
    for (int k = 0; k < EDGES; k++)
        t.edges += found[k];
    frames_free(&list);
    free(b.data);
    return t;
}

static void run(const char *line) {
    process p = arris_launch(NULL, line);
    if (p.code)
        fail_msg("'%s' ends with %d and says:\n%s", line, p.code, p.err);
    process_free(&p);
}

/* Over many poses, through a lens and without one, sharp and blurred. */
static void edges_lie_where_geometry_says(void **state) {
    (void)state;
    static const struct {
        double k1, k2, psf, noise;
    } as[] = {{-0.24, 0.19, 0.8, 1}, {0, 0, 0.8, 1}, {-0.3, 0.12, 0.5, 1}, {0.15, -0.05, 1.2, 0.5}};
    edge3 edge[EDGES];
    char line[2000];
    write_plates(8, edge);
    for (size_t i = 0; i < COUNT(as); i++) {
        arris_camera c = {.width = 640,
                          .height = 480,
                          .fx = 760,
                          .fy = 757,
                          .skew = 0.1,
                          .cx = 316,
                          .cy = 243,
                          .k1 = as[i].k1,
                          .k2 = as[i].k2};
        scratch_write("camera.json",
                      "{\"width\": 640, \"height\": 480, \"fx\": 760, \"fy\": 757, \"skew\": 0.1, "
                      "\"cx\": 316, \"cy\": 243, \"k1\": %g, \"k2\": %g, \"p1\": 0, \"p2\": 0, "
                      "\"k3\": 0}",
                      c.k1, c.k2);
        write_poses("poses.csv", 15, 70, 0.1, i + 1);
        snprintf(
            line, sizeof line,
            "scenesrc location=%s poses=%s light-x=0.35 light-y=0.25 light-z=0.9 psf=%g noise=%g "
            "! edges ! undistort ! segments "
            "! filesink location=%s",
            scratch("plates.obj"), scratch("poses.csv"), as[i].psf, as[i].noise,
            scratch("segments.csv"));
        run(line);
        tally t = compare_segments(scratch("segments.csv"), scratch("poses.csv"), &c, edge);
        print_message("  %d segments on %d of %d edges: rms %.4f, worst %.4f px\n", t.segments,
                      t.edges, EDGES, sqrt(t.square / t.segments), t.worst);
        assert_true(t.segments > 150 && t.edges == EDGES);
        assert_true(t.worst < 0.05);
    }
}

/* ---- the same again -------------------------------------------------------------------------- */

static char *segments_of(const char *options) {
    char line[2000];
    snprintf(line, sizeof line,
             "scenesrc location=" CELL " frames=3 %s ! edges ! segments ! filesink location=%s",
             options, scratch("segments.csv"));
    run(line);
    return file_text(scratch("segments.csv"));
}

static void same_input_same_bytes(void **state) {
    (void)state;
    char *a = segments_of("jitter=0.1"), *b = segments_of("jitter=0.1");
    char *other = segments_of("jitter=0.1 seed=2");
    assert_string_equal(a, b);
    assert_string_not_equal(a, other);
    free(a), free(b), free(other);
}

/* Mean and sigma of the noise where the picture is even, and that neighbours know nothing of each
 * other. */
static void noise_is_as_asked(void **state) {
    (void)state;
    arris_camera c = {.width = 320, .height = 240, .fx = 300, .fy = 300, .cx = 160, .cy = 120};
    arris_image image = picture_new(c.width, c.height, ARRIS_GREY8);
    fault f;
    draw *d;
    assert_int_equal(draw_new(&d, &c, 0.8, &f), 0);
    draw_clear(d);
    draw_finish(d, 100.25, 4, 7, &image);
    double sum = 0, square = 0, along = 0, down = 0, n = 0;
    for (int y = 1; y < c.height; y++)
        for (int x = 1; x < c.width; x++, n++) {
            const uint8_t *p = image.data + y * image.stride + x;
            double e = p[0] - 100.25;
            sum += e, square += e * e;
            along += e * (p[-1] - 100.25), down += e * (p[-image.stride] - 100.25);
        }
    print_message("  mean %.3f, sigma %.3f, correlation %.4f and %.4f\n", sum / n, sqrt(square / n),
                  along / square, down / square);
    assert_true(fabs(sum / n) < 0.1 && fabs(sqrt(square / n) - sqrt(16 + 1. / 12)) < 0.05);
    assert_true(fabs(along / square) < 0.015 && fabs(down / square) < 0.015);
    draw_free(d);
    free(image.data);
}

/* ---- scans ----------------------------------------------------------------------------------- */

enum { TOP = 760 /* mm, of the box */ };

/* The edges of the cell's file: the sides of its faces. */
static size_t read_edges(edge3 *edge, size_t max) {
    double point[400][3];
    size_t n = 0, points = 0;
    char *text = file_text(CELL), *line = strtok(text, "\n");
    for (; line; line = strtok(NULL, "\n")) {
        size_t v[8], k = 0;
        double *p = point[points];
        if (sscanf(line, "v %lf %lf %lf", &p[0], &p[1], &p[2]) == 3)
            points += points < COUNT(point) - 1;
        if (strncmp(line, "f ", 2) != 0)
            continue;
        for (char *at = line + 1; k < 8 && *at; k++)
            v[k] = strtoul(at, &at, 10) - 1;
        for (size_t i = 0; i < k && n < max; i++, n++) {
            memcpy(edge[n].p, point[v[i]], sizeof *point);
            memcpy(edge[n].q, point[v[(i + 1) % k]], sizeof *point);
        }
    }
    free(text);
    return n;
}

static double off_line(const double X[3], const edge3 *e) {
    double u[3], w[3], n[3];
    for (int k = 0; k < 3; k++)
        u[k] = e->q[k] - e->p[k], w[k] = X[k] - e->p[k];
    double length = arris_unit(u), t = arris_dot(u, w);
    arris_cross(u, w, n);
    return t < -3 || t > length + 3 ? INFINITY : sqrt(arris_dot(n, n));
}

static void read_end(const json_t *line, const char *key, double X[3]) {
    for (size_t k = 0; k < 3; k++)
        X[k] = json_number_value(json_array_get(json_object_get(line, key), k));
}

/* Of the measured lines that lie along the edge for most of its length, the distance of the best
 * one's worse end, mm. */
static double off_lines(const json_t *lines, const edge3 *e) {
    double best = INFINITY, p[3], q[3];
    size_t i;
    json_t *l;
    json_array_foreach(lines, i, l) {
        read_end(l, "p", p);
        read_end(l, "q", q);
        bool measured = strcmp(json_string_value(json_object_get(l, "state")), "measured") == 0;
        double length = hypot(hypot(p[0] - q[0], p[1] - q[1]), p[2] - q[2]);
        double whole = hypot(hypot(e->p[0] - e->q[0], e->p[1] - e->q[1]), e->p[2] - e->q[2]);
        if (measured && length > 0.8 * whole)
            best = fmin(best, fmax(off_line(p, e), off_line(q, e)));
    }
    return best;
}

/* The greatest difference between the ends of the same line. */
static double apart(const json_t *a, const json_t *b) {
    double worst = 0, X[3], Y[3];
    size_t i;
    json_t *l;
    assert_int_equal(json_array_size(a), json_array_size(b));
    json_array_foreach(a, i, l) {
        for (int k = 0; k < 2; k++) {
            read_end(l, k ? "p" : "q", X);
            read_end(json_array_get(b, i), k ? "p" : "q", Y);
            for (int j = 0; j < 3; j++)
                worst = fmax(worst, fabs(X[j] - Y[j]));
        }
    }
    return worst;
}

#define SCAN "! edges ! undistort ! segments ! track ! reconstruct ! filesink location=%s"

/* Recorded on the way and measured, and measured again from the recording. */
static void a_scan_measures_the_cell(void **state) {
    (void)state;
    edge3 edge[400];
    char line[3000];
    size_t n = read_edges(edge, COUNT(edge)), i;
    scratch_mkdir("scan");
    snprintf(line, sizeof line,
             "scenesrc location=" CELL " frames=100 ! tee name=t t. ! queue ! filesink "
             "location=%s t. " SCAN,
             scratch("scan/frames.csv"), scratch("live.json"));
    run(line);
    snprintf(line, sizeof line, "imagesrc location=%s " SCAN, scratch("scan/frames.csv"),
             scratch("again.json"));
    run(line);
    json_t *live = json_load_file(scratch("live.json"), 0, NULL);
    json_t *again = json_load_file(scratch("again.json"), 0, NULL);
    const json_t *lines = json_object_get(live, "lines");
    double worst = 0, difference = apart(lines, json_object_get(again, "lines"));
    int tops = 0;
    for (i = 0; i < n; i++) {
        double off = off_lines(lines, &edge[i]), x = edge[i].p[0] - edge[i].q[0];
        if (edge[i].p[2] != TOP || edge[i].q[2] != TOP ||
            hypot(x, edge[i].p[1] - edge[i].q[1]) < 50)
            continue;
        worst = fmax(worst, off);
        tops++;
    }
    print_message("  the %d long edges of the box's top: worst end %.3f mm off; from the recording "
                  "%.1e mm away\n",
                  tops, worst, difference);
    assert_true(tops >= 8 && worst < 0.3);
    assert_true(difference < 1e-3);
    json_decref(live);
    json_decref(again);
}

/* ---- live ------------------------------------------------------------------------------------ */

/* Frames come when their time has come, and are called by it. */
static void live_is_in_time(void **state) {
    (void)state;
    char line[1000];
    scratch_mkdir("live");
    snprintf(line, sizeof line,
             "scenesrc location=" CELL " frames=11 fps=20 live=true ! queue max-frames=20 ! "
             "filesink location=%s",
             scratch("live/frames.csv"));
    struct timespec t;
    clock_gettime(CLOCK_REALTIME, &t);
    int64_t before = (int64_t)t.tv_sec * 1000000 + t.tv_nsec / 1000;
    run(line);
    clock_gettime(CLOCK_REALTIME, &t);
    int64_t after = (int64_t)t.tv_sec * 1000000 + t.tv_nsec / 1000;
    frame_list list;
    fault f;
    assert_int_equal(frames_load(&list, scratch("live/frames.csv"), 0, &f), 0);
    assert_true(list.n > 0 && list.item[0].utime >= before);
    assert_true(list.item[list.n - 1].utime <= after);
    for (size_t i = 0; i < list.n; i++) {
        const frame_entry *e = &list.item[i];
        int64_t since = e->utime - list.item[0].utime;
        assert_true(llabs(since - 50000 * (e->index - list.item[0].index)) < 2000);
        assert_true(fabs(e->pose[0] - 4.1 * (double)(e->index - 5)) < 1e-5);
    }
    frames_free(&list);
}

/* ---- the simulated robot --------------------------------------------------------------------- */

static void say(lcm_link *l, int64_t utime, int64_t session, double x) {
    static uint8_t data[1000];
    arris_robot_state_t s = {.utime = utime,
                             .session = session,
                             .pos = {x, 20, 30},
                             .quat = {0, 1, 0, 0}, /* about x by 180 degrees: z looks down */
                             .message = (char[]){""}};
    int n = arris_robot_state_t_encode(data, 0, sizeof data, &s);
    assert_true(n > 0 && link_publish(l, "ROBOT_TRUTH", data, (size_t)n) == 0);
}

static int64_t in_ms(int ms) {
    return arris_now() + ms * INT64_C(1000000);
}

/* Between what the robot says, never beyond it; the camera sits on its flange. */
static void the_robot_is_followed(void **state) {
    (void)state;
    fault f;
    follow *w;
    arris_pose pose;
    scratch_write("handeye.json",
                  "{\"camera_to_flange\": {\"x\": 1, \"y\": 2, \"z\": 3, \"qw\": 1, "
                  "\"qx\": 0, \"qy\": 0, \"qz\": 0}}");
    if (follow_new(&w, "memq://scene", scratch("handeye.json"), &f))
        fail_msg("%s", f.text);
    lcm_link *l = link_open("memq://scene", &f);
    assert_false(follow_pose(w, 1000000, in_ms(50), &pose));
    for (int i = 0; i < 10; i++)
        say(l, 1000000 + 5000 * i, 1, 10 * i);
    assert_true(follow_pose(w, 1012500, in_ms(5000), &pose));
    assert_true(fabs(pose.C[0] - 26) < 1e-9 && fabs(pose.C[1] - 18) < 1e-9);
    assert_true(fabs(pose.C[2] - 27) < 1e-9 && fabs(pose.R[8] + 1) < 1e-9);
    assert_false(follow_pose(w, 1045001, in_ms(50), &pose)); /* it has not said so yet */
    assert_false(follow_pose(w, 999999, in_ms(5000), &pose));
    assert_int_equal(link_publish(l, "ROBOT_TRUTH", "rubbish", 7), 0);
    for (int i = 0; i < 2; i++) /* another session, earlier */
        say(l, 500000 + 5000 * i, 2, 5);
    for (int i = 0; i < 5000 && !follow_pose(w, 502000, in_ms(1), &pose); i++)
        nanosleep(&(struct timespec){0, 1000000}, NULL);
    assert_true(pose.C[0] == 6);
    link_close(l);
    follow_free(w);
    assert_int_equal(follow_new(&w, "nonsense://", NULL, &f) < 0, 1);
    follow_free(w);
}

/* Without a robot nothing is rendered, and the stream ends in time all the same. */
static void without_a_robot_there_are_no_frames(void **state) {
    (void)state;
    char line[500];
    snprintf(line, sizeof line,
             "scenesrc location=" CELL " robot=memq://nobody frames=3 ! fakesink");
    process p = arris_launch(NULL, line);
    assert_int_equal(p.code, 0);
    process_free(&p);
}

/* ---- bad scenes ------------------------------------------------------------------------------ */

static void refused(const char *line, int code, const char *text) {
    char whole[3000];
    snprintf(whole, sizeof whole, "scenesrc %s ! fakesink", line);
    process p = arris_launch(NULL, whole);
    assert_one_error(&p, whole, code, text, "scenesrc", NULL);
}

static void refuse_scene(const char *name, const char *scene, const char *text) {
    char line[1000];
    scratch_write(name, "%s", scene);
    snprintf(line, sizeof line, "location=%s camera=samples/cell/camera.json", scratch(name));
    refused(line, 4, text);
}

static void write_many(const char *name, int triangles) {
    FILE *f = fopen(scratch(name), "w");
    for (int i = 0; i < triangles; i++)
        fprintf(f, "v %d 0 0\nv %d 1 0\nv %d 0 1\nf -3 -2 -1\n", i, i, i);
    fclose(f);
}

static void bad_scenes_are_refused(void **state) {
    (void)state;
    char line[1000];
    refused("frames=1", 2, "no location= is given");
    refused("location=none.obj camera=samples/cell/camera.json", 4, "cannot open none.obj");
    refused("location=samples/box/lines.svg camera=samples/cell/camera.json", 4, "neither in .obj");
    refuse_scene("empty.obj", "", "cannot be read");
    refuse_scene("points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "points.obj");
    refuse_scene("noise.obj", "\x7f\x03 \x1b[0m garbage \xff\xfe\n\n f f f f\n", "noise.obj");
    refuse_scene("nan.obj", "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "nan.obj");
    refuse_scene("inf.obj", "v 1e39 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "inf.obj");
    refuse_scene("far.obj", "v 0 0 900\nv 1e6 0 900\nv 0 1 900\nf 1 2 3\n", "the limit is");
    refuse_scene("flat.obj", "v 0 0 9\nv 1 0 9\nv 2 0 9\nf 1 2 3\nf 1 1 2\n",
                 "no face has an area");
    refuse_scene("index.obj", "v 0 0 9\nv 1 0 9\nv 2 0 9\nf 1 2 30\n", "index.obj");
    const char *options = getenv("ASAN_OPTIONS");
    setenv("ASAN_OPTIONS", "detect_leaks=0", 1); /* assimp leaks when it gives an STL up */
    refuse_scene("short.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0", "short.stl");
    setenv("ASAN_OPTIONS", options ? options : "", 1);
    write_many("many.obj", MESH_MAX_TRIANGLES + 1);
    snprintf(line, sizeof line, "location=%s camera=samples/cell/camera.json", scratch("many.obj"));
    refused(line, 4, "triangles; the limit is");
    scratch_write("room2.obj", "v 0 0 900\nv 100 0 900\nv 0 100 900\nf 1 2 3\n");
    unlink(scratch("camera.json"));
    snprintf(line, sizeof line, "location=%s", scratch("room2.obj"));
    refused(line, 4, "camera.json");
    scratch_write(
        "camera.json",
        "{\"width\": 640, \"height\": 480, \"fx\": 300, \"fy\": 300, \"skew\": 0, \"cx\": "
        "320, \"cy\": 240, \"k1\": -0.6, \"k2\": 0, \"p1\": 0, \"p2\": 0, \"k3\": 0}");
    refused(line, 4, "folds back");
    refused("location=" CELL " robot=memq://x jitter=1", 2, "the robot alone says");
    refused("location=" CELL " handeye=none.json", 2, "there is none");
    refused("location=" CELL " robot=memq://x handeye=none.json", 4, "none.json");
    scratch_write("few.csv", "index,file,utime,x,y,z,omega,theta,kappa\n4,-,0,,,,,,\n");
    snprintf(line, sizeof line, "location=" CELL " poses=%s", scratch("few.csv"));
    refused(line, 4, "frame 4 has no pose");
}

/* Faces without area are left out, and what remains is rendered; STL as well as OBJ. */
static void what_is_sound_is_rendered(void **state) {
    (void)state;
    char line[1000];
    scratch_write("part.obj", "v -100 -100 900\nv 100 -100 900\nv 0 100 900\nf 1 2 3\nf 1 2 2\n");
    scratch_write("part.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex -100 -100 900\n"
                              "vertex 100 -100 900\nvertex 0 100 900\nendloop\nendfacet\n"
                              "endsolid a\n");
    for (int i = 0; i < 2; i++) {
        snprintf(line, sizeof line,
                 "scenesrc location=%s camera=samples/cell/camera.json frames=1 ! edges ! segments "
                 "! filesink location=%s",
                 scratch(i ? "part.stl" : "part.obj"), scratch("segments.csv"));
        run(line);
        char *text = file_text(scratch("segments.csv"));
        int lines = 0;
        for (const char *c = text; *c; c++)
            lines += *c == '\n';
        assert_true(lines >= 4); /* the head, and three sides */
        free(text);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pictures_are_what_rays_see),
        cmocka_unit_test(edges_lie_where_geometry_says),
        cmocka_unit_test(same_input_same_bytes),
        cmocka_unit_test(noise_is_as_asked),
        cmocka_unit_test(a_scan_measures_the_cell),
        cmocka_unit_test(live_is_in_time),
        cmocka_unit_test(the_robot_is_followed),
        cmocka_unit_test(without_a_robot_there_are_no_frames),
        cmocka_unit_test(bad_scenes_are_refused),
        cmocka_unit_test(what_is_sound_is_rendered),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
