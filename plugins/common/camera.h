/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * camera.h: camera.json, the parameters of one camera.
 */
#ifndef CAMERA_H
#define CAMERA_H

#include "fault.h"

/* Reads the n bytes of a camera.json: an object with the numbers width, height, fx, fy, skew, cx,
 * cy, k1, k2, p1, p2, k3; other keys are ignored. A fault names `path` and the key. Returns 0 or
 * ARRIS_E_INPUT. */
int camera_parse(const char *text, size_t n, const char *path, arris_camera *c, fault *f);

/* The same from a file; then also ARRIS_E_IO and ARRIS_E_MEMORY. */
int camera_load(const char *path, arris_camera *c, fault *f);

#endif
