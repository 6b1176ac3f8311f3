/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * calibration.h: what the camera model's own uncertainty adds to a deviation. No dependency on the
 * runtime.
 */
#ifndef CALIBRATION_H
#define CALIBRATION_H

#include "match.h"

/* A wrong focal length moves a point at depth Z along the optical axis by Z * focal, a wrong
 * principal point moves it across by Z * centre. */
typedef struct calibration {
    double focal;      /* standard uncertainty, relative */
    double centre[2];  /* standard uncertainty, rad, along the picture's x and y */
    double C[3], R[9]; /* a camera of the path, for the depth and the axes */
} calibration;

/* Reads what `arris calibrate` writes into a camera.json: "calibration": {"sigma": {"fx": px, "fy",
 * "cx", "cy"}}. C and R are left alone. Returns 0, or ARRIS_E_INPUT, _IO, _MEMORY. */
int calibration_read(calibration *c, const char *path, fault *f);

/* Adds it to the covariance of a piece's deviation; it is common to both its ends. */
void calibration_spread(const calibration *c, piece *e);

#endif
