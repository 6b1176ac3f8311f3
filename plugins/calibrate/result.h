/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * result.h: what `arris calibrate` says and writes: the table, camera.json, the report.
 */
#ifndef CALIBRATE_RESULT_H
#define CALIBRATE_RESULT_H

#include <jansson.h>
#include <stdio.h>

#include "quality.h"
#include "views.h"

/* The table of the parameters with one sigma and 95 % intervals, the views, the advice. */
void result_print(FILE *out, const view_list *l, const cal_options *o, const cal_result *r,
                  const cal_quality *q);

/* Reads the object that is in the file at `path` already, whose unknown keys are to be kept; an
 * empty object when there is no file. NULL with *f filled: what is there is no JSON object. */
json_t *result_read_old(const char *path, fault *f);

/* Writes camera.json with its key "calibration" (FORMATS.md) over `old`; it appears complete or not
 * at all. Returns 0 or ARRIS_E_IO, _MEMORY. */
int result_write_camera(const char *path, json_t *old, const view_list *l, const cal_options *o,
                        const cal_result *r, fault *f);

/* Any object, likewise. */
int result_write_json(const char *path, const json_t *o, fault *f);

/* One HTML file with everything in it. Returns 0 or ARRIS_E_IO. */
int result_write_report(const char *path, const view_list *l, const cal_options *o,
                        const cal_result *r, const cal_quality *q, fault *f);

#endif
