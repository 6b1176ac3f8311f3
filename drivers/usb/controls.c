/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * controls.c: the controls of a USB camera.
 */
#include <linux/usb/video.h>
#include <linux/videodev2.h>

#include "camera.h"

typedef struct row {
    const char *name;
    uint32_t id;
    bool unit; /* of the processing unit; else of the camera terminal */
    uint8_t selector, size, bit;
    bool is_signed;
} row;

#define TERMINAL(name, id, selector, size, bit)                                                    \
    { name, V4L2_CID_##id, false, UVC_CT_##selector##_CONTROL, size, bit, false }
#define UNIT(name, id, selector, size, bit, is_signed)                                             \
    { name, V4L2_CID_##id, true, UVC_PU_##selector##_CONTROL, size, bit, is_signed }
static const row table[] = {
    TERMINAL("auto_exposure", EXPOSURE_AUTO, AE_MODE, 1, 1),
    TERMINAL("exposure_dynamic_framerate", EXPOSURE_AUTO_PRIORITY, AE_PRIORITY, 1, 2),
    TERMINAL("exposure_time_absolute", EXPOSURE_ABSOLUTE, EXPOSURE_TIME_ABSOLUTE, 4, 3),
    TERMINAL("focus_absolute", FOCUS_ABSOLUTE, FOCUS_ABSOLUTE, 2, 5),
    TERMINAL("focus_automatic_continuous", FOCUS_AUTO, FOCUS_AUTO, 1, 17),
    TERMINAL("iris_absolute", IRIS_ABSOLUTE, IRIS_ABSOLUTE, 2, 7),
    TERMINAL("zoom_absolute", ZOOM_ABSOLUTE, ZOOM_ABSOLUTE, 2, 9),
    UNIT("brightness", BRIGHTNESS, BRIGHTNESS, 2, 0, true),
    UNIT("contrast", CONTRAST, CONTRAST, 2, 1, false),
    UNIT("hue", HUE, HUE, 2, 2, true),
    UNIT("saturation", SATURATION, SATURATION, 2, 3, false),
    UNIT("sharpness", SHARPNESS, SHARPNESS, 2, 4, false),
    UNIT("gamma", GAMMA, GAMMA, 2, 5, false),
    UNIT("white_balance_temperature", WHITE_BALANCE_TEMPERATURE, WHITE_BALANCE_TEMPERATURE, 2, 6,
         false),
    UNIT("white_balance_automatic", AUTO_WHITE_BALANCE, WHITE_BALANCE_TEMPERATURE_AUTO, 1, 12,
         false),
    UNIT("backlight_compensation", BACKLIGHT_COMPENSATION, BACKLIGHT_COMPENSATION, 2, 8, false),
    UNIT("gain", GAIN, GAIN, 2, 9, false),
    UNIT("power_line_frequency", POWER_LINE_FREQUENCY, POWER_LINE_FREQUENCY, 1, 10, false),
};
enum { ROWS = sizeof table / sizeof *table };

/* V4L2 counts the modes of exposure, the camera has a bit for each. */
static const struct {
    uint8_t bit;
    const char *text;
} modes[] = {{2, "Auto Mode"},
             {1, "Manual Mode"},
             {4, "Shutter Priority Mode"},
             {8, "Aperture Priority Mode"}};
enum { MODES = sizeof modes / sizeof *modes };

static bool read_value(const camera *c, const row *k, uint8_t request, int64_t *value) {
    uint8_t p[4] = {0};
    if (!camera_control(c, request, k->selector, k->unit ? c->uvc.unit : c->uvc.terminal,
                        c->uvc.control, p, k->size))
        return false;
    uint32_t v = (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
    *value = k->is_signed ? (int64_t)(int16_t)v : (int64_t)v;
    return true;
}

static int64_t mode_of(int64_t bit) {
    int64_t i = 0;
    while (i < MODES && modes[i].bit != bit)
        i++;
    return i;
}

static bool next(const void *self, control *c) {
    const camera *cam = self;
    for (uint32_t i = c->kind; i < ROWS; i++) {
        const row *k = &table[i];
        uint32_t bits = k->unit ? cam->uvc.unit_controls : cam->uvc.terminal_controls;
        if (!(k->unit ? cam->uvc.unit : cam->uvc.terminal) || !(bits >> k->bit & 1))
            continue;
        *c = (control){.id = k->id, .kind = i + 1, .menu = k->id == V4L2_CID_EXPOSURE_AUTO};
        snprintf(c->name, sizeof c->name, "%s", k->name);
        return true;
    }
    return false;
}

/* What the camera does not tell is as wide as the control is. */
static bool range(const void *self, control *c) {
    const row *k = &table[c->kind - 1];
    int64_t now;
    if (!read_value(self, k, UVC_GET_CUR, &now))
        return false;
    c->max = k->size == 1 ? 255 : k->size == 2 ? 65535 : UINT32_MAX;
    c->step = 1;
    read_value(self, k, UVC_GET_DEF, &c->usual);
    read_value(self, k, UVC_GET_RES, &c->step); /* of a menu: the bits that there are */
    if (!c->menu) {
        read_value(self, k, UVC_GET_MIN, &c->min);
        read_value(self, k, UVC_GET_MAX, &c->max);
    } else {
        c->max = MODES - 1;
        c->usual = mode_of(c->usual);
    }
    return true;
}

static bool item(const void *self, const control *c, int64_t value, char text[CONTROL_ITEM]) {
    (void)self;
    if (!(c->step & modes[value].bit))
        return false;
    snprintf(text, CONTROL_ITEM, "%s", modes[value].text);
    return true;
}

static bool get(const void *self, const control *c, int64_t *value) {
    if (!read_value(self, &table[c->kind - 1], UVC_GET_CUR, value))
        return false;
    *value = c->menu ? mode_of(*value) : *value;
    return true;
}

static bool set(const void *self, const control *c, int64_t value) {
    const camera *cam = self;
    const row *k = &table[c->kind - 1];
    uint8_t p[4];
    uint64_t v = c->menu ? modes[value].bit : (uint64_t)value;
    for (int i = 0; i < 4; i++)
        p[i] = (uint8_t)(v >> 8 * i);
    return camera_control(cam, UVC_SET_CUR, k->selector,
                          k->unit ? cam->uvc.unit : cam->uvc.terminal, cam->uvc.control, p,
                          k->size);
}

controls camera_controls(const camera *c) {
    return (controls){c, c->name, "usbsrc", next, range, item, get, set};
}
