/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * messages.c: the LCM messages that Arris receives (messages.h). The order of the reads is that of
 * the fields in plugins/lcm/types.
 */
#include "messages.h"

#include <math.h>

#include "rigid.h"
#include "wire.h"

static const double FAR = 1e6; /* mm */

/* lcm-gen's code computes a fingerprint when it is first asked for, without a lock: so before there
 * are threads. */
__attribute__((constructor)) static void compute_fingerprints(void) {
    __arris_robot_state_t_get_hash();
    __arris_robot_command_t_get_hash();
    __arris_robot_ack_t_get_hash();
    __arris_image_t_get_hash();
}

/* A string of a received message: the generated structs have no const. */
static char *text(wire *w) {
    return (char *)(uintptr_t)wire_string(w, MESSAGE_TEXT);
}

static bool is_flag(int8_t b) {
    return b == 0 || b == 1;
}

static bool is_position(const double p[3]) {
    return fabs(p[0]) < FAR && fabs(p[1]) < FAR && fabs(p[2]) < FAR;
}

/* Finite, not negative, and no more than `max`. */
static bool is_within(double v, double max) {
    return v >= 0 && v <= max;
}

static int verdict(bool good) {
    return good ? 0 : ARRIS_E_INPUT;
}

int robot_state_read(const void *data, size_t n, arris_robot_state_t *out) {
    wire w = wire_begin(data, n, __arris_robot_state_t_get_hash());
    out->utime = wire_int64(&w);
    out->seq = wire_int32(&w);
    out->session = wire_int64(&w);
    wire_doubles(&w, out->pos, 3);
    wire_doubles(&w, out->quat, 4);
    out->pos_sigma = wire_double(&w);
    out->rot_sigma = wire_double(&w);
    out->moving = wire_int8(&w);
    out->homed = wire_int8(&w);
    out->held = wire_int8(&w);
    out->commander = wire_int64(&w);
    out->request = wire_int32(&w);
    out->error = wire_int32(&w);
    out->message = text(&w);
    return verdict(wire_ended(&w) && out->utime > 0 && out->utime < INT64_MAX / 2000 &&
                   is_position(out->pos) && rigid_normalise(out->quat) &&
                   is_within(out->pos_sigma, FAR) && is_within(out->rot_sigma, 10) &&
                   is_flag(out->moving) && is_flag(out->homed) && is_flag(out->held) &&
                   out->error >= 0 && out->error <= ARRIS_ROBOT_STATE_T_ERROR_OTHER);
}

int robot_command_read(const void *data, size_t n, double pos[][3], double quat[][4],
                       arris_robot_command_t *out) {
    wire w = wire_begin(data, n, __arris_robot_command_t_get_hash());
    out->utime = wire_int64(&w);
    out->seq = wire_int32(&w);
    out->commander = wire_int64(&w);
    out->request = wire_int32(&w);
    out->command = wire_int8(&w);
    out->speed = wire_double(&w);
    out->time_limit = wire_double(&w);
    out->n = wire_count(&w, MESSAGE_POSES);
    wire_doubles(&w, pos[0], 3 * (size_t)out->n);
    wire_doubles(&w, quat[0], 4 * (size_t)out->n);
    out->pos = NULL;
    out->quat = NULL;
    bool good = wire_ended(&w) && out->commander != 0 && out->command >= 0 &&
                out->command <= ARRIS_ROBOT_COMMAND_T_RELEASE && is_within(out->speed, 1e5) &&
                is_within(out->time_limit, 1e6);
    for (int32_t i = 0; good && i < out->n; i++)
        good = is_position(pos[i]) && rigid_normalise(quat[i]);
    return verdict(good);
}

int robot_ack_read(const void *data, size_t n, arris_robot_ack_t *out) {
    wire w = wire_begin(data, n, __arris_robot_ack_t_get_hash());
    out->utime = wire_int64(&w);
    out->seq = wire_int32(&w);
    out->session = wire_int64(&w);
    out->commander = wire_int64(&w);
    out->request = wire_int32(&w);
    out->result = wire_int8(&w);
    out->reason = text(&w);
    return verdict(wire_ended(&w) && out->result >= 0 &&
                   out->result <= ARRIS_ROBOT_ACK_T_TIMED_OUT);
}

/* Reads past the metadata, and "seq" out of it. */
static void read_metadata(wire *w, int32_t count, int64_t *seq) {
    for (int32_t i = 0; i < count; i++) {
        const char *key = wire_string(w, MESSAGE_TEXT);
        int32_t n = wire_count(w, MESSAGE_MAX);
        if (strcmp(key, "seq") == 0 && n == 8)
            *seq = wire_int64(w);
        else
            wire_bytes(w, (size_t)n);
    }
}

int image_read(const void *data, size_t n, arris_image_t *out, int64_t *seq) {
    wire w = wire_begin(data, n, __arris_image_t_get_hash());
    *seq = -1;
    out->utime = wire_int64(&w);
    out->width = wire_int32(&w);
    out->height = wire_int32(&w);
    out->row_stride = wire_int32(&w);
    out->pixelformat = wire_int32(&w);
    out->size = wire_count(&w, 4 * MESSAGE_PIXELS);
    out->data = (uint8_t *)(uintptr_t)wire_bytes(&w, (size_t)out->size);
    out->nmetadata = wire_count(&w, 100);
    out->metadata = NULL;
    read_metadata(&w, out->nmetadata, seq);
    int64_t bytes = out->pixelformat == ARRIS_IMAGE_T_PIXEL_FORMAT_GRAY        ? 1
                    : out->pixelformat == ARRIS_IMAGE_T_PIXEL_FORMAT_LE_GRAY16 ? 2
                                                                               : 0;
    return verdict(wire_ended(&w) && bytes > 0 && out->width > 0 && out->height > 0 &&
                   (int64_t)out->width * out->height <= MESSAGE_PIXELS &&
                   out->row_stride >= out->width * bytes &&
                   (int64_t)out->row_stride * out->height <= out->size);
}
