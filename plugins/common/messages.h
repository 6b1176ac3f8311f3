/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * messages.h: the LCM messages that Arris receives, read and validated. What points into the
 * message (strings, an image's data) lives as long as that. Nothing is allocated. Any thread.
 * Every function returns 0, or ARRIS_E_INPUT when the bytes are no such message or its values make
 * no sense; then *out is undefined.
 */
#ifndef MESSAGES_H
#define MESSAGES_H

#include "arris_types.h"
#include "lcmtypes/arris_image_t.h"
#include "lcmtypes/arris_robot_ack_t.h"
#include "lcmtypes/arris_robot_command_t.h"
#include "lcmtypes/arris_robot_state_t.h"

enum {
    MESSAGE_MAX = 60000,      /* bytes, of all but an image */
    MESSAGE_TEXT = 500,       /* characters of a string */
    MESSAGE_POSES = 500,      /* of a path */
    MESSAGE_PIXELS = 16 << 20 /* of an image */
};

/* Positions are within 1 km, quaternions of unit length. */
int robot_state_read(const void *data, size_t n, arris_robot_state_t *out);

/* The n poses come into `pos` and `quat`, which have room for MESSAGE_POSES; out's own are NULL. */
int robot_command_read(const void *data, size_t n, double pos[][3], double quat[][4],
                       arris_robot_command_t *out);

int robot_ack_read(const void *data, size_t n, arris_robot_ack_t *out);

/* GRAY or LE_GRAY16, `height` whole rows of data. *seq is the camera's count of frames, -1 when the
 * message has none. out->metadata is NULL. */
int image_read(const void *data, size_t n, arris_image_t *out, int64_t *seq);

#endif
