/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_beside.c: edges beside which something lies that is too narrow to be resolved, from pictures
 * to lines in 3D. Behind an edge there is a face that the camera sees only from one side of it, as
 * the riser of a stair: a band that widens as the camera goes on. What the pictures have is exact
 * but for their noise.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "strip.h"

#include "reconstruct/line.h"
#include "segments/segmenter.h"

enum { WIDTH = 200, HEIGHT = 160, FRAMES = 60, SWEEPS = 12 };

static const arris_camera camera = {WIDTH, HEIGHT, 380, 380, 0, 99.5, 79.5, 0, 0, 0, 0, 0};
static const double picture[4] = {0, 0, WIDTH - 1, HEIGHT - 1};
static const double Z = 850, NOISE = 2, PSF = 0.55;

/* A face behind the edge, on its left or on its right. */
typedef struct face {
    double depth; /* mm behind the edge */
    double level; /* of the band over that side's */
    bool right;
} face;

/* The edge in one picture, and its band. */
typedef struct view_of {
    strip s;
    face f;
    double width; /* px of the band; 0: the face is not in sight */
} view_of;

static double level(const void *drawn, double x, double y) {
    const view_of *p = drawn;
    double v = (y - p->s.y) * cos(p->s.angle) - (x - p->s.x) * sin(p->s.angle);
    double blur = strip_blur(&p->s), to = p->f.right ? p->width : -p->width;
    double band = fabs(normal_below((v - to) / blur) - normal_below(v / blur));
    return strip_level(&p->s, x, y) + p->f.level * band;
}

typedef struct bench {
    arris_image image;
    arris_edge_point point[HEIGHT];
    arris_chain chain;
    segmenter *segmenter;
    arris_segments segments;
    uint64_t seed;
} bench;

static bench *bench_new(void) {
    static bench b;
    segmenter_params p = SEGMENTER_DEFAULTS;
    b = (bench){.image = picture_new(WIDTH, HEIGHT, ARRIS_GREY8),
                .segmenter = segmenter_new(WIDTH, HEIGHT, &p),
                .segments = segments_new(segmenter_max(WIDTH, HEIGHT)),
                .seed = 0x9E3779B97F4A7C15};
    assert_non_null(b.segmenter);
    return &b;
}

static void bench_free(bench *b) {
    free(b->image.data);
    segmenter_free(b->segmenter);
    free(b->segments.item);
}

/* The segment that is found along a chain on the edge. */
static arris_segment detect(bench *b, const view_of *p, double length) {
    double c = cos(p->s.angle), d = sin(p->s.angle);
    double gradient = (p->s.bright - p->s.dark) / (sqrt(2 * M_PI * (PSF * PSF + 17 / 12.)));
    b->chain = (arris_chain){.n = (uint32_t)length};
    for (uint32_t i = 0; i < b->chain.n; i++) {
        double t = i - length / 2, off = 0.1 * rng_normal(&b->seed);
        b->point[i] =
            (arris_edge_point){(float)(p->s.x + t * c - off * d), (float)(p->s.y + t * d + off * c),
                               (float)(-gradient * d), (float)(gradient * c)};
    }
    arris_edges edges = {.n = b->chain.n,
                         .max = HEIGHT,
                         .n_chains = 1,
                         .max_chains = 1,
                         .noise = (float)sqrt(NOISE * NOISE + 1 / 12.),
                         .point = b->point,
                         .chain = &b->chain};
    picture_draw(&b->image, level, p, NOISE, &b->seed);
    segmenter_run(b->segmenter, &edges, &b->image, &b->segments);
    assert_int_equal(b->segments.n, 1);
    return b->segments.item[0];
}

/* The upright edge at x = 0 from a camera at C, bright on its right. The face goes straight back.
 */
static view_of view_from(const double C[3], const face *f, double tilt) {
    double near = camera.fx * -C[0] / Z, far = camera.fx * -C[0] / (Z + f->depth);
    double width = f->right ? far - near : near - far; /* across */
    return (view_of){{.x = camera.cx + near,
                      .y = camera.cy,
                      .angle = -M_PI / 2 + tilt,
                      .length = 400,
                      .dark = 55,
                      .bright = 145,
                      .psf = PSF},
                     *f,
                     fmax(0, width) * cos(tilt)};
}

static const scene known = {.scale = 1, .memory = 1, .depth = 850};

/* The line that a sweep gives. */
static void sweep(bench *b, const face *f, line *l) {
    linear r;
    line_begin(l, 0);
    for (int i = 0; i < FRAMES; i++) {
        arris_pose pose = {.valid = true, .R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
        double x = (i - FRAMES / 2.) * 4.1 + rng_uniform(&b->seed);
        pose.C[0] = f->right ? -x : x; /* the face is in sight first */
        view_of p = view_from(pose.C, f, 0.014);
        arris_segment s = detect(b, &p, 110);
        view v;
        assert_int_equal(view_make(&v, &s, &camera, &pose, picture), 0);
        line_add(l, &v, &known, &r);
    }
    line_complete(l, &known);
    assert_true(l->settled);
}

/* How far the middle of the line is from the edge in depth, mm. */
static double depth_error(const line *l) {
    double P[3];
    frame_point(&l->f, l->x, 0, P);
    return P[2] - Z;
}

/* Its sigma, as it is told. */
static double depth_sigma(const line *l) {
    arris_line out;
    assert_true(line_report(l, &known, -1, &out));
    return sqrt((out.cov[11] + 2 * out.cov[14] + out.cov[20]) / 4);
}

/* Of many sweeps: RMS of the errors in depth before and after, mm, that after over its sigma, and
 * how many lines were moved at all. */
typedef struct summary {
    double before, after, nees;
    int moved;
} summary;

static summary measure(const face *f) {
    static line l;
    bench *b = bench_new();
    summary m = {0};
    for (int i = 0; i < SWEEPS; i++) {
        sweep(b, f, &l);
        double before = depth_error(&l);
        line_clear(&l, &known, sqrt(PSF * PSF + 1 / 12.));
        line_weigh(&l, &known);
        double after = depth_error(&l), z = after / depth_sigma(&l);
        m.before += before * before / SWEEPS;
        m.after += after * after / SWEEPS;
        m.nees += z * z / SWEEPS;
        m.moved += after != before;
    }
    m.before = sqrt(m.before), m.after = sqrt(m.after);
    print_message("    depth off by %.3f mm, then %.3f; %.2f of its variance; %d moved\n", m.before,
                  m.after, m.nees, m.moved);
    bench_free(b);
    return m;
}

/* It would be taken for depth: by 0.2 to 0.8 mm, of which the line would know 0.01. */
static void a_face_behind_is_taken_out(void **state) {
    (void)state;
    static const face faces[] = {
        {20, -10, false}, {38, -10, false}, {60, -10, false}, {38, 10, false}, {38, -10, true}};
    for (size_t k = 0; k < sizeof faces / sizeof *faces; k++) {
        summary m = measure(&faces[k]);
        assert_true(m.after < 0.5 * m.before);
        assert_true(m.nees < 8); /* of the narrowest it is known the least */
    }
}

static void nothing_is_left_alone(void **state) {
    (void)state;
    summary m = measure(&(face){38, 0, false});
    assert_true(m.moved <= 1);
    assert_true(m.nees > 0.3 && m.nees < 2.5);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_face_behind_is_taken_out),
        cmocka_unit_test(nothing_is_left_alone),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
