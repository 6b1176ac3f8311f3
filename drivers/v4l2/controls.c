/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * controls.c: the controls of a V4L2 device.
 */
#include <ctype.h>
#include <stdio.h>

#include "device.h"

typedef struct v4l2_query_ext_ctrl query;

static bool ask(const void *self, query *q) {
    return device_ioctl(((const device *)self)->fd, VIDIOC_QUERY_EXT_CTRL, q) == 0;
}

static void name_of(const query *q, char name[CONTROL_NAME]) {
    size_t n = 0;
    for (const char *p = q->name; *p && n < CONTROL_NAME - 1; p++)
        if (isalnum((unsigned char)*p))
            name[n++] = (char)tolower((unsigned char)*p);
        else if (n && name[n - 1] != '_')
            name[n++] = '_';
    while (n && name[n - 1] == '_')
        n--;
    name[n] = '\0';
}

/* Only those that have a single number as their value. */
static bool next(const void *self, control *c) {
    query q = {.id = c->id};
    do {
        q = (query){.id = q.id | V4L2_CTRL_FLAG_NEXT_CTRL};
        if (!ask(self, &q))
            return false;
    } while (q.flags & (V4L2_CTRL_FLAG_DISABLED | V4L2_CTRL_FLAG_HAS_PAYLOAD) ||
             q.type == V4L2_CTRL_TYPE_CTRL_CLASS || q.type == V4L2_CTRL_TYPE_BUTTON);
    *c = (control){.id = q.id,
                   .kind = q.type,
                   .menu = q.type == V4L2_CTRL_TYPE_MENU || q.type == V4L2_CTRL_TYPE_INTEGER_MENU,
                   .read_only = q.flags & V4L2_CTRL_FLAG_READ_ONLY};
    name_of(&q, c->name);
    return true;
}

static bool range(const void *self, control *c) {
    query q = {.id = c->id};
    if (!ask(self, &q))
        return false;
    c->min = q.minimum;
    c->max = q.maximum;
    c->step = (int64_t)q.step;
    c->usual = q.default_value;
    return true;
}

static bool item(const void *self, const control *c, int64_t value, char text[CONTROL_ITEM]) {
    struct v4l2_querymenu m = {.id = c->id, .index = (uint32_t)value};
    if (device_ioctl(((const device *)self)->fd, VIDIOC_QUERYMENU, &m))
        return false;
    if (c->kind == V4L2_CTRL_TYPE_MENU)
        snprintf(text, CONTROL_ITEM, "%s", (const char *)m.name);
    else
        snprintf(text, CONTROL_ITEM, "%lld", (long long)m.value);
    return true;
}

static bool exchange(const void *self, unsigned long request, const control *c, int64_t *value) {
    struct v4l2_ext_control v = {.id = c->id};
    struct v4l2_ext_controls list = {.which = V4L2_CTRL_WHICH_CUR_VAL, .count = 1, .controls = &v};
    if (c->kind == V4L2_CTRL_TYPE_INTEGER64)
        v.value64 = *value;
    else
        v.value = (int32_t)*value;
    if (device_ioctl(((const device *)self)->fd, request, &list))
        return false;
    *value = c->kind == V4L2_CTRL_TYPE_INTEGER64 ? v.value64 : v.value;
    if (c->kind == V4L2_CTRL_TYPE_BITMASK)
        *value &= UINT32_MAX;
    return true;
}

static bool get(const void *self, const control *c, int64_t *value) {
    *value = 0;
    return exchange(self, VIDIOC_G_EXT_CTRLS, c, value);
}

static bool set(const void *self, const control *c, int64_t value) {
    return exchange(self, VIDIOC_S_EXT_CTRLS, c, &value);
}

controls device_controls(const device *d) {
    return (controls){d, d->card, "v4l2src", next, range, item, get, set};
}
