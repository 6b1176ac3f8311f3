/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * flange.h: flange.csv, the poses that a robot reported with its pictures:
 *     index,file,utime,x,y,z,qw,qx,qy,qz
 * the flange in the robot's base, mm, and its rotation to the base as a unit quaternion.
 */
#ifndef CALIBRATE_FLANGE_H
#define CALIBRATE_FLANGE_H

#include "bytes.h"
#include "model.h"

typedef struct flange_entry {
    const char *file; /* relative to the CSV's folder, or absolute */
    cal_pose pose;    /* flange to base */
} flange_entry;

typedef struct flange_list {
    int n;
    flange_entry *item;
    bytes text; /* which `file` points into */
} flange_list;

/* Reads the file. flange_free must follow in any case. Returns 0 or ARRIS_E_INPUT, _IO, _MEMORY. */
int flange_load(flange_list *l, const char *path, fault *f);

void flange_free(flange_list *l);

#endif
