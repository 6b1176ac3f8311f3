/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * controls.h: the controls of a USB camera's terminal and processing unit (USB Video Class 1.1,
 * 4.2.2), by the names that the kernel's driver gives them, so that a launch line suits both.
 */
#ifndef USB_CONTROLS_H
#define USB_CONTROLS_H

#include <stdio.h>

#include "camera.h"

/* Stops automatic exposure and focus, as far as the camera has them. Returns 0 or ARRIS_E_IO. */
int controls_calm(const camera *c, fault *f);

/* Sets controls from lines `name=number` (NULL: none), and reads them back. Returns 0, or
 * ARRIS_E_USAGE: the fault says the range, its hint lists the names; ARRIS_E_IO. */
int controls_set(const camera *c, const char *lines, fault *f);

/* The exposure time in ms; 0: the camera does not say. */
double controls_exposure(const camera *c);

/* Writes a line for every control, "gain: 0 to 255, default 16, now 20". */
void controls_list(const camera *c, FILE *out);

#endif
