/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * input.h: a scan that filesink wrote: lines.json, segments.csv, and the frames.csv they are of.
 */
#ifndef ADJUST_INPUT_H
#define ADJUST_INPUT_H

#include "fault.h"
#include "frames.h"
#include "record.h"

/* The n bytes of a lines.json (arris-lines/1). `lines` comes zeroed; free(lines->item) releases it,
 * in any case. Returns 0 or ARRIS_E_INPUT, _MEMORY. */
int input_lines(const char *text, size_t n, const char *path, arris_lines *lines, fault *f);

/* The n bytes of a segments.csv, followed by a zero byte, with the frames of the list that have a
 * pose; the text is changed. `r` comes zeroed, record_free releases it, in any case. Segments
 * without a track are left out; the pixels are taken for ideal ones. Returns as above. */
int input_segments(char *text, size_t n, const char *path, const frame_list *frames,
                   const arris_camera *c, record *r, fault *f);

#endif
