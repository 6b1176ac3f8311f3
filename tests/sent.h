/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * sent.h: LCM messages as others send them, by lcm-gen's encoders.
 */
#ifndef SENT_H
#define SENT_H

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "lcmtypes/arris_image_t.h"
#include "lcmtypes/arris_robot_ack_t.h"
#include "lcmtypes/arris_robot_command_t.h"
#include "lcmtypes/arris_robot_state_t.h"

enum { MESSAGE_ROOM = 1 << 20 };

typedef struct message {
    size_t n;
    uint8_t data[MESSAGE_ROOM];
} message;

static inline arris_robot_state_t a_state(int64_t utime, int32_t seq, double x) {
    static char none[] = "";
    return (arris_robot_state_t){.utime = utime,
                                 .seq = seq,
                                 .session = 1,
                                 .pos = {x, 0, 0},
                                 .quat = {1, 0, 0, 0},
                                 .homed = 1,
                                 .message = none};
}

static inline void encoded(message *m, int n) {
    if (n < 0)
        abort();
    m->n = (size_t)n;
}

static inline void put_state(message *m, const arris_robot_state_t *s) {
    encoded(m, arris_robot_state_t_encode(m->data, 0, MESSAGE_ROOM, s));
}

/* A command with n poses at (x, y, z). */
static inline void put_command(message *m, int64_t commander, int32_t request, int8_t command,
                               double speed, int n, double x, double y, double z) {
    static double pos[500][3], quat[500][4];
    double *pos_row[500], *quat_row[500];
    for (int i = 0; i < n; i++) {
        memcpy(pos[i], (double[]){x, y, z}, sizeof pos[i]);
        memcpy(quat[i], (double[]){1, 0, 0, 0}, sizeof quat[i]);
        pos_row[i] = pos[i];
        quat_row[i] = quat[i];
    }
    arris_robot_command_t c = {.utime = 1,
                               .commander = commander,
                               .request = request,
                               .command = command,
                               .speed = speed,
                               .n = n,
                               .pos = pos_row,
                               .quat = quat_row};
    encoded(m, arris_robot_command_t_encode(m->data, 0, MESSAGE_ROOM, &c));
}

static inline void put_ack(message *m, const char *reason) {
    arris_robot_ack_t a = {.utime = 1,
                           .commander = 1,
                           .request = 1,
                           .result = ARRIS_ROBOT_ACK_T_REFUSED,
                           .reason = (char *)(uintptr_t)reason};
    encoded(m, arris_robot_ack_t_encode(m->data, 0, MESSAGE_ROOM, &a));
}

/* A grey picture whose pixels are all `value`; with its number `seq` unless that is negative. */
static inline void put_image(message *m, int w, int h, int64_t utime, int64_t seq, uint8_t value) {
    uint8_t *data = malloc((size_t)w * (size_t)h), number[8];
    for (int i = 0; i < 8; i++)
        number[i] = (uint8_t)((uint64_t)seq >> (56 - 8 * i));
    memset(data, value, (size_t)w * (size_t)h);
    arris_image_metadata_t key = {.key = (char[]){"seq"}, .n = 8, .value = number};
    arris_image_t i = {.utime = utime,
                       .width = w,
                       .height = h,
                       .row_stride = w,
                       .pixelformat = ARRIS_IMAGE_T_PIXEL_FORMAT_GRAY,
                       .size = w * h,
                       .data = data,
                       .nmetadata = seq >= 0,
                       .metadata = &key};
    encoded(m, arris_image_t_encode(m->data, 0, MESSAGE_ROOM, &i));
    free(data);
}

/* What may befall a message: cut short, grown, bits turned, a count or a number made extreme. `r`
 * is the state of chance. Returns whether it is surely no message any more. */
static inline uint32_t chance(uint64_t *r) {
    *r = *r * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(*r >> 33);
}

static inline bool damage(message *m, uint64_t *r) {
    static const uint8_t extreme[4][4] = {
        {0xff, 0xff, 0xff, 0xff}, {0x7f, 0xff, 0xff, 0xff}, {0x80, 0, 0, 0}, {0x7f, 0xf0, 0, 0}};
    switch (chance(r) % 4) {
    case 0:
        m->n = chance(r) % m->n;
        return true;
    case 1:
        m->data[m->n++] = (uint8_t)chance(r);
        return true;
    case 2:
        for (uint32_t k = 1 + chance(r) % 8; k > 0; k--)
            m->data[chance(r) % m->n] ^= (uint8_t)(1 << chance(r) % 8);
        return false;
    default:
        memcpy(m->data + chance(r) % (m->n - 4), extreme[chance(r) % 4], 4);
        return false;
    }
}

#endif
