/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * pad.c: pads the first N frames of a recording to 640x480 on the right and below, which leaves the
 * camera's parameters as they are but for its size:
 *
 *     pad FROM/frames.csv TO N        writes TO/frames.csv, TO/camera.json, TO/0000.pgm ...
 *
 * The padding continues the last column and row, so that it adds no edges of its own.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bytes.h"
#include "camera.h"
#include "image/frames.h"
#include "image/picture.h"

enum { WIDTH = 640, HEIGHT = 480 };

static void die(const char *what) {
    fprintf(stderr, "pad: %s\n", what);
    exit(1);
}

static FILE *create(const char *folder, const char *name) {
    char path[FRAMES_PATH];
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

static void pad(const frame_list *l, size_t i, const char *to, FILE *csv) {
    static uint8_t grey[WIDTH * HEIGHT];
    char path[FRAMES_PATH], name[32];
    bytes file = {.data = NULL};
    picture_info info;
    fault f;
    const frame_entry *e = &l->item[i];
    if (frames_path(l, e->file, path, &f) || bytes_read(&file, path, 1 << 24, &f) ||
        picture_read_info(file.data, file.n, &info, &f))
        die(f.text);
    if (info.width > WIDTH || info.height > HEIGHT || info.format != ARRIS_GREY8)
        die("the pictures are too large");
    arris_image im = {ARRIS_GREY8, info.width, info.height, info.width, NULL, grey};
    if (picture_decode(file.data, file.n, &im, &f))
        die(f.text);
    free(file.data);
    snprintf(name, sizeof name, "%04zu.pgm", i);
    write_picture(create(to, name), &im);
    fprintf(csv, "%lld,%s,%lld", (long long)e->index, name, (long long)e->utime);
    for (int k = 0; k < 6; k++)
        fprintf(csv, ",%.17g", e->pose[k]);
    fputc('\n', csv);
}

static void write_camera(const frame_list *l, const char *to) {
    char path[FRAMES_PATH];
    arris_camera c;
    fault f;
    if (frames_path(l, "camera.json", path, &f) || camera_load(path, &c, &f))
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
    frame_list l = {.n = 0};
    fault f;
    if (argc != 4)
        die("usage: pad FROM/frames.csv TO N");
    if (frames_load(&l, argv[1], 40000, &f))
        die(f.text);
    write_camera(&l, argv[2]);
    FILE *csv = create(argv[2], "frames.csv");
    fputs("index,file,utime,x,y,z,omega,theta,kappa\n", csv);
    for (size_t i = 0; i < l.n && i < (size_t)atol(argv[3]); i++)
        pad(&l, i, argv[2], csv);
    frames_free(&l);
    return fclose(csv) != 0;
}
