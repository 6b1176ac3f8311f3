/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * handeye.c: handeye.json through jansson.
 */
#include "handeye.h"

#include <jansson.h>
#include <stdlib.h>

#include "bytes.h"
#include "rigid.h"

enum { MAX_HANDEYE_FILE = 1 << 20 };

static const char hint[] =
    "a handeye.json is {\"camera_to_flange\": {\"x\": 0, \"y\": 0, \"z\": 0, \"qw\": 1, \"qx\": 0, "
    "\"qy\": 0, \"qz\": 0}}, in mm and as a unit quaternion";

int handeye_parse(const char *text, size_t n, const char *path, handeye *h, fault *f) {
    json_error_t e;
    json_t *o = json_loadb(text, n, JSON_REJECT_DUPLICATES, &e);
    int r = o ? json_unpack_ex(o, &e, 0, "{s:{s:F, s:F, s:F, s:F, s:F, s:F, s:F}}",
                               "camera_to_flange", "x", &h->t[0], "y", &h->t[1], "z", &h->t[2],
                               "qw", &h->q[0], "qx", &h->q[1], "qy", &h->q[2], "qz", &h->q[3])
              : -1;
    json_decref(o);
    if (r < 0)
        return fault_set(f, ARRIS_E_INPUT, hint, "%s:%d:%d: %s", path, e.line, e.column, e.text);
    if (!rigid_normalise(h->q))
        return fault_set(f, ARRIS_E_INPUT, hint, "%s: the quaternion is not of unit length", path);
    return 0;
}

int handeye_load(const char *path, handeye *h, fault *f) {
    bytes b = {0};
    int r = bytes_read(&b, path, MAX_HANDEYE_FILE, f);
    if (r == 0)
        r = handeye_parse((const char *)b.data, b.n, path, h, f);
    else
        f->hint = hint;
    free(b.data);
    return r;
}
