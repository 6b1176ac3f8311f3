/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * input.c: reads a scan that filesink wrote (input.h).
 */
#include "input.h"

#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "csv.h"

enum { MAX_LINES = 100000, MAX_SEGMENTS = 10000000 };

/* ---- lines.json ------------------------------------------------------------------------------ */

static const char lines_hint[] = "give it a lines.json that filesink wrote";

static bool read_numbers(const json_t *o, const char *key, double *v, size_t n) {
    const json_t *a = json_object_get(o, key);
    bool good = json_is_array(a) && json_array_size(a) == n;
    for (size_t i = 0; good && i < n; i++) {
        v[i] = json_number_value(json_array_get(a, i));
        good = json_is_number(json_array_get(a, i)) && fabs(v[i]) < 1e12;
    }
    return good;
}

static bool read_state(const json_t *o, enum arris_line_state *state) {
    const char *s = json_string_value(json_object_get(o, "state"));
    *state = s && !strcmp(s, "measured") ? ARRIS_MEASURED
             : s && !strcmp(s, "weak")   ? ARRIS_WEAK
                                         : ARRIS_UNOBSERVABLE;
    return s && (*state != ARRIS_UNOBSERVABLE || !strcmp(s, "unobservable"));
}

static bool read_line(const json_t *o, arris_line *l) {
    const json_t *id = json_object_get(o, "id");
    memset(l, 0, sizeof *l);
    l->into = -1;
    l->id = (int32_t)json_integer_value(id);
    l->views = (uint32_t)fmin(fmax(json_number_value(json_object_get(o, "views")), 0), 1e9);
    l->baseline = json_number_value(json_object_get(o, "baseline"));
    l->rms = json_number_value(json_object_get(o, "rms_px"));
    if (!read_numbers(o, "cov", l->cov, 21) && !json_is_null(json_object_get(o, "cov")))
        return false;
    return json_is_integer(id) && read_state(o, &l->state) && read_numbers(o, "p", l->p, 3) &&
           read_numbers(o, "q", l->q, 3);
}

static int read_lines(const json_t *root, const char *path, arris_lines *lines, fault *f) {
    const char *format = json_string_value(json_object_get(root, "format"));
    const json_t *list = json_object_get(root, "lines");
    size_t n = json_array_size(list);
    if (!format || strcmp(format, "arris-lines/1") != 0 || !json_is_array(list))
        return fault_set(f, ARRIS_E_INPUT, lines_hint, "%s: it is no \"arris-lines/1\"", path);
    if (n > MAX_LINES)
        return fault_set(f, ARRIS_E_INPUT, NULL, "%s: %zu lines are more than %d", path, n,
                         MAX_LINES);
    lines->item = calloc(n + 1, sizeof *lines->item);
    if (!lines->item)
        return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for %zu lines", n);
    lines->max = (uint32_t)n;
    lines->frames =
        (uint32_t)fmin(fmax(json_number_value(json_object_get(root, "frames")), 0), FRAMES_MAX);
    for (; lines->n < n; lines->n++)
        if (!read_line(json_array_get(list, lines->n), &lines->item[lines->n]))
            return fault_set(f, ARRIS_E_INPUT, lines_hint,
                             "%s: line %u of the list lacks its id, state, ends or covariance",
                             path, lines->n + 1);
    return 0;
}

int input_lines(const char *text, size_t n, const char *path, arris_lines *lines, fault *f) {
    json_error_t why;
    json_t *root = json_loadb(text, n, 0, &why);
    if (!root)
        return fault_set(f, ARRIS_E_INPUT, lines_hint, "%s:%d: %s", path, why.line, why.text);
    int rc = read_lines(root, path, lines, f);
    json_decref(root);
    return rc;
}

/* ---- segments.csv ---------------------------------------------------------------------------- */

static const char segments_hint[] =
    "give it a segments.csv that filesink wrote after undistort and track: "
    "frame,id,track,x1,y1,x2,y2,offset_sigma,angle_sigma,...";

enum { FRAME, TRACK, X1, Y1, X2, Y2, OFFSET, ANGLE, CHI2, COLUMNS };
static const char *const names[COLUMNS] = {"frame", "track",        "x1",          "y1",  "x2",
                                           "y2",    "offset_sigma", "angle_sigma", "chi2"};

typedef struct row {
    int64_t frame, track;
    arris_segment s;
} row;

static int read_row(const csv *c, const int *column, row *o, fault *f) {
    double sigma[2], chi2;
    double *const to[] = {&o->s.x1, &o->s.y1, &o->s.x2, &o->s.y2, &sigma[0], &sigma[1], &chi2};
    int rc = csv_integer(c, column[FRAME], &o->frame, f);
    rc = rc ? rc : csv_integer(c, column[TRACK], &o->track, f);
    for (int k = 0; rc == 0 && k < 7; k++)
        rc = csv_number(c, column[X1 + k], to[k], f);
    if (rc == 0 && (o->track < -1 || o->track > INT32_MAX))
        return fault_set(f, ARRIS_E_INPUT, NULL, "%s:%d: track: this is no track", c->path,
                         c->line);
    o->s.chi2 = (float)chi2;
    o->s.cov[0] = sigma[0] * sigma[0];
    o->s.cov[2] = sigma[1] * sigma[1];
    return rc;
}

/* The entry of the frame, looked for from the one of the row before. */
static const frame_entry *entry_of(const frame_list *frames, int64_t index, size_t *at) {
    for (size_t k = 0; k < frames->n; k++) {
        const frame_entry *e = &frames->item[(*at + k) % frames->n];
        if (e->index == index) {
            *at = (*at + k) % frames->n;
            return e;
        }
    }
    return NULL;
}

static int add_row(record *r, const row *o, const frame_list *frames, const csv *c, size_t *at,
                   fault *f) {
    arris_pose pose;
    bool begun = r->n_frames > 0 && r->frame[r->n_frames - 1].index == o->frame;
    if (!begun) {
        const frame_entry *e = entry_of(frames, o->frame, at);
        if (!e)
            return fault_set(f, ARRIS_E_INPUT, "give it the frames.csv of the same scan",
                             "%s:%d: there is no frame %lld in the list of frames", c->path,
                             c->line, (long long)o->frame);
        frames_pose(e, &pose);
        if (!e->posed)
            return 0;
        if (!record_frame(r, e->index, e->utime, &pose))
            return fault_set(f, ARRIS_E_INPUT, "its rows must be in the order of the frames",
                             "%s:%d: the frames come more than once", c->path, c->line);
    }
    if (o->track >= 0)
        record_add(r, (int32_t)o->track, &o->s, &r->camera);
    return 0;
}

static size_t count_lines(const char *text) {
    size_t n = 1;
    while (n < MAX_SEGMENTS && (text = strchr(text, '\n')))
        text++, n++;
    return n;
}

int input_segments(char *text, size_t n, const char *path, const frame_list *frames,
                   const arris_camera *camera, record *r, fault *f) {
    int column[COLUMNS];
    size_t at = 0;
    row o = {0};
    csv c;
    if (record_init(r, camera, (uint32_t)frames->n, (uint32_t)count_lines(text)))
        return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for the segments of %s", path);
    int rc = csv_open(&c, path, text, n, f);
    if (rc == 0)
        rc = csv_columns(&c, names, COLUMNS, column, f);
    while (rc == 0 && (rc = csv_next(&c, f)) > 0) {
        rc = read_row(&c, column, &o, f);
        rc = rc ? rc : add_row(r, &o, frames, &c, &at, f);
    }
    if (rc == 0 && r->n == 0)
        rc = fault_set(f, ARRIS_E_INPUT, segments_hint, "%s: no segment has a track and a pose",
                       path);
    if (rc < 0 && !f->hint)
        f->hint = segments_hint;
    return rc;
}
