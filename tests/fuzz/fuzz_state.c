/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * fuzz_state.c: any bytes as a robot_state_t, to what `pose` makes of them.
 */
#include <math.h>

#include "lcm/states.h"
#include "message.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n) {
    static states s;
    static int64_t now = 1;
    uint8_t *m = message_of(__arris_robot_state_t_get_hash(), data, n);
    if (!s.line.max && !states_new(&s, now))
        abort();
    states_receive(&s, m, n + 8, now += 5000000);
    const timed_pose *p = timeline_newest(&s.line);
    if (p && (!isfinite(p->pos[0]) || !(fabs(p->quat[0]) <= 1) || !(p->pos_sigma >= 0)))
        abort();
    free(m);
    return 0;
}
