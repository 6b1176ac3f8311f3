/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_image.c: the decoders against the formulas that the pictures were made by, each file cut off
 * at every byte; camera.json and frames.csv with every fault; and imagesrc in a real pipeline.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "bytes.h"
#include "camera.h"
#include "frames.h"
#include "image/picture.h"
#include "internal.h"
#include "scratch.h"

#define DATA "tests/data/image/"
#define HEADER "index,file,utime,x,y,z,omega,theta,kappa\n"

static bool has(const char *text, const char *part) {
    if (strstr(text, part))
        return true;
    print_error("\"%s\" is not in: %s\n", part, text);
    return false;
}

static bytes load(const char *path) {
    fault f;
    bytes b = {0};
    if (bytes_read(&b, path, 1 << 20, &f))
        fail_msg("%s", f.text);
    return b;
}

/* ---- the decoders ---------------------------------------------------------------------------- */

/* The formulas of tests/data/image/make.py. */
static int grey8(int x, int y) {
    return (7 * x + 13 * y + x * y) & 255;
}
static int grey16(int x, int y) {
    return (2621 * x + 4099 * y + 17 * x * y) & 65535;
}
static int luma(double r, double g, double b) {
    return (int)floor(0.299 * r + 0.587 * g + 0.114 * b + 0.5);
}
static int rgb8(int x, int y) {
    return luma(grey8(x, y), (13 * x + 7 * y) & 255, (5 * x + 3 * y + 40) & 255);
}
static int rgb16(int x, int y) {
    return luma(grey16(x, y), (4099 * x + 2621 * y) & 65535, (1031 * x + 509 * y) & 65535);
}
static int bits1(int x, int y) {
    return ((x + 2 * y) & 1) * 255;
}
static int bits2(int x, int y) {
    return ((x + 2 * y) & 3) * 85;
}
static int bits4(int x, int y) {
    return ((x + 2 * y) & 15) * 17;
}
static int palette(int k) {
    return luma(3 * k & 255, (255 - 5 * k) & 255, 7 * k & 255);
}
static int palette1(int x, int y) {
    return palette(grey8(x, y) & 1);
}
static int palette2(int x, int y) {
    return palette(grey8(x, y) & 3);
}
static int palette4(int x, int y) {
    return palette(grey8(x, y) & 15);
}
static int palette8(int x, int y) {
    return palette(grey8(x, y));
}
static int max100(int x, int y) {
    return (int)floor(grey8(x, y) % 101 * 255 / 100.0 + 0.5);
}
static int max4095(int x, int y) {
    return (int)floor((grey16(x, y) & 4095) * 65535 / 4095.0 + 0.5);
}
static int smooth(int x, int y) {
    return 2 * x + 3 * y + 20;
}
static int smooth_rgb(int x, int y) {
    return luma(2 * x + 3 * y + 20, 200 - 2 * x, 5 * y + 30);
}

static const struct picture {
    const char *file;
    enum arris_format format;
    int width, height;
    int (*level)(int x, int y);
    int off; /* the most that a level may be off: by the rounding of the luma, and by JPEG */
} pictures[] = {
    {"grey1.png", ARRIS_GREY8, 19, 11, bits1, 0},
    {"grey2.png", ARRIS_GREY8, 19, 11, bits2, 0},
    {"grey4.png", ARRIS_GREY8, 19, 11, bits4, 0},
    {"grey8.png", ARRIS_GREY8, 19, 11, grey8, 0},
    {"grey16.png", ARRIS_GREY16, 19, 11, grey16, 0},
    {"greya8.png", ARRIS_GREY8, 19, 11, grey8, 0},
    {"greya16.png", ARRIS_GREY16, 19, 11, grey16, 0},
    {"rgb8.png", ARRIS_GREY8, 19, 11, rgb8, 1},
    {"rgba8.png", ARRIS_GREY8, 19, 11, rgb8, 1},
    {"rgb16.png", ARRIS_GREY16, 19, 11, rgb16, 1},
    {"rgba16.png", ARRIS_GREY16, 19, 11, rgb16, 1},
    {"palette1.png", ARRIS_GREY8, 19, 11, palette1, 1},
    {"palette2.png", ARRIS_GREY8, 19, 11, palette2, 1},
    {"palette4.png", ARRIS_GREY8, 19, 11, palette4, 1},
    {"palette8.png", ARRIS_GREY8, 19, 11, palette8, 1},
    {"interlaced_grey1.png", ARRIS_GREY8, 19, 11, bits1, 0},
    {"interlaced_grey16.png", ARRIS_GREY16, 19, 11, grey16, 0},
    {"interlaced_rgb8.png", ARRIS_GREY8, 19, 11, rgb8, 1},
    {"interlaced_rgb16.png", ARRIS_GREY16, 19, 11, rgb16, 1},
    {"interlaced_palette4.png", ARRIS_GREY8, 19, 11, palette4, 1},
    {"grey8.pgm", ARRIS_GREY8, 19, 11, grey8, 0},
    {"grey16.pgm", ARRIS_GREY16, 19, 11, grey16, 0},
    {"max100.pgm", ARRIS_GREY8, 19, 11, max100, 0},
    {"max4095.pgm", ARRIS_GREY16, 19, 11, max4095, 0},
    {"text8.pgm", ARRIS_GREY8, 19, 11, grey8, 0},
    {"text4095.pgm", ARRIS_GREY16, 19, 11, max4095, 0},
    {"grey.jpg", ARRIS_GREY8, 45, 29, smooth, 2},
    {"colour.jpg", ARRIS_GREY8, 45, 29, smooth_rgb, 2},
    {"progressive.jpg", ARRIS_GREY8, 45, 29, smooth_rgb, 2},
};

enum { STRIDE = 128, ROWS = 29 };
static _Alignas(64) uint8_t pixels[STRIDE * ROWS];

static arris_image blank(const struct picture *p) {
    memset(pixels, 0xa5, sizeof pixels);
    return (arris_image){p->format, p->width, p->height, STRIDE, NULL, pixels};
}

static int level(const arris_image *im, int x, int y) {
    const uint8_t *row = im->data + y * im->stride;
    return im->format == ARRIS_GREY8 ? row[x] : ((const uint16_t *)(const void *)row)[x];
}

/* Every level is right, and nothing is written beside the rows. */
static void assert_picture(const struct picture *p, const arris_image *im) {
    for (int y = 0; y < p->height; y++) {
        for (int x = 0; x < p->width; x++)
            if (abs(level(im, x, y) - p->level(x, y)) > p->off)
                fail_msg("%s: (%d, %d) is %d, not %d", p->file, x, y, level(im, x, y),
                         p->level(x, y));
        for (int k = p->width * (int)p->format; k < STRIDE; k++)
            assert_int_equal(im->data[y * STRIDE + k], 0xa5);
    }
}

static void every_kind_of_picture(void **state) {
    (void)state;
    for (size_t k = 0; k < COUNT(pictures); k++) {
        const struct picture *p = &pictures[k];
        char path[100];
        fault f;
        picture_info info;
        snprintf(path, sizeof path, DATA "%s", p->file);
        bytes b = load(path);
        assert_int_equal(picture_read_info(b.data, b.n, &info, &f), 0);
        assert_int_equal(info.format, p->format);
        assert_int_equal(info.width, p->width);
        assert_int_equal(info.height, p->height);
        arris_image im = blank(p);
        if (picture_decode(b.data, b.n, &im, &f))
            fail_msg("%s: %s", p->file, f.text);
        assert_picture(p, &im);
        free(b.data);
    }
}

/* The first n bytes, in memory of just that size, so that a checker sees what is read beyond. */
static int decode_part(const struct picture *p, const uint8_t *data, size_t n, fault *f) {
    uint8_t *part = malloc(n ? n : 1);
    memcpy(part, data, n);
    picture_info info;
    arris_image im = blank(p);
    int r = picture_read_info(part, n, &info, f);
    if (r == 0)
        r = picture_decode(part, n, &im, f);
    free(part);
    return r;
}

static void cut_off_at_every_byte(void **state) {
    (void)state;
    for (size_t k = 0; k < COUNT(pictures); k++) {
        const struct picture *p = &pictures[k];
        char path[100];
        fault f;
        snprintf(path, sizeof path, DATA "%s", p->file);
        bytes b = load(path);
        /* in text, the last number may end with any digit, and the line end may lack */
        size_t last = strncmp(p->file, "text", 4) == 0 ? b.n - 5 : b.n;
        for (size_t n = 0; n < last; n++) {
            f.text[0] = 0;
            if (decode_part(p, b.data, n, &f) != ARRIS_E_INPUT)
                fail_msg("%s: %zu of %zu bytes are no error", p->file, n, b.n);
            assert_int_not_equal(f.text[0], 0);
        }
        assert_int_equal(decode_part(p, b.data, b.n, &f), 0);
        free(b.data);
    }
}

/* PNG guards every byte by a checksum: whichever is changed, it is noticed. */
static void changed_png(void **state) {
    (void)state;
    const struct picture *p = &pictures[3];
    bytes b = load(DATA "grey8.png");
    fault f;
    for (size_t k = 0; k < b.n; k++) {
        b.data[k] ^= 0x10;
        picture_info info;
        arris_image im = blank(p);
        int r = picture_read_info(b.data, b.n, &info, &f);
        if (r == 0 && info.width == p->width && info.height == p->height &&
            info.format == p->format)
            r = picture_decode(b.data, b.n, &im, &f);
        else
            r = ARRIS_E_INPUT;
        assert_int_equal(r, ARRIS_E_INPUT);
        b.data[k] ^= 0x10;
    }
    free(b.data);
}

static void limits_of_size(void **state) {
    (void)state;
    static const struct {
        const char *text, *why;
    } pgm[] = {{"P5 8192 8192 255\n", NULL},        {"P5 8193 1 255\n", "8193x1; the limits"},
               {"P5 1 8193 255\n", "8192x8192"},    {"P5 0 5 255\n", "0x5"},
               {"P5 5 5 0\n", "header is damaged"}, {"P5 5 5 65536\n", "header is damaged"},
               {"P5 -5 5 255\n", "header"},         {"P5 99999999999999999999 5 255\n", "header"},
               {"P6 5 5 255\n", "no PNG, JPEG"},    {"", "no PNG, JPEG"}};
    for (size_t k = 0; k < COUNT(pgm); k++) {
        fault f;
        picture_info info;
        int r = picture_read_info((const uint8_t *)pgm[k].text, strlen(pgm[k].text), &info, &f);
        assert_int_equal(r, pgm[k].why ? ARRIS_E_INPUT : 0);
        assert_true(!pgm[k].why || has(f.text, pgm[k].why));
    }
}

static void pgm_above_maxval(void **state) {
    (void)state;
    static const char *const bad[] = {"P5 2 1 100\n\x64\x65", "P2 2 1 100\n100 101\n",
                                      "P2 2 1 255\n256 0\n", "P2 2 1 255\n-1 0\n"};
    const struct picture p = {.format = ARRIS_GREY8, .width = 2, .height = 1};
    fault f;
    for (size_t k = 0; k < COUNT(bad); k++)
        assert_int_equal(decode_part(&p, (const uint8_t *)bad[k], strlen(bad[k]), &f),
                         ARRIS_E_INPUT);
    assert_int_equal(decode_part(&p, (const uint8_t *)"P5 2 1 100\nd2", 13, &f), 0);
}

/* ---- camera.json ----------------------------------------------------------------------------- */

#define CAMERA                                                                                     \
    "\"width\": 320, \"height\": 240, \"fx\": 380.5, \"fy\": 378.25, \"skew\": 0.125, "            \
    "\"cx\": 153.5, \"cy\": 119.75, \"k1\": -0.25, \"k2\": 0.375, \"p1\": 1e-3, \"p2\": 5e-05"

static int parse_camera(const char *text, arris_camera *c, fault *f) {
    return camera_parse(text, strlen(text), "a/camera.json", c, f);
}

static void camera_whole(void **state) {
    (void)state;
    arris_camera c;
    fault f;
    const arris_camera want = {320,    240,   380.5, 378.25, 0.125, 153.5,
                               119.75, -0.25, 0.375, 1e-3,   5e-05, 0.5};
    assert_int_equal(parse_camera("{" CAMERA ", \"k3\": 0.5, \"board\": [9, {}]}", &c, &f), 0);
    assert_true(arris_camera_same(&c, &want));
    assert_int_equal(parse_camera("{" CAMERA ", \"k3\": 0}", &c, &f), 0);
}

static void camera_faults(void **state) {
    (void)state;
    static const struct {
        const char *text, *why;
    } bad[] = {
        {"", "a/camera.json:1:0: "},
        {"[]", "a/camera.json: this is no JSON object"},
        {"{" CAMERA "}", "a/camera.json: \"k3\" is missing"},
        {"{\"width\": 320}", "a/camera.json: \"height\" is missing"},
        {"{" CAMERA ", \"k3\": \"0\"}", "a/camera.json: \"k3\" is no number"},
        {"{" CAMERA ", \"k3\": null}", "\"k3\" is no number"},
        {"{" CAMERA ",\n\"k3\": NaN}", "a/camera.json:2:9: after \"k3\": invalid token near 'NaN'"},
        {"{" CAMERA ", \"k3\": Infinity}", "after \"k3\""},
        {"{" CAMERA ", \"k3\": 1e999}", "after \"k3\": real number overflow"},
        {"{" CAMERA ", \"k3\": 1, \"fx\": 2}", "duplicate object key"},
        {"{\"width\": 320.5}", "\"width\" is 320.5, which is no count of pixels"},
        {"{\"width\": 1e99}", "\"width\" is 1e+99"},
        {"{\"width\": 0}", "\"width\" is 0"},
        {"{\"width\": 4, \"height\": 3, \"fx\": 0, \"fy\": 1, \"skew\": 0, \"cx\": 0, \"cy\": 0,"
         "\"k1\": 0, \"k2\": 0, \"p1\": 0, \"p2\": 0, \"k3\": 0}",
         "focal lengths"},
    };
    for (size_t k = 0; k < COUNT(bad); k++) {
        arris_camera c;
        fault f = {.hint = NULL};
        assert_int_equal(parse_camera(bad[k].text, &c, &f), ARRIS_E_INPUT);
        assert_true(has(f.text, bad[k].why));
        assert_non_null(f.hint);
    }
}

/* ---- frames.csv ------------------------------------------------------------------------------ */

static int parse_frames(const char *text, frame_list *l, char **copy, fault *f) {
    memset(l, 0, sizeof *l);
    *copy = strdup(text);
    return frames_parse(l, *copy, strlen(text), "a/frames.csv", f);
}

static void frames_whole(void **state) {
    (void)state;
    frame_list l;
    fault f;
    char *text;
    /* a byte-order mark, other order, a column more, CRLF, quotes, blanks, blank lines */
    int r = parse_frames("\xef\xbb\xbf"
                         "file,index,gain,utime,x,y,z,kappa,omega,\"theta\"\r\n"
                         "a.png,7,9,-5,1,2,3,6,4,5\r\n\r\n"
                         " \"b, \"\"c\"\".png\" , 8 ,,100000000000000000,,,,,,\r\n  \n"
                         "c.png,9,,6,+1e2,-.5,\"0\",0,0,0",
                         &l, &text, &f);
    assert_int_equal(r, 0);
    assert_int_equal(l.n, 3);
    assert_true(l.posed && l.item[0].posed && !l.item[1].posed && l.item[2].posed);
    assert_string_equal(l.item[0].file, "a.png");
    assert_string_equal(l.item[1].file, "b, \"c\".png");
    assert_int_equal(l.item[0].index, 7);
    assert_int_equal(l.item[1].index, 8);
    assert_int_equal(l.item[0].utime, -5);
    assert_int_equal(l.item[1].utime, 100000000000000000);
    for (int k = 0; k < 6; k++)
        assert_true(l.item[0].pose[k] == k + 1);
    assert_true(l.item[2].pose[0] == 100 && l.item[2].pose[1] == -0.5);
    frames_free(&l);
    free(text);
}

static void frames_faults(void **state) {
    (void)state;
    static const struct {
        const char *text, *why;
    } bad[] = {
        {"", "a/frames.csv is empty"},
        {"\n \n", "a/frames.csv is empty"},
        {HEADER, "a/frames.csv has no frames"},
        {"\nindex,file,utime,x,y,z,omega,theta\n",
         "a/frames.csv:2: the header has no column \"kappa\""},
        {"a,b\n", "the header has no column \"index\""},
        {HEADER "0,a.png,0,1,2,3,4,5\n", "a/frames.csv:2: there are 8 fields; the header has 9"},
        {HEADER "0,a.png,0,1,2,3,4,5,6,7\n", "a/frames.csv:2: there are 10 fields"},
        {HEADER "0,a.png,0,,,,,,\n1,,0,,,,,,\n", "a/frames.csv:3: file: this is empty"},
        {HEADER "x,a.png,0,,,,,,\n", "a/frames.csv:2: index: \"x\" is no whole number"},
        {HEADER ",a.png,0,,,,,,\n", "a/frames.csv:2: index: \"\" is no whole number"},
        {HEADER "0,a.png,,,,,,,\n", "a/frames.csv:2: utime: \"\" is no whole number"},
        {HEADER "0,a.png,1.5,,,,,,\n", "a/frames.csv:2: utime: \"1.5\" is no whole number"},
        {HEADER "0,a.png,99999999999999999999,,,,,,\n", "a/frames.csv:2: utime: \"999"},
        {HEADER "0,a.png,0,1,2,,4,,6\n", "a/frames.csv:2: z: this is empty in a pose that is not"},
        {HEADER "0,a.png,0,1,2,3,4,5,\n", "a/frames.csv:2: kappa: this is empty"},
        {HEADER "0,a.png,0,1,2,nan,4,5,6\n", "a/frames.csv:2: z: \"nan\" is no finite number"},
        {HEADER "0,a.png,0,1,2,3,-inf,5,6\n",
         "a/frames.csv:2: omega: \"-inf\" is no finite number"},
        {HEADER "0,a.png,0,1,1e999,3,4,5,6\n", "a/frames.csv:2: y: \"1e999\" is no finite number"},
        {HEADER "0,a.png,0,1,0x2,3,4,5,6\n", "a/frames.csv:2: y: \"0x2\" is no finite number"},
        {HEADER "0,a.png,0,1,2 3,3,4,5,6\n", "a/frames.csv:2: y: \"2 3\" is no finite number"},
        {HEADER "0,a.png,0,1,2e,3,4,5,6\n", "a/frames.csv:2: y: \"2e\" is no finite number"},
        {HEADER "0,\"a.png,0,1,2,3,4,5,6\n", "a/frames.csv:2: the quotes of field 2 do not match"},
        {HEADER "0,\"a\".png,0,1,2,3,4,5,6\n", "a/frames.csv:2: the quotes of field 2"},
    };
    for (size_t k = 0; k < COUNT(bad); k++) {
        frame_list l;
        fault f = {.hint = NULL};
        char *text;
        assert_int_equal(parse_frames(bad[k].text, &l, &text, &f), ARRIS_E_INPUT);
        assert_true(has(f.text, bad[k].why));
        assert_non_null(f.hint);
        frames_free(&l);
        free(text);
    }
}

static void frames_zero_byte(void **state) {
    (void)state;
    char text[] = HEADER "0,a\0b,0,,,,,,\n";
    frame_list l = {.n = 0};
    fault f;
    assert_int_equal(frames_parse(&l, text, sizeof text - 1, "f.csv", &f), ARRIS_E_INPUT);
    assert_true(has(f.text, "byte 44 is zero"));
    frames_free(&l);
}

static void frames_too_many(void **state) {
    (void)state;
    static const char row[] = "0,a,0,,,,,,\n";
    const size_t head = sizeof HEADER - 1, one = sizeof row - 1;
    char *text = malloc(head + (FRAMES_MAX + 1) * one + 1);
    memcpy(text, HEADER, head);
    for (size_t k = 0; k <= FRAMES_MAX; k++)
        memcpy(text + head + k * one, row, one + 1);
    frame_list l = {.n = 0};
    fault f;
    assert_int_equal(frames_parse(&l, text, strlen(text), "f.csv", &f), ARRIS_E_INPUT);
    assert_true(has(f.text, "f.csv:1000002: there are more than 1000000 frames"));
    frames_free(&l);
    free(text);
}

/* R is the product of the three elementary rotations, kappa after theta after omega. */
static void multiply(double a[9], const double b[9]) {
    double p[9];
    for (int i = 0; i < 9; i++)
        p[i] = a[i / 3 * 3] * b[i % 3] + a[i / 3 * 3 + 1] * b[i % 3 + 3] +
               a[i / 3 * 3 + 2] * b[i % 3 + 6];
    memcpy(a, p, sizeof p);
}

static void pose_by_equation_2_7(void **state) {
    (void)state;
    const frame_entry e = {.posed = true, .pose = {10, -20, 30, 0.3, -0.7, 2.1}};
    const double so = sin(0.3), co = cos(0.3), st = sin(-0.7), ct = cos(-0.7), sk = sin(2.1),
                 ck = cos(2.1);
    double R[9] = {ck, sk, 0, -sk, ck, 0, 0, 0, 1};
    multiply(R, (const double[9]){ct, 0, -st, 0, 1, 0, st, 0, ct});
    multiply(R, (const double[9]){1, 0, 0, 0, co, so, 0, -so, co});
    arris_pose pose;
    frames_pose(&e, &pose);
    assert_true(pose.valid && pose.C[0] == 10 && pose.C[1] == -20 && pose.C[2] == 30);
    for (int k = 0; k < 9; k++)
        assert_true(fabs(pose.R[k] - R[k]) < 1e-15);
    for (int k = 0; k < 21; k++)
        assert_true(pose.cov[k] == 0);
}

static void names_as_people_count(void **state) {
    (void)state;
    static const char *const order[] = {"1.png", "2.png", "010.png",  "11.png",
                                        "a",     "a0",    "a1b2.png", "a1b10",
                                        "a02",   "a2",    "a10.png",  "a123456789012345678901",
                                        "b.png"};
    for (size_t i = 0; i < COUNT(order); i++)
        for (size_t k = 0; k < COUNT(order); k++) {
            int d = frames_compare_names(order[i], order[k]);
            assert_int_equal((d > 0) - (d < 0), (i > k) - (i < k));
        }
}

/* ---- imagesrc -------------------------------------------------------------------------------- */

static char dir[PATH_MAX]; /* empty when a test begins */

static int empty_dir(void **state) {
    (void)state;
    strcpy(dir, scratch_mkdir("image"));
    return 0;
}

static void put(const char *name, const void *data, size_t n) {
    char path[PATH_MAX + 32];
    snprintf(path, sizeof path, "%s/%s", dir, name);
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(data, 1, n, file), n);
    assert_int_equal(fclose(file), 0);
}

/* Copies a file of the test data, without its last `less` bytes. */
static void copy(const char *from, const char *name, size_t less) {
    char path[100];
    snprintf(path, sizeof path, DATA "%s", from);
    bytes b = load(path);
    put(name, b.data, b.n - less);
    free(b.data);
}

static void copy_scan(void) {
    copy("scan/frames.csv", "frames.csv", 0);
    copy("scan/camera.json", "camera.json", 0);
    for (int k = 0; k < 4; k++) {
        char name[] = "0.png", from[20];
        name[0] = (char)('0' + k);
        snprintf(from, sizeof from, "scan/%s", name);
        copy(from, name, 0);
    }
}

/* Builds "imagesrc location=DIR/FILE PROPS ! fakesink". */
static arris_pipeline *build(const char *in, const char *file, const char *props,
                             arris_error *err) {
    char line[PATH_MAX + 200];
    snprintf(line, sizeof line, "imagesrc location=%s%s %s ! fakesink", in, file, props);
    arris_pipeline *p = arris_parse(line, err);
    if (!p)
        fail_msg("%s", err->text);
    return p;
}

static arris_pipeline *open_scan(const char *in, const char *file, const char *props) {
    arris_error err;
    arris_pipeline *p = build(in, file, props, &err);
    if (arris_check(p, &err))
        fail_msg("%s", err.text);
    return p;
}

/* The source's next frame, by the stage's own process; NULL at the end. */
static arris_frame *step(arris_pipeline *p) {
    arris_stage *s = p->stage[0];
    arris_frame *f = frame_take(p);
    int r = s->desc->process(s, s->self, f);
    frame_settle(f);
    assert_true(r == 0 || r == ARRIS_END);
    if (r == 0)
        return f;
    frame_release(f);
    return NULL;
}

/* The frames come with this index and utime, and the pixels that say which they are. */
static void assert_plays(arris_pipeline *p, const int *number, const int64_t *utime, int n) {
    for (int k = 0; k < n; k++) {
        arris_frame *f = step(p);
        assert_non_null(f);
        const arris_image *im = arris_layer_get(f, ARRIS_IMAGE);
        assert_int_equal(level(im, 3, 2), 50 * number[k] + 5);
        assert_int_equal(arris_frame_index(f), 10 + number[k]);
        assert_int_equal(arris_frame_utime(f), utime[k]);
        frame_release(f);
    }
}

static void scan_with_poses(void **state) {
    (void)state;
    arris_pipeline *p = open_scan(DATA, "scan/frames.csv", "");
    const arris_caps *caps = &p->stage[0]->caps;
    assert_true(caps->format == ARRIS_GREY8 && caps->width == 16 && caps->height == 12);
    assert_true(caps->fps == 0 && caps->camera && caps->camera->fy == 20.25);
    for (int k = 0; k < 4; k++) {
        arris_frame *f = step(p);
        assert_non_null(f);
        const arris_image *im = arris_layer_get(f, ARRIS_IMAGE);
        const arris_pose *pose = arris_layer_get(f, ARRIS_POSE);
        assert_ptr_equal(im->camera, caps->camera);
        for (int y = 0; y < 12; y++)
            for (int x = 0; x < 16; x++)
                assert_int_equal(level(im, x, y), 50 * k + x + y);
        assert_int_equal(pose->valid, k != 2);
        assert_true(k != 0 || (pose->C[0] == 1.5 && pose->C[1] == -2.25 && pose->C[2] == 300));
        assert_true(k != 3 || (pose->C[0] == -7 && fabs(pose->R[6] - sin(2)) < 1e-15));
        frame_release(f);
    }
    assert_null(step(p));
    arris_free(p);
}

static void start_stop_step_loop(void **state) {
    (void)state;
    static const struct {
        const char *props;
        int n, number[6];
        int64_t utime[6];
    } plays[] = {
        {"start=1 stop=3", 2, {1, 2}, {1040000, 1080000}},
        {"start=3 stop=99", 1, {3}, {1120000}},
        {"step=3", 2, {0, 3}, {1000000, 1120000}},
        {"stop=end step=9", 1, {0}, {1000000}},
        {"stop=2 loop=3",
         6,
         {0, 1, 0, 1, 0, 1},
         {1000000, 1040000, 1080000, 1120000, 1160000, 1200000}},
        {"step=3 loop=2", 4, {0, 3, 0, 3}, {1000000, 1120000, 1240000, 1360000}},
        {"start=2 stop=3 loop=2", 2, {2, 2}, {1080000, 1120000}},
    };
    for (size_t k = 0; k < COUNT(plays); k++) {
        arris_pipeline *p = open_scan(DATA, "scan/frames.csv", plays[k].props);
        assert_plays(p, plays[k].number, plays[k].utime, plays[k].n);
        assert_null(step(p));
        arris_free(p);
    }
    arris_pipeline *p = open_scan(DATA, "scan/frames.csv", "start=3 loop=0");
    int64_t before = 0;
    for (int k = 0; k < 1000; k++) {
        arris_frame *f = step(p);
        assert_non_null(f);
        assert_true(arris_frame_utime(f) > before);
        before = arris_frame_utime(f);
        frame_release(f);
    }
    arris_free(p);
}

/* No POSE, no camera, the numbers in the names by value, times by the rate. */
static void folder_of_pictures(void **state) {
    (void)state;
    copy("scan/0.png", "F2.PNG", 0);
    copy("scan/1.png", "f1.png", 0);
    copy("scan/2.png", "f2.png", 0);
    copy("scan/3.png", "f10.png", 0);
    put(".f0.png", "no", 2);
    put("notes.txt", "no", 2);
    for (int rate = 0; rate < 2; rate++) {
        arris_pipeline *p = open_scan(dir, "", rate ? "fps=500" : "");
        assert_int_equal(p->stage[0]->layers.gives, ARRIS_BIT(ARRIS_IMAGE));
        assert_null(p->stage[0]->caps.camera);
        assert_true(p->stage[0]->caps.fps == (rate ? 500 : 0));
        assert_int_equal(p->stage[0]->live, rate);
        for (int k = 0; k < 4; k++) {
            arris_frame *f = step(p);
            const arris_image *im = arris_layer_get(f, ARRIS_IMAGE);
            assert_int_equal(level(im, 0, 0), 50 * k);
            assert_int_equal(arris_frame_index(f), k);
            assert_int_equal(arris_frame_utime(f), k * (rate ? 2000 : 40000));
            frame_release(f);
        }
        assert_null(step(p));
        arris_free(p);
    }
}

static void sixteen_bits(void **state) {
    (void)state;
    copy("grey16.png", "a.png", 0);
    copy("interlaced_grey16.png", "b.png", 0);
    copy("grey16.pgm", "c.pgm", 0);
    arris_pipeline *p = open_scan(dir, "", "");
    assert_int_equal(p->stage[0]->caps.format, ARRIS_GREY16);
    for (int k = 0; k < 3; k++) {
        arris_frame *f = step(p);
        const arris_image *im = arris_layer_get(f, ARRIS_IMAGE);
        assert_int_equal(im->stride % 64, 0);
        for (int y = 0; y < 11; y++)
            for (int x = 0; x < 19; x++)
                assert_int_equal(level(im, x, y), grey16(x, y));
        frame_release(f);
    }
    arris_free(p);
}

/* What is wrong before the first frame: arris_check says it, with a hint. */
static void refused(const char *file, const char *props, int code, const char *why) {
    arris_error err;
    arris_pipeline *p = build(dir, file, props, &err);
    assert_int_equal(arris_check(p, &err), code);
    assert_int_equal(err.code, code);
    assert_true(has(err.text, why));
    assert_int_not_equal(err.hint[0], 0);
    arris_free(p);
}

static void refused_at_the_start(void **state) {
    (void)state;
    refused("/none", "", ARRIS_E_INPUT, "/none: No such file or directory");
    refused("", "", ARRIS_E_INPUT, "has no pictures");
    copy_scan();
    refused("/frames.csv", "start=4", ARRIS_E_USAGE, "from start=4 to 4 there is no frame");
    refused("/frames.csv", "start=2 stop=1", ARRIS_E_USAGE, "from start=2 to 1");
    refused("/frames.csv", "fps=1e-9", ARRIS_E_USAGE, "at least 0.001");
    refused("/frames.csv", "camera=tests/none.json", ARRIS_E_INPUT, "tests/none.json");
    refused("/0.png", "", ARRIS_E_INPUT, "is no CSV text");
    copy("grey8.png", "0.png", 0);
    refused("/frames.csv", "", ARRIS_E_INPUT,
            "/camera.json is of a camera of 16x12, and the pictures are 19x11");
    put("camera.json", "{}", 2);
    refused("/frames.csv", "", ARRIS_E_INPUT, "/camera.json: \"width\" is missing");
    static const char nan_pose[] = HEADER "0,0.png,0,nan,0,0,0,0,0\n";
    put("frames.csv", nan_pose, sizeof nan_pose - 1);
    refused("/frames.csv", "", ARRIS_E_INPUT, "/frames.csv:2: x: \"nan\" is no finite number");
}

static void only_a_csv_in_the_folder(void **state) {
    (void)state;
    arris_error err;
    put("frames.csv", HEADER, sizeof HEADER - 1);
    arris_pipeline *p = build(dir, "", "", &err);
    assert_int_equal(arris_check(p, &err), ARRIS_E_INPUT);
    assert_true(has(err.text, "has no pictures") && has(err.hint, "it has a frames.csv"));
    arris_free(p);
    p = arris_parse("imagesrc ! fakesink", &err);
    assert_int_equal(arris_check(p, &err), ARRIS_E_USAGE);
    assert_true(has(err.text, "location=") && has(err.hint, "frames.csv"));
    arris_free(p);
}

/* What goes wrong later ends the stream after the frames that were good, with one error. */
static void fails_at(const char *props, uint64_t good, int code, const char *why) {
    arris_pipeline *p = open_scan(dir, "/frames.csv", props);
    arris_error err;
    arris_message m;
    int errors = 0;
    assert_int_equal(arris_start(p, &err), 0);
    for (enum arris_wait_result w; (w = arris_wait(p, &m, 1000)) != ARRIS_WAIT_ENDED;) {
        if (w != ARRIS_WAIT_MESSAGE)
            continue;
        errors += m.severity == ARRIS_ERROR;
        assert_int_equal(m.code, code);
        assert_int_equal(m.frame, good);
        assert_true(has(m.text, why));
        assert_int_not_equal(m.hint[0], 0);
    }
    assert_int_equal(errors, 1);
    assert_int_equal(arris_result(p), code);
    assert_int_equal(arris_get_progress(p).done, good);
    arris_free(p);
}

static void fails_on_the_way(void **state) {
    (void)state;
    copy_scan();
    copy("scan/2.png", "2.png", 20);
    fails_at("", 2, ARRIS_E_INPUT, "/2.png: the PNG is damaged: the file is truncated");
    copy("grey8.png", "2.png", 0);
    fails_at("", 2, ARRIS_E_INPUT,
             "/2.png is 19x11 with 8 bits; the first picture is 16x12 with 8");
    copy("grey16.png", "2.png", 0);
    fails_at("start=1", 1, ARRIS_E_INPUT, "19x11 with 16 bits");
    put("2.png", "", 0);
    fails_at("", 2, ARRIS_E_INPUT, "/2.png: this is no PNG, JPEG or PGM picture");
    const char *path = scratch("image/2.png");
    assert_int_equal(unlink(path), 0);
    fails_at("", 2, ARRIS_E_INPUT, "/2.png: No such file or directory");
    assert_int_equal(mkfifo(path, 0600), 0);
    fails_at("", 2, ARRIS_E_IO, "/2.png is no regular file");
}

/* A bigger file than those before finds its room. */
static void bigger_file_later(void **state) {
    (void)state;
    enum { MUCH = 300000 };
    copy_scan();
    bytes b = load(DATA "scan/3.png");
    char *big = calloc(1, MUCH);
    memcpy(big, b.data, b.n); /* what follows the end of a picture is nobody's */
    put("3.png", big, MUCH);
    free(big);
    free(b.data);
    arris_pipeline *p = open_scan(dir, "/frames.csv", "start=2");
    assert_plays(p, (const int[]){2, 3}, (const int64_t[]){1080000, 1120000}, 2);
    arris_free(p);
}

/* The second frame is due after 1000 s; when asked, it ends all the same. */
static void paced_and_stopped(void **state) {
    (void)state;
    arris_pipeline *p = open_scan(DATA, "scan/frames.csv", "fps=0.001");
    arris_error err;
    arris_message m;
    assert_int_equal(arris_start(p, &err), 0);
    while (arris_get_progress(p).done == 0)
        arris_wait(p, &m, 10);
    arris_stop(p);
    while (arris_wait(p, &m, 1000) != ARRIS_WAIT_ENDED)
        ;
    assert_int_equal(arris_get_progress(p).frames, 1);
    assert_int_equal(arris_result(p), 0);
    arris_free(p);
}

/* An argument chooses tests by name, as "*size*". */
int main(int argc, char **argv) {
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_kind_of_picture),
        cmocka_unit_test(cut_off_at_every_byte),
        cmocka_unit_test(changed_png),
        cmocka_unit_test(limits_of_size),
        cmocka_unit_test(pgm_above_maxval),
        cmocka_unit_test(camera_whole),
        cmocka_unit_test(camera_faults),
        cmocka_unit_test(frames_whole),
        cmocka_unit_test(frames_faults),
        cmocka_unit_test(frames_zero_byte),
        cmocka_unit_test(frames_too_many),
        cmocka_unit_test(pose_by_equation_2_7),
        cmocka_unit_test(names_as_people_count),
        cmocka_unit_test(scan_with_poses),
        cmocka_unit_test(start_stop_step_loop),
        cmocka_unit_test_setup(folder_of_pictures, empty_dir),
        cmocka_unit_test_setup(sixteen_bits, empty_dir),
        cmocka_unit_test_setup(refused_at_the_start, empty_dir),
        cmocka_unit_test_setup(only_a_csv_in_the_folder, empty_dir),
        cmocka_unit_test_setup(fails_on_the_way, empty_dir),
        cmocka_unit_test_setup(bigger_file_later, empty_dir),
        cmocka_unit_test(paced_and_stopped),
    };
    char path[200];
    snprintf(path, sizeof path, "%s/lib/arris", getenv("B") ? getenv("B") : "build");
    setenv("ARRIS_PLUGIN_PATH", path, 1);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
