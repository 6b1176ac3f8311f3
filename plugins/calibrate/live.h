/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * live.h: what becomes of the pictures of `arris calibrate --from`.
 */
#ifndef CALIBRATE_LIVE_H
#define CALIBRATE_LIVE_H

#include "arris_types.h"
#include "fault.h"

/* Takes one picture of the stream; `paced` says that it comes at a camera's rate, so that a board
 * counts as still only when it was there in the picture before. Ends the stream when there are
 * views enough. Returns 0 or an error. By the thread of the stage. */
int live_take(const arris_image *image, int64_t frame, bool paced, fault *f);

/* Whether `arris calibrate --from` is what runs. */
bool live_runs(void);

#endif
