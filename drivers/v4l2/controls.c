/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * controls.c: a device's controls by their names.
 */
#include "controls.h"

#include <ctype.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct v4l2_query_ext_ctrl control;

static void name_of(const control *c, char name[33]) {
    size_t n = 0;
    for (const char *p = c->name; *p && n < 32; p++)
        if (isalnum((unsigned char)*p))
            name[n++] = (char)tolower((unsigned char)*p);
        else if (n && name[n - 1] != '_')
            name[n++] = '_';
    while (n && name[n - 1] == '_')
        n--;
    name[n] = '\0';
}

/* Steps to the next control that has a single number as its value; begin with a zeroed one. */
static bool next(const device *d, control *c) {
    do {
        uint32_t id = c->id;
        memset(c, 0, sizeof *c);
        c->id = id | V4L2_CTRL_FLAG_NEXT_CTRL;
        if (device_ioctl(d->fd, VIDIOC_QUERY_EXT_CTRL, c))
            return false;
    } while (c->flags & (V4L2_CTRL_FLAG_DISABLED | V4L2_CTRL_FLAG_HAS_PAYLOAD) ||
             c->type == V4L2_CTRL_TYPE_CTRL_CLASS || c->type == V4L2_CTRL_TYPE_BUTTON);
    return true;
}

static bool query(const device *d, uint32_t id, control *c) {
    *c = (control){.id = id};
    return device_ioctl(d->fd, VIDIOC_QUERY_EXT_CTRL, c) == 0 &&
           !(c->flags & V4L2_CTRL_FLAG_DISABLED);
}

static bool find(const device *d, const char *wanted, control *c) {
    static const struct {
        const char *name;
        uint32_t id;
    } other[] = {{"exposure", V4L2_CID_EXPOSURE_ABSOLUTE},
                 {"focus", V4L2_CID_FOCUS_ABSOLUTE},
                 {"zoom", V4L2_CID_ZOOM_ABSOLUTE}};
    char name[33];
    for (*c = (control){.id = 0}; next(d, c);) {
        name_of(c, name);
        if (strcmp(name, wanted) == 0)
            return true;
    }
    for (size_t i = 0; i < sizeof other / sizeof *other; i++)
        if (strcmp(other[i].name, wanted) == 0)
            return query(d, other[i].id, c);
    return false;
}

/* ---- values ---------------------------------------------------------------------------------- */

static bool is_menu(const control *c) {
    return c->type == V4L2_CTRL_TYPE_MENU || c->type == V4L2_CTRL_TYPE_INTEGER_MENU;
}

/* False when the menu has no such item. */
static bool item_text(const device *d, const control *c, int64_t index, char text[32]) {
    struct v4l2_querymenu m = {.id = c->id, .index = (uint32_t)index};
    if (device_ioctl(d->fd, VIDIOC_QUERYMENU, &m))
        return false;
    if (c->type == V4L2_CTRL_TYPE_MENU)
        snprintf(text, 32, "%s", (const char *)m.name);
    else
        snprintf(text, 32, "%lld", (long long)m.value);
    return true;
}

/* "1 to 5000", "0 to 10 by 2", "1 Manual, 3 Aperture". */
static void range_text(const device *d, const control *c, char *text, size_t size) {
    char item[32];
    if (!is_menu(c)) {
        int n = snprintf(text, size, "%lld to %lld", (long long)c->minimum, (long long)c->maximum);
        if (c->step > 1)
            snprintf(text + n, size - (size_t)n, " by %llu", (unsigned long long)c->step);
        return;
    }
    size_t at = 0;
    *text = '\0';
    for (int64_t i = c->minimum; i <= c->maximum && at < size; i++)
        if (item_text(d, c, i, item))
            at += (size_t)snprintf(text + at, size - at, "%s%lld %s", at ? ", " : "", (long long)i,
                                   item);
}

static bool exchange(const device *d, unsigned long request, const control *c, int64_t *value) {
    struct v4l2_ext_control v = {.id = c->id};
    struct v4l2_ext_controls list = {.which = V4L2_CTRL_WHICH_CUR_VAL, .count = 1, .controls = &v};
    if (c->type == V4L2_CTRL_TYPE_INTEGER64)
        v.value64 = *value;
    else
        v.value = (int32_t)*value;
    if (device_ioctl(d->fd, request, &list))
        return false;
    *value = c->type == V4L2_CTRL_TYPE_INTEGER64 ? v.value64 : v.value;
    return true;
}

static bool parse(const device *d, const control *c, const char *text, int64_t *value) {
    char *end, item[32];
    errno = 0;
    *value = strtoll(text, &end, 0);
    bool number = end != text && !*end && !errno;
    if (number)
        return *value >= c->minimum && *value <= c->maximum &&
               (!is_menu(c) || item_text(d, c, *value, item)) &&
               (c->step < 2 || (uint64_t)(*value - c->minimum) % c->step == 0);
    for (*value = c->minimum; is_menu(c) && *value <= c->maximum; ++*value)
        if (item_text(d, c, *value, item) && strcmp(item, text) == 0)
            return true;
    return false;
}

/* ---- the public functions -------------------------------------------------------------------- */

/* A hint stands until the next one of the thread. */
static const char *names_hint(const device *d) {
    static _Thread_local char text[400];
    char name[33];
    size_t at = (size_t)snprintf(text, sizeof text, "it has");
    for (control c = {.id = 0}; next(d, &c) && at < sizeof text - 70;) {
        name_of(&c, name);
        at += (size_t)snprintf(text + at, sizeof text - at, " %s", name);
    }
    snprintf(text + at, sizeof text - at, "\n  `arris stages v4l2src --devices` has their ranges");
    return text;
}

static int set_one(const device *d, const char *name, const char *text, fault *f) {
    control c;
    char range[CONTROL_TEXT];
    int64_t value, got;
    if (!find(d, name, &c))
        return fault_set(f, ARRIS_E_USAGE, names_hint(d),
                         "there is no property '%s', and %s has no control of that name", name,
                         d->card);
    range_text(d, &c, range, sizeof range);
    if (!parse(d, &c, text, &value))
        return fault_set(f, ARRIS_E_USAGE, NULL, "%s cannot be '%s': it is %s, default %lld", name,
                         text, range, (long long)c.default_value);
    if (c.flags & V4L2_CTRL_FLAG_READ_ONLY)
        return fault_set(f, ARRIS_E_USAGE, NULL, "%s can only be read", name);
    got = value;
    if (!exchange(d, VIDIOC_S_EXT_CTRLS, &c, &got))
        return fault_set(f, ARRIS_E_IO, NULL, "cannot set %s=%s: %s", name, text, strerror(errno));
    if (c.flags & V4L2_CTRL_FLAG_WRITE_ONLY || !exchange(d, VIDIOC_G_EXT_CTRLS, &c, &got) ||
        got == value)
        return 0;
    return fault_set(f, ARRIS_E_IO, "another control may forbid it: an automatic one, mostly",
                     "%s was set to %s, and is %lld", name, text, (long long)got);
}

int controls_set(const device *d, const char *lines, fault *f) {
    char name[64], text[128];
    int r = 0;
    for (const char *p = lines; p && *p && r == 0; p = strchr(p, '\n') + 1) {
        size_t n = strcspn(p, "="), m = strcspn(p + n + 1, "\n");
        if (n >= sizeof name || m >= sizeof text)
            return fault_set(f, ARRIS_E_USAGE, NULL, "a control's name or value is too long");
        snprintf(name, sizeof name, "%.*s", (int)n, p);
        snprintf(text, sizeof text, "%.*s", (int)m, p + n + 1);
        for (char *dash = name; (dash = strchr(dash, '-'));)
            *dash = '_';
        r = set_one(d, name, text, f);
    }
    return r;
}

int controls_calm(const device *d, fault *f) {
    static const struct {
        uint32_t id;
        int64_t off;
    } automatic[] = {{V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL},
                     {V4L2_CID_EXPOSURE_AUTO_PRIORITY, 0},
                     {V4L2_CID_AUTOGAIN, 0},
                     {V4L2_CID_FOCUS_AUTO, 0},
                     {V4L2_CID_ZOOM_CONTINUOUS, 0}};
    control c;
    char name[33];
    for (size_t i = 0; i < sizeof automatic / sizeof *automatic; i++) {
        int64_t value = automatic[i].off;
        if (!query(d, automatic[i].id, &c) || c.flags & V4L2_CTRL_FLAG_READ_ONLY)
            continue;
        name_of(&c, name);
        if (!exchange(d, VIDIOC_S_EXT_CTRLS, &c, &value))
            return fault_set(f, ARRIS_E_IO, NULL, "cannot switch %s off: %s", name,
                             strerror(errno));
    }
    return 0;
}

double controls_exposure(const device *d) {
    control c;
    int64_t value = 0;
    return query(d, V4L2_CID_EXPOSURE_ABSOLUTE, &c) && exchange(d, VIDIOC_G_EXT_CTRLS, &c, &value)
               ? (double)value * 0.1
               : 0;
}

void controls_each(const device *d, void (*use)(const char *text, void *user), void *user) {
    char name[33], range[CONTROL_TEXT], text[2 * CONTROL_TEXT];
    for (control c = {.id = 0}; next(d, &c);) {
        int64_t value = c.default_value;
        name_of(&c, name);
        range_text(d, &c, range, sizeof range);
        bool read = exchange(d, VIDIOC_G_EXT_CTRLS, &c, &value);
        int n = snprintf(text, sizeof text, "%s: %s, default %lld", name, range,
                         (long long)c.default_value);
        if (read && value != c.default_value)
            snprintf(text + n, sizeof text - (size_t)n, ", now %lld", (long long)value);
        use(text, user);
    }
}
