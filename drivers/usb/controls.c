/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * controls.c: the controls of a USB camera.
 */
#include "controls.h"

#include <errno.h>
#include <linux/usb/video.h>
#include <stdlib.h>
#include <string.h>

typedef struct control {
    const char *name, *other; /* other: a shorter name, or NULL */
    bool unit;                /* of the processing unit; else of the camera terminal */
    uint8_t selector, size, bit;
    bool is_signed;
    bool bits; /* its values are bits of which one is set: they have no range, GET_RES says which */
} control;

static const control table[] = {
    {"auto_exposure", NULL, false, UVC_CT_AE_MODE_CONTROL, 1, 1, false, true},
    {"exposure_dynamic_framerate", NULL, false, UVC_CT_AE_PRIORITY_CONTROL, 1, 2, false, false},
    {"exposure_time_absolute", "exposure", false, UVC_CT_EXPOSURE_TIME_ABSOLUTE_CONTROL, 4, 3,
     false, false},
    {"focus_absolute", "focus", false, UVC_CT_FOCUS_ABSOLUTE_CONTROL, 2, 5, false, false},
    {"focus_automatic_continuous", NULL, false, UVC_CT_FOCUS_AUTO_CONTROL, 1, 17, false, false},
    {"iris_absolute", "iris", false, UVC_CT_IRIS_ABSOLUTE_CONTROL, 2, 7, false, false},
    {"zoom_absolute", "zoom", false, UVC_CT_ZOOM_ABSOLUTE_CONTROL, 2, 9, false, false},
    {"brightness", NULL, true, UVC_PU_BRIGHTNESS_CONTROL, 2, 0, true, false},
    {"contrast", NULL, true, UVC_PU_CONTRAST_CONTROL, 2, 1, false, false},
    {"hue", NULL, true, UVC_PU_HUE_CONTROL, 2, 2, true, false},
    {"saturation", NULL, true, UVC_PU_SATURATION_CONTROL, 2, 3, false, false},
    {"sharpness", NULL, true, UVC_PU_SHARPNESS_CONTROL, 2, 4, false, false},
    {"gamma", NULL, true, UVC_PU_GAMMA_CONTROL, 2, 5, false, false},
    {"white_balance_temperature", NULL, true, UVC_PU_WHITE_BALANCE_TEMPERATURE_CONTROL, 2, 6, false,
     false},
    {"white_balance_automatic", NULL, true, UVC_PU_WHITE_BALANCE_TEMPERATURE_AUTO_CONTROL, 1, 12,
     false, false},
    {"backlight_compensation", NULL, true, UVC_PU_BACKLIGHT_COMPENSATION_CONTROL, 2, 8, false,
     false},
    {"gain", NULL, true, UVC_PU_GAIN_CONTROL, 2, 9, false, false},
    {"power_line_frequency", NULL, true, UVC_PU_POWER_LINE_FREQUENCY_CONTROL, 1, 10, false, false},
};
enum { CONTROLS = sizeof table / sizeof *table };

/* ---- one control ----------------------------------------------------------------------------- */

static bool has(const camera *c, const control *k) {
    uint32_t bits = k->unit ? c->uvc.unit_controls : c->uvc.terminal_controls;
    return (k->unit ? c->uvc.unit : c->uvc.terminal) && bits >> k->bit & 1;
}

static bool get(const camera *c, const control *k, uint8_t request, int64_t *value) {
    uint8_t p[4] = {0};
    if (!camera_control(c, request, k->selector, k->unit ? c->uvc.unit : c->uvc.terminal,
                        c->uvc.control, p, k->size))
        return false;
    uint32_t v = (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
    *value = k->is_signed && k->size == 2 ? (int64_t)(int16_t)v : (int64_t)v;
    return true;
}

static bool set(const camera *c, const control *k, int64_t value) {
    uint8_t p[4];
    for (int i = 0; i < 4; i++)
        p[i] = (uint8_t)((uint64_t)value >> 8 * i);
    return camera_control(c, UVC_SET_CUR, k->selector, k->unit ? c->uvc.unit : c->uvc.terminal,
                          c->uvc.control, p, k->size);
}

typedef struct range {
    int64_t min, max, step, usual;
} range;

/* What the camera does not tell is as wide as the control is. */
static range range_of(const camera *c, const control *k) {
    range r = {.max = k->size == 1 ? 255 : k->size == 2 ? 65535 : UINT32_MAX, .step = 1};
    get(c, k, UVC_GET_DEF, &r.usual);
    if (k->bits)
        return get(c, k, UVC_GET_RES, &r.max), r;
    get(c, k, UVC_GET_MIN, &r.min);
    get(c, k, UVC_GET_MAX, &r.max);
    get(c, k, UVC_GET_RES, &r.step);
    r.step = r.step > 1 ? r.step : 1;
    return r;
}

static bool allows(const control *k, const range *r, int64_t v) {
    if (k->bits)
        return v > 0 && !(v & (v - 1)) && (v & r->max);
    return v >= r->min && v <= r->max && (v - r->min) % r->step == 0;
}

static void range_text(const control *k, const range *r, char *text, size_t size) {
    if (!k->bits) {
        int n = snprintf(text, size, "%lld to %lld", (long long)r->min, (long long)r->max);
        if (r->step > 1)
            snprintf(text + n, size - (size_t)n, " by %lld", (long long)r->step);
        return;
    }
    size_t at = 0;
    *text = '\0';
    for (int i = 0; i < 8 && at < size; i++)
        if (r->max >> i & 1)
            at += (size_t)snprintf(text + at, size - at, "%s%d", at ? " or " : "", 1 << i);
}

/* ---- the public functions -------------------------------------------------------------------- */

static const control *find(const camera *c, const char *name) {
    for (const control *k = table; k < table + CONTROLS; k++)
        if (has(c, k) && (strcmp(k->name, name) == 0 || (k->other && strcmp(k->other, name) == 0)))
            return k;
    return NULL;
}

/* A hint stands until the next one of the thread. */
static const char *names_hint(const camera *c) {
    static _Thread_local char text[400];
    size_t at = (size_t)snprintf(text, sizeof text, "it has");
    for (const control *k = table; k < table + CONTROLS && at < sizeof text - 70; k++)
        if (has(c, k))
            at += (size_t)snprintf(text + at, sizeof text - at, " %s", k->name);
    snprintf(text + at, sizeof text - at, "\n  `arris stages usbsrc --devices` has their ranges");
    return text;
}

static int set_one(const camera *c, const char *name, const char *text, fault *f) {
    char limits[80], *end;
    const control *k = find(c, name);
    if (!k)
        return fault_set(f, ARRIS_E_USAGE, names_hint(c),
                         "there is no property '%s', and %s has no control of that name", name,
                         c->name);
    range r = range_of(c, k);
    errno = 0;
    int64_t value = strtoll(text, &end, 0), got;
    if (end == text || *end || errno || !allows(k, &r, value)) {
        range_text(k, &r, limits, sizeof limits);
        return fault_set(f, ARRIS_E_USAGE, NULL, "%s cannot be '%s': it is %s, default %lld", name,
                         text, limits, (long long)r.usual);
    }
    if (!set(c, k, value))
        return fault_set(f, ARRIS_E_IO, "another control may forbid it: an automatic one, mostly",
                         "the camera does not let %s be set to %s", name, text);
    if (!get(c, k, UVC_GET_CUR, &got) || got == value)
        return 0;
    return fault_set(f, ARRIS_E_IO, "another control may forbid it: an automatic one, mostly",
                     "%s was set to %s, and is %lld", name, text, (long long)got);
}

int controls_set(const camera *c, const char *lines, fault *f) {
    char name[64], text[64];
    int r = 0;
    for (const char *p = lines; p && *p && r == 0; p = strchr(p, '\n') + 1) {
        size_t n = strcspn(p, "="), m = strcspn(p + n + 1, "\n");
        if (n >= sizeof name || m >= sizeof text)
            return fault_set(f, ARRIS_E_USAGE, NULL, "a control's name or value is too long");
        snprintf(name, sizeof name, "%.*s", (int)n, p);
        snprintf(text, sizeof text, "%.*s", (int)m, p + n + 1);
        for (char *dash = name; (dash = strchr(dash, '-'));)
            *dash = '_';
        r = set_one(c, name, text, f);
    }
    return r;
}

int controls_calm(const camera *c, fault *f) {
    static const struct {
        const char *name;
        int64_t off;
    } automatic[] = {{"auto_exposure", 1 /* manual */},
                     {"exposure_dynamic_framerate", 0},
                     {"focus_automatic_continuous", 0}};
    for (size_t i = 0; i < sizeof automatic / sizeof *automatic; i++) {
        const control *k = find(c, automatic[i].name);
        if (k && !set(c, k, automatic[i].off))
            return fault_set(f, ARRIS_E_IO, NULL, "cannot switch %s off", k->name);
    }
    return 0;
}

double controls_exposure(const camera *c) {
    const control *k = find(c, "exposure_time_absolute");
    int64_t value = 0;
    return k && get(c, k, UVC_GET_CUR, &value) ? (double)value * 0.1 : 0;
}

void controls_list(const camera *c, FILE *out) {
    char limits[80];
    for (const control *k = table; k < table + CONTROLS; k++) {
        int64_t now;
        if (!has(c, k))
            continue;
        if (!get(c, k, UVC_GET_CUR, &now)) {
            fprintf(out, "  %s: the kernel's driver has it\n", k->name);
            continue;
        }
        range r = range_of(c, k);
        range_text(k, &r, limits, sizeof limits);
        fprintf(out, "  %s: %s, default %lld", k->name, limits, (long long)r.usual);
        fprintf(out, now == r.usual ? "\n" : ", now %lld\n", (long long)now);
    }
}
