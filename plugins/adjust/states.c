/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * states.c: what the reported poses, or the pictures, have in common, and what is left of a pose's
 * error besides (problem.h).
 */
#include <math.h>
#include <string.h>

#include "problem.h"

/* ---- common states --------------------------------------------------------------------------- */

static const struct {
    const char *name;
    unsigned bit;
    int n;
    double sigma[2]; /* of the first three and of the others */
} commons[] = {{"scale", ADJ_SCALE, 1, {0.01, 0}},
               {"drift", ADJ_DRIFT, 6, {1, 1e-3}},
               {"hand-eye", ADJ_HAND_EYE, 6, {5, 1e-2}},
               {"delay", ADJ_DELAY, 1, {0.05, 0}},
               {"lens", ADJ_LENS, ADJ_LENS_TERMS, {1, 1}}};
enum { COMMONS = sizeof commons / sizeof *commons };

int adj_n_common(const adj_problem *p) {
    int n = 0;
    for (int i = 0; i < COMMONS; i++)
        n += p->common & commons[i].bit ? commons[i].n : 0;
    return n;
}

void adj_set_common(adj_problem *p, unsigned common) {
    int n = 0;
    p->common = common;
    for (int i = 0; i < COMMONS; i++)
        for (int k = 0; common & commons[i].bit && k < commons[i].n; k++, n++) {
            p->state[n] = 0;
            p->state_sigma[n] = commons[i].sigma[k / 3];
        }
}

const char *adj_common_name(const adj_problem *p, int state) {
    int n = 0, i = 0;
    while (n += p->common & commons[i].bit ? commons[i].n : 0, n <= state)
        i++;
    return commons[i].name;
}

/* The rotation vector w of R = R0 exp[-w]; and the derivative of w when R is turned further. */
static void turned(const double R[9], const double R0[9], double w[3], double J[9]) {
    double E[9]; /* exp[w] = R' R0 */
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            E[3 * i + j] = R[i] * R0[j] + R[3 + i] * R0[3 + j] + R[6 + i] * R0[6 + j];
    double s[3] = {(E[7] - E[5]) / 2, (E[2] - E[6]) / 2, (E[3] - E[1]) / 2};
    double sine = sqrt(arris_dot(s, s)), t = atan2(sine, (E[0] + E[4] + E[8] - 1) / 2);
    for (int i = 0; i < 3; i++)
        w[i] = sine > 1e-8 ? s[i] * t / sine : s[i];
    if (!J)
        return;
    double k = t > 1e-3 ? 1 / (t * t) - (1 + cos(t)) / (2 * t * sine) : 1 / 12.0;
    double W[9] = {0, -w[2], w[1], w[2], 0, -w[0], -w[1], w[0], 0};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            J[3 * i + j] = (i == j) - W[3 * i + j] / 2 + k * (w[i] * w[j] - (i == j) * t * t);
}

/* By how much the reported pose moves a second. */
static void velocity(const adj_problem *p, uint32_t frame, double v[6]) {
    uint32_t a = frame > 0 ? frame - 1 : 0, b = frame + 1 < p->n_frames ? frame + 1 : frame;
    const adj_frame *f = &p->frame[a], *g = &p->frame[b];
    double dt = g->time - f->time;
    memset(v, 0, 6 * sizeof *v);
    if (!(dt > 0))
        return;
    turned(g->reported.R, f->reported.R, v + 3, NULL);
    for (int i = 0; i < 3; i++) {
        v[i] = (g->reported.C[i] - f->reported.C[i]) / dt;
        v[i + 3] /= dt;
    }
}

/* Columns of G, in the order of the states. */
static void add_scale(const adj_problem *p, uint32_t frame, double G[6][ADJ_COMMON], int at) {
    const double *first = p->frame[0].reported.C, *last = p->frame[p->n_frames - 1].reported.C;
    for (int i = 0; i < 3; i++)
        G[i][at] = p->frame[frame].reported.C[i] - (first[i] + last[i]) / 2;
}

static void add_drift(const adj_problem *p, uint32_t frame, double G[6][ADJ_COMMON], int at) {
    double first = p->frame[0].time, span = p->frame[p->n_frames - 1].time - first;
    double t = span > 0 ? (p->frame[frame].time - first) / span - 0.5 : 0;
    for (int i = 0; i < 6; i++)
        G[i][at + i] = t;
}

static void add_hand_eye(const adj_problem *p, uint32_t frame, double G[6][ADJ_COMMON], int at) {
    const double *R = p->frame[frame].reported.R;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            G[i][at + j] = G[i + 3][at + j + 3] = R[3 * j + i];
}

static void add_delay(const adj_problem *p, uint32_t frame, double G[6][ADJ_COMMON], int at) {
    double v[6];
    velocity(p, frame, v);
    for (int i = 0; i < 6; i++)
        G[i][at] = v[i];
}

double adj_scale(const adj_problem *p) {
    return p->common & ADJ_SCALE ? 1 + p->state[0] : 1;
}

void adj_error(const adj_problem *p, uint32_t frame, double e[6], double J[9],
               double G[6][ADJ_COMMON]) {
    typedef void add(const adj_problem *, uint32_t, double[6][ADJ_COMMON], int);
    static add *const adds[COMMONS] = {add_scale, add_drift, add_hand_eye, add_delay, NULL};
    const adj_frame *f = &p->frame[frame];
    double own[6][ADJ_COMMON], (*g)[ADJ_COMMON] = G ? G : own;
    int n = 0;
    for (int i = 0; i < 3; i++)
        e[i] = f->pose.C[i] - f->reported.C[i];
    turned(f->pose.R, f->reported.R, e + 3, J);
    if (!p->common)
        return;
    memset(g, 0, sizeof own);
    for (int i = 0; i < COMMONS; i++)
        if (p->common & commons[i].bit) {
            if (adds[i])
                adds[i](p, frame, g, n);
            n += commons[i].n;
        }
    for (int i = 0; i < 6; i++)
        for (int k = 0; k < n; k++)
            e[i] -= g[i][k] * p->state[k];
    double scale = adj_scale(p);
    for (int i = 0; i < 3; i++) {
        e[i] /= scale;
        for (int k = 0; k < n; k++)
            g[i][k] /= scale;
        if (p->common & ADJ_SCALE)
            g[i][0] += e[i] / scale;
    }
}
