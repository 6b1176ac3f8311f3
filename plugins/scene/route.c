/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * route.c: the poses of a simulated camera (route.h).
 */
#include "route.h"

#include <math.h>
#include <string.h>

#include "arris_geometry.h"
#include "mix.h"

/* R = A R: turns the camera within its own axes. */
static void turn(arris_pose *pose, const double A[9]) {
    double R[9];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            R[3 * i + j] = A[3 * i] * pose->R[j] + A[3 * i + 1] * pose->R[3 + j] +
                           A[3 * i + 2] * pose->R[6 + j];
    memcpy(pose->R, R, sizeof R);
}

/* C += R^T d: moves the camera along its own axes. */
static void move(arris_pose *pose, double x, double y, double z) {
    for (int k = 0; k < 3; k++)
        pose->C[k] += pose->R[k] * x + pose->R[3 + k] * y + pose->R[6 + k] * z;
}

void route_pose(const route *p, int64_t i, int64_t n, arris_pose *pose) {
    double s = ((double)i - (n > 0 ? (double)(n - 1) / 2 : 0)) * p->step, A[9];
    memset(pose, 0, sizeof *pose);
    pose->valid = true;
    memcpy(pose->C, p->middle, sizeof pose->C);
    arris_rotation(p->middle[3], p->middle[4], p->middle[5], pose->R);
    if (p->kind == ROUTE_ARC) {
        double angle = s / p->radius;
        move(pose, p->radius * sin(angle), 0, p->radius * (1 - cos(angle)));
        arris_rotation(0, -angle, 0, A);
        turn(pose, A);
    } else {
        move(pose, p->kind == ROUTE_X ? s : 0, p->kind == ROUTE_Y ? s : 0, 0);
    }
}

void route_shake(arris_pose *pose, double position, double rotation, uint64_t seed) {
    double e[6], A[9];
    for (int k = 0; k < 6; k++)
        e[k] = mix_normal(seed, (uint64_t)k);
    for (int k = 0; k < 3; k++)
        pose->C[k] += position * e[k];
    arris_rotation(rotation * e[3], rotation * e[4], rotation * e[5], A);
    turn(pose, A);
}
