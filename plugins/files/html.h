/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * html.h: the report of an inspection as a page: the verdict, a table, the deviations on the part
 * in three views, and the part drawn over a frame.
 */
#ifndef HTML_H
#define HTML_H

#include "arris_geometry.h"
#include "writers.h"

/* The frame in which the features lie nearest to the middle, of those that were offered. */
typedef struct report {
    int32_t width, height; /* px */
    uint8_t *grey;         /* width x height */
    double off;            /* px², from the middle; INFINITY: none was taken */
    arris_camera camera;
    arris_pose pose;
} report;

/* False when memory is short. Frames of another size are not taken. */
bool report_begin(report *r, int32_t width, int32_t height);
void report_frame(report *r, const arris_verdict *v, const arris_image *image,
                  const arris_pose *pose);
void report_end(report *r);

/* `recipe` is the SHA-256 of the recipe's file, or empty. */
void report_write(FILE *out, const report *r, const arris_verdict *v, const arris_lines *lines,
                  const svg_cameras *cameras, const char *recipe);

#endif
