/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * recording.c: a scan that imagesrc plays again: frames.csv, and beside it frames/0000.png and so
 * on, and camera.json.
 */
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "arris_geometry.h"
#include "output.h"
#include "writers.h"

/* The path of a file beside the CSV. Returns 0 or an errno. */
static int beside(const char *csv, const char *name, char path[PATH_MAX]) {
    const char *slash = strrchr(csv, '/');
    int folder = slash ? (int)(slash - csv) + 1 : 0;
    return snprintf(path, PATH_MAX, "%.*s%s", folder, csv, name) < PATH_MAX ? 0 : ENAMETOOLONG;
}

static void camera_write(FILE *out, const arris_camera *c) {
    fprintf(out, "{\n \"width\": %d,\n \"height\": %d,\n", c->width, c->height);
    fprintf(out, " \"fx\": %.17g,\n \"fy\": %.17g,\n \"skew\": %.17g,\n", c->fx, c->fy, c->skew);
    fprintf(out, " \"cx\": %.17g,\n \"cy\": %.17g,\n", c->cx, c->cy);
    fprintf(out, " \"k1\": %.17g,\n \"k2\": %.17g,\n \"p1\": %.17g,\n", c->k1, c->k2, c->p1);
    fprintf(out, " \"p2\": %.17g,\n \"k3\": %.17g\n}\n", c->p2, c->k3);
}

int recording_begin(recording *r, FILE *csv, const char *location, const arris_caps *caps) {
    char path[PATH_MAX];
    output o = {0};
    const arris_camera *camera = caps->camera;
    *r = (recording){.location = location};
    size_t grey = (size_t)caps->width * (size_t)caps->height * caps->format;
    int error = !png_reserve(&r->buffer, grey) ? ENOMEM : access(location, F_OK) == 0 ? EEXIST : 0;
    if (!error)
        error = beside(location, "frames", path);
    if (!error && mkdir(path, 0777) < 0 && errno != EEXIST)
        error = errno;
    if (!error && camera)
        error = beside(location, "camera.json", path);
    if (!error && camera)
        error = output_open(&o, path);
    if (!error && camera) {
        camera_write(o.file, camera);
        error = output_commit(&o);
    }
    fprintf(csv, "index,file,utime,x,y,z,omega,theta,kappa\n");
    return error;
}

void recording_free(recording *r) {
    free(r->buffer.data);
    *r = (recording){0};
}

/* No FILE: it would be allocated for every picture. */
static int write_file(const char *path, const uint8_t *data, size_t n) {
    int fd = open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666), error = 0;
    if (fd < 0)
        return errno;
    while (n > 0 && !error) {
        ssize_t written = write(fd, data, n);
        if (written < 0 && errno != EINTR)
            error = errno;
        if (written > 0)
            data += written, n -= (size_t)written;
    }
    return close(fd) < 0 && !error ? errno : error;
}

int recording_frame(recording *r, FILE *csv, int64_t index, int64_t utime, const arris_image *image,
                    const arris_pose *pose) {
    char name[40], path[PATH_MAX];
    snprintf(name, sizeof name, "frames/%04llu.png", (unsigned long long)r->n++);
    int error = beside(r->location, name, path);
    if (!error && !png_encode(&r->buffer, image))
        error = EIO;
    if (!error)
        error = write_file(path, r->buffer.data, r->buffer.n);
    fprintf(csv, "%lld,%s,%lld,", (long long)index, name, (long long)utime);
    if (pose && pose->valid) {
        double o, t, k;
        arris_angles(pose->R, &o, &t, &k);
        fprintf(csv, "%.6f,%.6f,%.6f,%.10f,%.10f,%.10f\n", pose->C[0], pose->C[1], pose->C[2], o, t,
                k);
    } else {
        fprintf(csv, ",,,,,\n");
    }
    return error;
}
