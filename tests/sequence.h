/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * sequence.h: sequences of frames whose 3D lines are known, between a test and the stages of
 * plugins/sequence.c. A frame is either a list of segments, as a detector would find them, or a
 * picture.
 */
#ifndef SEQUENCE_H
#define SEQUENCE_H

#include "arris_geometry.h"

enum { SEQUENCE_SEGMENTS = 12000, SEQUENCE_FRAMES = 400 };

typedef struct sequence {
    arris_camera camera;
    int frames;
    /* Fill a frame: where the robot says it was taken, and what is seen. One of the two is NULL. */
    void (*shoot)(int i, arris_pose *pose, arris_segments *out);
    void (*draw)(int i, arris_pose *pose, arris_image *out);
} sequence;

#pragma GCC visibility push(default)

/* Given by the test: what to play, and what hears of it. In the end once more, with the lines only.
 */
const sequence *sequence_now(void);
void sequence_look(int frame, const arris_segments *segments, const arris_tracks *tracks,
                   const arris_lines *lines);

#pragma GCC visibility pop
#endif
