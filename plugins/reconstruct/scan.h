/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * scan.h: the lines of a scan: which track belongs to which line, which lines are one, what is told
 * of them. No dependency on the runtime.
 */
#ifndef SCAN_H
#define SCAN_H

#include "arris_types.h"
#include "view.h"

typedef struct scan_params {
    double limit;      /* mm; negative: of the distance, as line_report has it */
    double pose_sigma; /* mm; 0: unknown, estimated */
    double rot_sigma;  /* rad; 0: unknown, taken as none */
    int32_t max_lines, min_views;
} scan_params;

typedef struct scan scan;

/* NULL when memory is short. For scan_free. Nothing is allocated afterwards. */
scan *scan_new(const scan_params *p);
void scan_free(scan *s); /* NULL is allowed */

/* The track will be added shortly: fetches what is known of its line; `next`: now its views. */
void scan_expect(const scan *s, int32_t track, bool next);

/* The track is alive in this frame; `v` is its view, NULL when it was not seen. The view is turned
 * when it runs against the line. A track that was away goes on with the line of its id. */
void scan_add(scan *s, int32_t track, view *v);

/* All tracks of the frame were added. `counts`: the frame had a pose. */
void scan_end_frame(scan *s, bool counts);

/* No frame follows: completes every line. */
void scan_finish(scan *s);

/* Writes all lines that are told of, as of the last scan_end_frame or scan_finish. */
void scan_write(const scan *s, arris_lines *out);

#endif
