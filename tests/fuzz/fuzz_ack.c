/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * fuzz_ack.c: any bytes as a robot_ack_t.
 */
#include "message.h"
#include "messages.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n) {
    arris_robot_ack_t a;
    uint8_t *m = message_of(__arris_robot_ack_t_get_hash(), data, n);
    if (robot_ack_read(m, n + 8, &a) == 0 && strlen(a.reason) > MESSAGE_TEXT)
        abort();
    free(m);
    return 0;
}
