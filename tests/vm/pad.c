/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * pad.c: pads the first N frames of a recording to 640x480 on the right and below, which leaves the
 * camera's parameters as they are but for its size:
 *
 *     pad FROM TO N        writes TO/frames.csv, TO/camera.json, TO/0000.pgm ...
 *
 * The padding continues the last column and row, so that it adds no edges of its own.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bytes.h"
#include "camera.h"
#include "image/picture.h"

enum { WIDTH = 640, HEIGHT = 480, MAX_PATH = 4096 };

static void die(const char *what) {
    fprintf(stderr, "pad: %s\n", what);
    exit(1);
}

static FILE *create(const char *folder, const char *name) {
    char path[MAX_PATH];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *f = fopen(path, "w");
    if (!f)
        die(path);
    return f;
}

static void write_picture(FILE *out, const arris_image *im) {
    static uint8_t row[WIDTH];
    fprintf(out, "P5 %d %d 255\n", WIDTH, HEIGHT);
    for (int y = 0; y < HEIGHT; y++) {
        const uint8_t *from = im->data + (y < im->height ? y : im->height - 1) * im->stride;
        for (int x = 0; x < WIDTH; x++)
            row[x] = from[x < im->width ? x : im->width - 1];
        fwrite(row, 1, WIDTH, out);
    }
    if (fclose(out))
        die("cannot write");
}

/* A line of the list: its picture is padded, and stands in its place. */
static void pad(const char *from, const char *line, int i, const char *to, FILE *csv) {
    static uint8_t grey[WIDTH * HEIGHT];
    char path[MAX_PATH], name[32];
    int begin = (int)strcspn(line, ",") + 1, n = (int)strcspn(line + begin, ",");
    bytes file = {.data = NULL};
    picture_info info;
    fault f;
    snprintf(path, sizeof path, "%s/%.*s", from, n, line + begin);
    if (bytes_read(&file, path, 1 << 24, &f) || picture_read_info(file.data, file.n, &info, &f))
        die(f.text);
    if (info.width > WIDTH || info.height > HEIGHT || info.format != ARRIS_GREY8)
        die("the pictures are too large");
    arris_image im = {ARRIS_GREY8, info.width, info.height, info.width, NULL, grey};
    if (picture_decode(file.data, file.n, &im, &f))
        die(f.text);
    free(file.data);
    snprintf(name, sizeof name, "%04d.pgm", i);
    write_picture(create(to, name), &im);
    fprintf(csv, "%.*s%s%s", begin, line, name, line + begin + n);
}

static void write_camera(const char *from, const char *to) {
    char path[MAX_PATH];
    arris_camera c;
    fault f;
    snprintf(path, sizeof path, "%s/camera.json", from);
    if (camera_load(path, &c, &f))
        die(f.text);
    FILE *out = create(to, "camera.json");
    fprintf(out,
            "{\"width\": %d, \"height\": %d, \"fx\": %.17g, \"fy\": %.17g, \"skew\": %.17g,\n"
            " \"cx\": %.17g, \"cy\": %.17g, \"k1\": %.17g, \"k2\": %.17g, \"p1\": %.17g,\n"
            " \"p2\": %.17g, \"k3\": %.17g}\n",
            WIDTH, HEIGHT, c.fx, c.fy, c.skew, c.cx, c.cy, c.k1, c.k2, c.p1, c.p2, c.k3);
    if (fclose(out))
        die("cannot write");
}

int main(int argc, char **argv) {
    char path[MAX_PATH], line[1024];
    if (argc != 4)
        die("usage: pad FROM TO N");
    write_camera(argv[1], argv[2]);
    snprintf(path, sizeof path, "%s/frames.csv", argv[1]);
    FILE *list = fopen(path, "r"), *csv = create(argv[2], "frames.csv");
    if (!list || !fgets(line, sizeof line, list))
        die("there is no list");
    fputs(line, csv);
    for (int i = 0; i < atoi(argv[3]) && fgets(line, sizeof line, list); i++)
        pad(argv[1], line, i, argv[2], csv);
    return fclose(list) || fclose(csv);
}
