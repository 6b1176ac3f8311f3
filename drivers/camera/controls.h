/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * controls.h: a camera's controls by their names: how they are found, set and listed, for every
 * driver; the drivers say only how one is read and written.
 *
 * A name is that of the kernel's driver in small letters, with one _ for all that is neither letter
 * nor digit ("Exposure Time, Absolute": exposure_time_absolute), as v4l2-ctl has it. exposure,
 * focus, iris and zoom also mean the absolute ones where no control has just that name. All
 * functions are the stage's thread's.
 */
#ifndef CAMERA_CONTROLS_H
#define CAMERA_CONTROLS_H

#include <stdint.h>
#include <stdio.h>

#include "fault.h"

enum { CONTROL_NAME = 33, CONTROL_ITEM = 32 }; /* bytes, with the end */

typedef struct control {
    uint32_t id; /* V4L2_CID_... */
    char name[CONTROL_NAME];
    uint32_t kind; /* the driver's own */
    bool menu;     /* its values are items, not all from min to max */
    bool read_only;
    int64_t min, max, step, usual; /* step of a menu: the driver's own */
} control;

typedef struct controls {
    const void *self;
    const char *name, *stage; /* of the device, and of the stage, as users see them */
    /* Steps to the next control, from a zeroed one to the first; leaves its range. */
    bool (*next)(const void *self, control *c);
    /* Fills the range. False: the device does not tell. */
    bool (*range)(const void *self, control *c);
    /* What an item of a menu is called. False: there is none of this value. */
    bool (*item)(const void *self, const control *c, int64_t value, char text[CONTROL_ITEM]);
    bool (*get)(const void *self, const control *c, int64_t *value);
    bool (*set)(const void *self, const control *c, int64_t value);
} controls;

/* Stops what would change the camera's model or the grey levels while it moves: automatic exposure
 * and gain, focus and zoom. What is not there is passed over. Returns 0, or ARRIS_E_IO when one did
 * not let itself be stopped. */
int controls_calm(const controls *l, fault *f);

/* Sets controls from lines `name=value` (NULL: none). A value is a number, or an item of a menu by
 * its number or text. It is read back. Returns 0, or ARRIS_E_USAGE: the fault says what there is,
 * its hint lists the names; ARRIS_E_IO. */
int controls_set(const controls *l, const char *lines, fault *f);

/* The exposure time in ms; 0: the device does not say. */
double controls_exposure(const controls *l);

/* Writes a line for every control, "  gain: 0 to 255, default 16, now 20". */
void controls_list(const controls *l, FILE *out);

#endif
