/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * controls.c: a camera's controls by their names.
 */
#include "controls.h"

#include <errno.h>
#include <linux/videodev2.h>
#include <stdlib.h>
#include <string.h>

enum { RANGE_TEXT = 200 };
static const char *const forbidden = "another control may forbid it: an automatic one, mostly";

/* ---- finding --------------------------------------------------------------------------------- */

static bool find_id(const controls *l, uint32_t id, control *c) {
    for (*c = (control){.id = 0}; l->next(l->self, c);)
        if (c->id == id)
            return true;
    return false;
}

static bool find(const controls *l, const char *name, control *c) {
    static const struct {
        const char *name;
        uint32_t id;
    } shorter[] = {{"exposure", V4L2_CID_EXPOSURE_ABSOLUTE},
                   {"focus", V4L2_CID_FOCUS_ABSOLUTE},
                   {"iris", V4L2_CID_IRIS_ABSOLUTE},
                   {"zoom", V4L2_CID_ZOOM_ABSOLUTE}};
    for (*c = (control){.id = 0}; l->next(l->self, c);)
        if (strcmp(c->name, name) == 0)
            return true;
    for (size_t i = 0; i < sizeof shorter / sizeof *shorter; i++)
        if (strcmp(shorter[i].name, name) == 0)
            return find_id(l, shorter[i].id, c);
    return false;
}

/* A hint stands until the next one of the thread. */
static const char *names_hint(const controls *l) {
    static _Thread_local char text[400];
    size_t at = (size_t)snprintf(text, sizeof text, "it has");
    for (control c = {.id = 0}; l->next(l->self, &c) && at < sizeof text - 90;)
        at += (size_t)snprintf(text + at, sizeof text - at, " %s", c.name);
    snprintf(text + at, sizeof text - at, "\n  `arris stages %s --devices` has their ranges",
             l->stage);
    return text;
}

/* ---- values ---------------------------------------------------------------------------------- */

/* "1 to 5000", "0 to 10 by 2", "1 Manual Mode, 3 Aperture Priority Mode". */
static void range_text(const controls *l, const control *c, char text[RANGE_TEXT]) {
    char item[CONTROL_ITEM];
    size_t at = 0;
    *text = '\0';
    for (int64_t i = c->min; c->menu && i <= c->max && at < RANGE_TEXT; i++)
        if (l->item(l->self, c, i, item))
            at += (size_t)snprintf(text + at, RANGE_TEXT - at, "%s%lld %s", at ? ", " : "",
                                   (long long)i, item);
    if (at >= RANGE_TEXT)
        strcpy(text + RANGE_TEXT - 4, "...");
    if (c->menu)
        return;
    int n = snprintf(text, RANGE_TEXT, "%lld to %lld", (long long)c->min, (long long)c->max);
    if (c->step > 1)
        snprintf(text + n, RANGE_TEXT - (size_t)n, " by %lld", (long long)c->step);
}

static bool allows(const controls *l, const control *c, int64_t value) {
    char item[CONTROL_ITEM];
    if (value < c->min || value > c->max)
        return false;
    return c->menu ? l->item(l->self, c, value, item)
                   : c->step < 2 || ((uint64_t)value - (uint64_t)c->min) % (uint64_t)c->step == 0;
}

static bool parse(const controls *l, const control *c, const char *text, int64_t *value) {
    char *end, item[CONTROL_ITEM];
    errno = 0;
    *value = strtoll(text, &end, 0);
    if (end != text && !*end && !errno)
        return allows(l, c, *value);
    for (*value = c->min; c->menu && *value <= c->max; ++*value)
        if (l->item(l->self, c, *value, item) && strcmp(item, text) == 0)
            return true;
    return false;
}

static int set_one(const controls *l, const char *name, const char *text, fault *f) {
    control c;
    char range[RANGE_TEXT];
    int64_t value, got;
    if (!find(l, name, &c))
        return fault_set(f, ARRIS_E_USAGE, names_hint(l),
                         "there is no property '%s', and %s has no control of that name", name,
                         l->name);
    if (!l->range(l->self, &c))
        return fault_set(f, ARRIS_E_IO, NULL, "%s does not tell what %s may be", l->name, name);
    range_text(l, &c, range);
    if (!parse(l, &c, text, &value))
        return fault_set(f, ARRIS_E_USAGE, NULL, "%s cannot be '%s': it is %s, default %lld", name,
                         text, range, (long long)c.usual);
    if (c.read_only)
        return fault_set(f, ARRIS_E_USAGE, NULL, "%s can only be read", name);
    if (!l->set(l->self, &c, value))
        return fault_set(f, ARRIS_E_IO, forbidden, "%s does not let %s be set to %s", l->name, name,
                         text);
    if (!l->get(l->self, &c, &got) || got == value)
        return 0;
    return fault_set(f, ARRIS_E_IO, forbidden, "%s was set to %s, and is %lld", name, text,
                     (long long)got);
}

/* ---- the public functions -------------------------------------------------------------------- */

int controls_set(const controls *l, const char *lines, fault *f) {
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
        r = set_one(l, name, text, f);
    }
    return r;
}

int controls_calm(const controls *l, fault *f) {
    static const struct {
        uint32_t id;
        int64_t off;
    } automatic[] = {{V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL},
                     {V4L2_CID_EXPOSURE_AUTO_PRIORITY, 0},
                     {V4L2_CID_AUTOGAIN, 0},
                     {V4L2_CID_FOCUS_AUTO, 0},
                     {V4L2_CID_ZOOM_CONTINUOUS, 0}};
    control c;
    for (size_t i = 0; i < sizeof automatic / sizeof *automatic; i++)
        if (find_id(l, automatic[i].id, &c) && !c.read_only &&
            !l->set(l->self, &c, automatic[i].off))
            return fault_set(f, ARRIS_E_IO, NULL, "cannot switch %s off", c.name);
    return 0;
}

double controls_exposure(const controls *l) {
    control c;
    int64_t value; /* 100 us */
    return find_id(l, V4L2_CID_EXPOSURE_ABSOLUTE, &c) && l->get(l->self, &c, &value)
               ? (double)value * 0.1
               : 0;
}

void controls_list(const controls *l, FILE *out) {
    char range[RANGE_TEXT];
    for (control c = {.id = 0}; l->next(l->self, &c);) {
        int64_t now;
        if (!l->range(l->self, &c)) {
            fprintf(out, "  %s: the kernel's driver has it\n", c.name);
            continue;
        }
        range_text(l, &c, range);
        fprintf(out, "  %s: %s, default %lld", c.name, range, (long long)c.usual);
        if (l->get(l->self, &c, &now) && now != c.usual)
            fprintf(out, ", now %lld", (long long)now);
        fputc('\n', out);
    }
}
