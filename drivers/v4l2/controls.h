/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * controls.h: a device's controls by their names.
 *
 * A name is that of the driver in small letters, with one _ for all that is neither letter nor
 * digit ("Exposure Time, Absolute": exposure_time_absolute), as v4l2-ctl has it. exposure, focus
 * and zoom also mean the absolute ones where no control has just that name.
 */
#ifndef V4L2_CONTROLS_H
#define V4L2_CONTROLS_H

#include "device.h"

enum { CONTROL_TEXT = 200 };

/* Stops what would change the camera's model or the grey levels while it moves: automatic exposure
 * and gain, focus and zoom. What is not there is passed over. Returns 0, or ARRIS_E_IO when one did
 * not let itself be stopped. */
int controls_calm(const device *d, fault *f);

/* Sets controls from lines `name=value` (NULL: none). A value is a number, or an item of a menu by
 * its number or text. It is read back. Returns 0, or ARRIS_E_USAGE: the fault says what there is,
 * its hint lists the names; ARRIS_E_IO. */
int controls_set(const device *d, const char *lines, fault *f);

/* The exposure time in ms; 0: the device does not say. */
double controls_exposure(const device *d);

/* Calls use(text) for every control, "gain: 0 to 255, default 16, now 20". */
void controls_each(const device *d, void (*use)(const char *text, void *user), void *user);

#endif
