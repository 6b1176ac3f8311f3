/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * camera.c: camera.json through jansson, which itself refuses what is no finite number in JSON
 * (NaN, Infinity, 1e999).
 */
#include "camera.h"

#include <jansson.h>
#include <math.h>
#include <stdlib.h>

#include "arris_geometry.h"
#include "bytes.h"

enum { MAX_CAMERA_FILE = 1 << 20 };

static const char hint[] =
    "a camera.json is {\"width\": 320, \"height\": 240, \"fx\": ..., \"fy\": "
    "..., and skew, cx, cy, k1, k2, p1, p2, k3}, all numbers";

static const struct {
    const char *name;
    size_t offset;
} keys[] = {
    {"fx", offsetof(arris_camera, fx)},     {"fy", offsetof(arris_camera, fy)},
    {"skew", offsetof(arris_camera, skew)}, {"cx", offsetof(arris_camera, cx)},
    {"cy", offsetof(arris_camera, cy)},     {"k1", offsetof(arris_camera, k1)},
    {"k2", offsetof(arris_camera, k2)},     {"p1", offsetof(arris_camera, p1)},
    {"p2", offsetof(arris_camera, p2)},     {"k3", offsetof(arris_camera, k3)},
};

static int number(const json_t *o, const char *path, const char *key, double *v, fault *f) {
    const json_t *j = json_object_get(o, key);
    if (!j)
        return fault_set(f, ARRIS_E_INPUT, hint, "%s: \"%s\" is missing", path, key);
    if (!json_is_number(j))
        return fault_set(f, ARRIS_E_INPUT, hint, "%s: \"%s\" is no number", path, key);
    *v = json_number_value(j);
    return 0;
}

static int pixels(const json_t *o, const char *path, const char *key, int32_t *v, fault *f) {
    double d;
    int r = number(o, path, key, &d, f);
    if (r < 0)
        return r;
    if (!(d >= 1 && d <= INT32_MAX && d == floor(d)))
        return fault_set(f, ARRIS_E_INPUT, hint, "%s: \"%s\" is %g, which is no count of pixels",
                         path, key, d);
    *v = (int32_t)d;
    return 0;
}

static int read_keys(const json_t *o, const char *path, arris_camera *c, fault *f) {
    int r = pixels(o, path, "width", &c->width, f);
    if (r == 0)
        r = pixels(o, path, "height", &c->height, f);
    for (size_t i = 0; r == 0 && i < sizeof keys / sizeof *keys; i++)
        r = number(o, path, keys[i].name, (double *)(void *)((char *)c + keys[i].offset), f);
    if (r < 0)
        return r;
    const char *wrong = arris_camera_check(c);
    return wrong ? fault_set(f, ARRIS_E_INPUT, hint, "%s: %s", path, wrong) : 0;
}

/* The last c before `end`; the beginning of the text when there is none. */
static const char *back_to(const char *text, const char *end, char c) {
    while (end > text && *--end != c)
        ;
    return end;
}

/* What jansson says is wrong, with the key before it. */
static int bad_json(const char *text, const json_error_t *e, const char *path, fault *f) {
    const char *colon = back_to(text, text + e->position, ':');
    const char *end = back_to(text, colon, '"'), *key = back_to(text, end, '"');
    bool found = key < end;
    return fault_set(f, ARRIS_E_INPUT, hint, "%s:%d:%d: %s%.*s%s%s", path, e->line, e->column,
                     found ? "after " : "", found ? (int)(end - key) + 1 : 0, key,
                     found ? ": " : "", e->text);
}

int camera_parse(const char *text, size_t n, const char *path, arris_camera *c, fault *f) {
    json_error_t e;
    json_t *o = json_loadb(text, n, JSON_REJECT_DUPLICATES, &e);
    if (!o)
        return bad_json(text, &e, path, f);
    int r = json_is_object(o)
                ? read_keys(o, path, c, f)
                : fault_set(f, ARRIS_E_INPUT, hint, "%s: this is no JSON object", path);
    json_decref(o);
    return r;
}

int camera_load(const char *path, arris_camera *c, fault *f) {
    bytes b = {0};
    int r = bytes_read(&b, path, MAX_CAMERA_FILE, f);
    if (r == 0)
        r = camera_parse((const char *)b.data, b.n, path, c, f);
    else
        f->hint = hint;
    free(b.data);
    return r;
}
