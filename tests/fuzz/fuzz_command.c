/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * fuzz_command.c: any bytes as a robot_command_t, to a simulated robot: it never leaves its work
 * space.
 */
#include "message.h"
#include "messages.h"
#include "robot/robot.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n);

static void on_state(void *user, const void *data, size_t n) {
    arris_robot_state_t s;
    (void)user;
    if (robot_state_read(data, n, &s))
        abort();
    for (int i = 0; i < 3; i++)
        if (!(s.pos[i] >= -100 && s.pos[i] <= 100))
            abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n) {
    static const robot_limits limits = {.space = {{-100, 100}, {-100, 100}, {-100, 100}},
                                        .speed = 100,
                                        .max_speed = 500,
                                        .link_timeout = 0.5};
    static const robot_options options = {.home.quat = {1, 0, 0, 0}, .acceleration = 500};
    static robot *r;
    static int64_t now = 1000000000;
    static fault f;
    uint8_t *m = message_of(__arris_robot_command_t_get_hash(), data, n);
    if (!r) {
        lcm_link *link = link_open("memq://", &f);
        if (!link || link_subscribe(link, "ROBOT_STATE", 64, on_state, NULL, NULL, &f) ||
            !(r = robot_new(&driver_sim, &options, &limits, link, now, &f)))
            abort();
    }
    robot_receive(r, m, n + 8);
    now += 5000000;
    robot_step(r, now, now / 1000);
    free(m);
    return 0;
}
