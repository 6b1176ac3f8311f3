/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * outbox.h: encodes what is sent into buffers that are there from the start, and sends it. Each
 * function is for one thread at a time, and returns 0 or ARRIS_E_IO when the network did not take
 * it.
 */
#ifndef OUTBOX_H
#define OUTBOX_H

#include "arris_plugin.h"
#include "book.h"
#include "fault.h"
#include "link.h"

typedef struct outbox outbox;

/* What a message is of. */
typedef struct stamp {
    int64_t utime, frame; /* µs; the frame's index */
} stamp;

/* Messages go to the channels PREFIX + LINES and so on. `caps` says the size of images, `segments`
 * how many there are at most. NULL with *f filled: ARRIS_E_MEMORY, _USAGE. */
outbox *outbox_new(lcm_link *link, const char *prefix, const arris_caps *caps, size_t segments,
                   fault *f);
void outbox_free(outbox *o); /* NULL is allowed */

/* A set of lines: what is pending, or all that there are; `kind` is one of ARRIS_LINES_T_CHANGES,
 * _WHOLE, _FINAL. `lines` gives what is common to all. */
int outbox_lines(outbox *o, const stamp *s, int8_t kind, const book *b, const arris_lines *lines);

/* `tracks` may be NULL. */
int outbox_segments(outbox *o, const stamp *s, const arris_segments *segments,
                    const arris_tracks *tracks);

int outbox_image(outbox *o, const stamp *s, const arris_image *image);

/* `final`: the scan has ended. */
int outbox_verdict(outbox *o, const stamp *s, const arris_verdict *v, bool final);

/* The image made small, by whole factors, with 8 bits. */
int outbox_preview(outbox *o, const stamp *s, const arris_image *image);

/* How the stage's pipeline is; `fps` over the last second. */
int outbox_status(outbox *o, const arris_stage *stage, const char *pipeline, double fps,
                  bool ended);

#endif
