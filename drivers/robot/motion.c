/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * motion.c: where a robot is on its way along a path, at any time.
 */
#include "motion.h"

#include <math.h>

#include "arris_geometry.h"
#include "rigid.h"

static const double LEVER = 100;      /* mm of way a radian */
static const double STRAIGHT = 0.996; /* cosine of the turn that needs no stop */

/* ---- speed ----------------------------------------------------------------------------------- */

profile profile_plan(double s0, double s1, double speed, double a, int64_t begin) {
    double way = s1 - s0, v = fmin(speed, sqrt(way * a)); /* the triangle's, when that is lower */
    double up = v / a, cruise = v > 0 ? way / v - up : 0;
    profile p = {.begin = begin, .n = 3, .t_end = 2 * up + cruise, .s_end = s1};
    p.phase[0].s = s0;
    p.phase[0].a = a;
    p.phase[1].t = up;
    p.phase[1].s = s0 + v * up / 2;
    p.phase[1].v = v;
    p.phase[2].t = up + cruise;
    p.phase[2].s = s1 - v * up / 2;
    p.phase[2].v = v;
    p.phase[2].a = -a;
    return p;
}

static void at(const profile *p, int64_t now, double *s, double *v) {
    double t = (double)(now - p->begin) * 1e-9;
    int k = p->n - 1;
    while (k > 0 && p->phase[k].t > t)
        k--;
    double dt = t - p->phase[k].t;
    *s = p->phase[k].s + dt * (p->phase[k].v + dt * p->phase[k].a / 2);
    *v = p->phase[k].v + dt * p->phase[k].a;
    if (t >= p->t_end) {
        *s = p->s_end;
        *v = 0;
    }
}

double profile_at(const profile *p, int64_t now) {
    double s, v;
    at(p, now, &s, &v);
    return s;
}

profile profile_brake(const profile *p, double a, int64_t now) {
    double s, v;
    at(p, now, &s, &v);
    profile b = {.begin = now, .n = 1, .t_end = v / a, .s_end = s + v * v / (2 * a)};
    b.phase[0].s = s;
    b.phase[0].v = v;
    b.phase[0].a = -a;
    return b;
}

/* ---- the path -------------------------------------------------------------------------------- */

static void difference(const robot_pose *a, const robot_pose *b, double d[3]) {
    for (int i = 0; i < 3; i++)
        d[i] = b->pos[i] - a->pos[i];
}

static double length(const robot_pose *a, const robot_pose *b) {
    double d[3], dot = 0;
    difference(a, b, d);
    for (int i = 0; i < 4; i++)
        dot += a->quat[i] * b->quat[i];
    double angle = 2 * acos(fmin(fabs(dot), 1));
    return fmax(sqrt(arris_dot(d, d)), LEVER * angle);
}

void path_begin(path *p, const robot_pose *from) {
    *p = (path){.n = 1, .pose[0] = *from};
}

void path_add(path *p, const robot_pose *to) {
    int k = p->n++;
    double d[3];
    difference(&p->pose[k - 1], to, d);
    p->pose[k] = *to;
    p->s[k] = p->s[k - 1] + length(&p->pose[k - 1], to);
    for (int i = 0; i < 3; i++)
        p->travel[k][i] = p->travel[k - 1][i] + fabs(d[i]);
}

int path_run_end(const path *p, int from) {
    int k = from + 1;
    for (; k + 1 < p->n; k++) {
        double a[3], b[3];
        difference(&p->pose[k - 1], &p->pose[k], a);
        difference(&p->pose[k], &p->pose[k + 1], b);
        double turn = arris_unit(a) > 0 && arris_unit(b) > 0 ? arris_dot(a, b) : 0;
        if (turn < STRAIGHT)
            break;
    }
    return k;
}

void path_at(const path *p, double s, robot_pose *out, double travel[3]) {
    int k = 1;
    while (k + 1 < p->n && p->s[k] < s)
        k++;
    if (p->n == 1) {
        *out = p->pose[0];
        travel[0] = travel[1] = travel[2] = 0;
        return;
    }
    double piece = p->s[k] - p->s[k - 1], f = piece > 0 ? (s - p->s[k - 1]) / piece : 1;
    f = fmin(fmax(f, 0), 1);
    for (int i = 0; i < 3; i++) {
        out->pos[i] = p->pose[k - 1].pos[i] + f * (p->pose[k].pos[i] - p->pose[k - 1].pos[i]);
        travel[i] = p->travel[k - 1][i] + f * (p->travel[k][i] - p->travel[k - 1][i]);
    }
    rigid_slerp(p->pose[k - 1].quat, p->pose[k].quat, f, out->quat);
}
