/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * scan.c: runs `arris` on a scan and reads lines.json, segments.csv and frames.csv.
 */
#include "scan.h"

#include <errno.h>
#include <jansson.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "bytes.h"
#include "camera.h"
#include "csv.h"
#include "frames.h"

/* ---- files ---------------------------------------------------------------------------------- */

void die(const char *format, ...) {
    va_list a;
    va_start(a, format);
    fprintf(stderr, "experiment: ");
    vfprintf(stderr, format, a);
    fputc('\n', stderr);
    va_end(a);
    exit(2);
}

char *in_build(const char *format, ...) {
    char path[4096], *whole;
    const char *b = getenv("B");
    va_list a;
    va_start(a, format);
    vsnprintf(path, sizeof path, format, a);
    va_end(a);
    if (asprintf(&whole, "%s/%s", b ? b : "build", path) < 0)
        die("out of memory");
    return whole;
}

char *make_folder(const char *name) {
    char *path = in_build("experiments/%s", name);
    if (mkdir(path, 0777) && errno != EEXIST)
        die("cannot make %s: %s", path, strerror(errno));
    return path;
}

FILE *create(const char *format, ...) {
    char path[4096];
    va_list a;
    va_start(a, format);
    vsnprintf(path, sizeof path, format, a);
    va_end(a);
    FILE *f = fopen(path, "wb");
    if (!f)
        die("cannot write %s: %s", path, strerror(errno));
    return f;
}

void finish(FILE *f) {
    if (ferror(f) | fclose(f))
        die("a file could not be written: %s", strerror(errno));
}

/* An array of n items of `size`, zero. */
static void *array(size_t n, size_t size) {
    void *p = calloc(n + 1, size);
    if (!p)
        die("out of memory");
    return p;
}

/* ---- poses and camera ----------------------------------------------------------------------- */

static void read_poses(scan *s, const char *path) {
    fault why;
    frame_list list;
    char camera[FRAMES_PATH];
    if (frames_load(&list, path, 0, &why) || frames_path(&list, "camera.json", camera, &why) ||
        camera_load(camera, &s->camera, &why))
        die("%s", why.text);
    s->camera = arris_camera_ideal(&s->camera);
    s->frames = (int)list.n;
    s->pose = array(list.n, sizeof *s->pose);
    for (size_t i = 0; i < list.n; i++)
        frames_pose(&list.item[i], &s->pose[i]);
    frames_free(&list);
}

/* ---- segments.csv --------------------------------------------------------------------------- */

static int lines_of(const char *text) {
    int n = 0;
    for (; *text; text++)
        n += *text == '\n';
    return n;
}

static void read_segments(scan *s, const char *path) {
    static const char *const names[] = {"frame", "track", "x1", "y1", "x2", "y2"};
    fault why;
    bytes text = {0};
    csv c;
    int at[6], more;
    if (bytes_read(&text, path, SIZE_MAX / 2, &why))
        die("%s", why.text);
    s->seen = array((size_t)lines_of((char *)text.data), sizeof *s->seen);
    if (csv_open(&c, path, (char *)text.data, text.n, &why) || csv_columns(&c, names, 6, at, &why))
        die("%s", why.text);
    while ((more = csv_next(&c, &why)) == 1) {
        double v[6];
        for (int k = 0; k < 6; k++)
            if (csv_number(&c, at[k], &v[k], &why))
                die("%s", why.text);
        s->seen[s->n_seen++] = (seen){(int)v[0], (int)v[1], {v[2], v[3], v[4], v[5]}};
    }
    if (more)
        die("%s", why.text);
    free(text.data);
}

/* ---- JSON ----------------------------------------------------------------------------------- */

/* The array `lines` of a file; the root is for json_decref. */
static json_t *load_lines(const char *path, json_t **root) {
    json_error_t e;
    *root = json_load_file(path, 0, &e);
    json_t *lines = json_object_get(*root, "lines");
    if (!json_is_array(lines))
        die("%s: %s", path, *root ? "it has no array 'lines'" : e.text);
    return lines;
}

static void read_vector(const json_t *o, const char *key, int n, double *v) {
    const json_t *a = json_object_get(o, key);
    for (int i = 0; i < n; i++)
        v[i] = json_number_value(json_array_get(a, (size_t)i));
}

static enum arris_line_state state_of(const json_t *o) {
    const char *state = json_string_value(json_object_get(o, "state"));
    return !state || !strcmp(state, "unobservable") ? ARRIS_UNOBSERVABLE
           : !strcmp(state, "weak")                 ? ARRIS_WEAK
                                                    : ARRIS_MEASURED;
}

static void read_lines(scan *s, const char *path) {
    size_t i;
    json_t *root, *o, *lines = load_lines(path, &root);
    s->line = array(json_array_size(lines), sizeof *s->line);
    json_array_foreach(lines, i, o) {
        arris_line *l = &s->line[s->n++];
        l->id = (int32_t)json_integer_value(json_object_get(o, "id"));
        l->state = state_of(o);
        read_vector(o, "p", 3, l->p);
        read_vector(o, "q", 3, l->q);
        read_vector(o, "cov", 21, l->cov);
    }
    json_decref(root);
}

truth truth_load(const char *path) {
    truth t = {0};
    size_t i;
    json_t *root, *o, *lines = load_lines(path, &root);
    json_array_foreach(lines, i, o) {
        if (t.n == EDGES)
            die("%s has more than %d edges", path, EDGES);
        edge *e = &t.edge[t.n++];
        read_vector(o, "p", 3, e->p);
        read_vector(o, "q", 3, e->q);
        e->observable = json_is_true(json_object_get(o, "observable"));
    }
    json_decref(root);
    return t;
}

/* ---- the run -------------------------------------------------------------------------------- */

scan scan_measure(const char *list, const char *source, const char *segments,
                  const char *reconstruct) {
    scan s = {0};
    char *command, *arris = in_build("arris");
    char *lines = in_build("experiments/%d.lines.json", (int)getpid());
    char *segs = in_build("experiments/%d.segments.csv", (int)getpid());
    if (asprintf(&command,
                 "'%s' launch \"imagesrc location='%s' %s ! edges ! undistort "
                 "! segments %s ! track ! filesink location='%s' ! reconstruct %s "
                 "! filesink location='%s'\"",
                 arris, list, source, segments, segs, reconstruct, lines) < 0)
        die("out of memory");
    if (system(command))
        die("this failed: %s", command);
    read_poses(&s, list);
    read_segments(&s, segs);
    read_lines(&s, lines);
    remove(lines);
    remove(segs);
    free(arris);
    free(command);
    free(lines);
    free(segs);
    return s;
}

void scan_free(scan *s) {
    free(s->pose);
    free(s->seen);
    free(s->line);
}
