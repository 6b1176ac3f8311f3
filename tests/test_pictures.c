/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_pictures.c: sequences of pictures, from the edges on, where what matters is in the picture:
 * one thing hides another, the ground behind an edge changes, light wanders.
 */
#include "world.h"

enum { QUADS = 24 };
static const double BLUR = 0.85; /* px: lens and pixel box */
static const double NOISE = 2;   /* grey levels */

/* A flat thing, convex; its corners in order. */
typedef struct quad {
    double corner[4][3], grey;
} quad;

static quad quads[QUADS]; /* the farther first */
static int n_quads;

/* An upright rectangle at a depth, turned in its plane. `edges`: they are edges of the world. */
static void add_quad(double x, double y, double z, double w, double h, double turn, double grey,
                     bool edges) {
    quad *q = &quads[n_quads++];
    double c = cos(turn), s = sin(turn);
    q->grey = grey;
    for (int i = 0; i < 4; i++) {
        double u = i == 1 || i == 2 ? w / 2 : -w / 2, v = i > 1 ? h / 2 : -h / 2;
        q->corner[i][0] = x + c * u - s * v;
        q->corner[i][1] = y + s * u + c * v;
        q->corner[i][2] = z;
    }
    for (int i = 0; edges && i < 4; i++) {
        const double *a = q->corner[i], *b = q->corner[(i + 1) % 4];
        add(a[0], a[1], a[2], b[0], b[1], b[2]);
    }
}

/* Lays the quad over the picture. */
static void draw_quad(const quad *q, const arris_pose *pose, float *picture) {
    double p[4][2], side[4][3], box[4] = {319, 239, 0, 0};
    for (int i = 0; i < 4; i++) {
        arris_project(&camera, pose, q->corner[i], &p[i][0], &p[i][1]);
        box[0] = fmin(box[0], p[i][0] - 4), box[1] = fmin(box[1], p[i][1] - 4);
        box[2] = fmax(box[2], p[i][0] + 4), box[3] = fmax(box[3], p[i][1] + 4);
    }
    for (int i = 0; i < 4; i++) {
        double dx = p[(i + 1) % 4][0] - p[i][0], dy = p[(i + 1) % 4][1] - p[i][1];
        double length = hypot(dx, dy) * BLUR * M_SQRT2;
        side[i][0] = dy / length, side[i][1] = -dx / length;
        side[i][2] = -side[i][0] * p[i][0] - side[i][1] * p[i][1];
    }
    for (int y = (int)fmax(box[1], 0); y <= (int)fmin(box[3], 239); y++)
        for (int x = (int)fmax(box[0], 0); x <= (int)fmin(box[2], 319); x++) {
            double in = 1;
            for (int i = 0; i < 4 && in > 0; i++) {
                double d = side[i][0] * x + side[i][1] * y + side[i][2];
                in *= d > 4 ? 0 : d < -4 ? 1 : erfc(d) / 2;
            }
            float *g = &picture[y * 320 + x];
            *g += (float)(in * (q->grey - (double)*g));
        }
}

static void draw_all(const arris_pose *pose, double ground, arris_image *out) {
    static float picture[320 * 240];
    for (int i = 0; i < 320 * 240; i++)
        picture[i] = (float)ground;
    for (int i = 0; i < n_quads; i++)
        draw_quad(&quads[i], pose, picture);
    for (int y = 0; y < 240; y++)
        for (int x = 0; x < 320; x++)
            out->data[y * out->stride + x] =
                (uint8_t)fmax(0, fmin(255, rint((double)picture[y * 320 + x] + NOISE * normal())));
}

static void begin_drawing(uint64_t with) {
    begin(with);
    n_quads = 0;
    now.frames = 60;
}

static void play_pictures(void (*draw)(int, arris_pose *, arris_image *)) {
    now.draw = draw;
    play_with("track");
}

static arris_pose along_x(int i) {
    return pose_at((i - 30) * 4.1, 0, 0, 0, 0, 0);
}

static void draw_still(int i, arris_pose *pose, arris_image *out) {
    *pose = along_x(i);
    draw_all(pose, 110, out);
}

static int measured_of(int from, int to) {
    int n = 0;
    for (int e = from; e < to; e++)
        n += is_measured(e);
    return n;
}

/* Grey plates before bright and dark stripes: their edges flip polarity as the camera passes, at
 * one end before the other, and the stripes' end on them in T-junctions. A short stretch of the
 * other polarity may stay a line of its own. */
static void plates_before_stripes(void **state) {
    (void)state;
    for (uint64_t s = 1; s < 4; s++) {
        begin_drawing(s);
        for (int k = -3; k < 4; k++)
            add_quad(200 * k, 0, 1100, 100, 900, 0.05, k % 2 ? 45 : 215, true);
        add_quad(-90, 10, 800, 110, 90, 0.25, 128, true);
        add_quad(100, -20, 750, 90, 110, -0.2, 128, true);
        play_pictures(draw_still);
        int twice, n = true_lines(&twice);
        assert_true(n >= 16 && twice <= 1);
        assert_int_equal(measured_of(4 * 7, n_edges), 8);
    }
}

/* One plate passes before others and hides them in part or whole for a while. */
static void plates_that_hide_others(void **state) {
    (void)state;
    for (uint64_t s = 1; s < 4; s++) {
        begin_drawing(s);
        for (int k = 0; k < 3; k++)
            add_quad(-110 + 110 * k, 10 * k, 1000, 60, 100, 0.2 - 0.15 * k, k % 2 ? 40 : 210, true);
        add_quad(0, 0, 500, 50, 400, 0.1, 160, true);
        play_pictures(draw_still);
        assert_true(assert_true_lines() >= 10);
    }
}

/* Plates under a light that fades and comes back. */
static void draw_flickering(int i, arris_pose *pose, arris_image *out) {
    *pose = along_x(i);
    for (int k = 0; k < n_quads; k++)
        quads[k].grey = 110 + (k % 2 ? 1 : -1) * (60 + 35 * sin(0.5 * i));
    draw_all(pose, 110 + 20 * sin(0.5 * i), out);
}

static void light_that_flickers(void **state) {
    (void)state;
    for (uint64_t s = 1; s < 4; s++) {
        begin_drawing(s);
        add_quad(-100, 10, 800, 90, 90, 0.25, 0, true);
        add_quad(90, -20, 750, 90, 110, -0.2, 0, true);
        add_quad(0, 30, 900, 60, 60, 0.5, 0, true);
        play_pictures(draw_flickering);
        assert_int_equal(assert_true_lines(), 12);
    }
}

/* A bar of light that swings over the plates, and a shadow that swings the other way. */
static void draw_highlights(int i, arris_pose *pose, arris_image *out) {
    *pose = along_x(i);
    n_quads -= 2;
    add_quad(-60 + 6 * sin(0.5 * i), 0, 1000, 30, 250, 0.1, 190, false);
    add_quad(60 + 9 * cos(0.4 * i), 0, 1000, 40, 250, -0.1, 70, false);
    draw_all(pose, 110, out);
}

static void light_that_wanders(void **state) {
    (void)state;
    for (uint64_t s = 1; s < 4; s++) {
        begin_drawing(s);
        add_quad(-150, 10, 800, 60, 90, 0.25, 40, true);
        add_quad(150, -20, 750, 60, 110, -0.2, 210, true);
        n_quads += 2;
        play_pictures(draw_highlights);
        assert_true(assert_true_lines() >= 6);
    }
}

/* Frames of nothing and of noise alone between good ones. */
static void draw_with_blanks(int i, arris_pose *pose, arris_image *out) {
    *pose = along_x(i);
    int n = n_quads;
    n_quads = i % 20 >= 12 ? 0 : n;
    draw_all(pose, 110, out);
    n_quads = n;
    for (int k = 0; i % 20 >= 16 && k < 240; k++)
        for (int x = 0; x < 320; x++)
            out->data[k * out->stride + x] = (uint8_t)(255 * uniform());
}

static void blanks_and_noise_between(void **state) {
    (void)state;
    for (uint64_t s = 1; s < 3; s++) {
        begin_drawing(s);
        add_quad(-100, 10, 800, 90, 90, 0.25, 40, true);
        add_quad(90, -20, 750, 90, 110, -0.2, 210, true);
        play_pictures(draw_with_blanks);
        assert_int_equal(assert_true_lines(), 8);
    }
}

int main(int argc, char **argv) {
    if (!find_stages())
        return 1;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(plates_before_stripes),    cmocka_unit_test(plates_that_hide_others),
        cmocka_unit_test(light_that_flickers),      cmocka_unit_test(light_that_wanders),
        cmocka_unit_test(blanks_and_noise_between),
    };
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
