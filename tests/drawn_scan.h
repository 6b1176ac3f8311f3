/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * drawn_scan.h: scans of drawn lines from drawn poses, for the tests of adjust; after cmocka.h.
 */
#ifndef DRAWN_SCAN_H
#define DRAWN_SCAN_H

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "adjust/adjust.h"
#include "adjust/record.h"

static uint64_t state;

static inline double uniform(double lo, double hi) {
    state = state * 6364136223846793005u + 1442695040888963407u;
    return lo + (hi - lo) * (double)(state >> 11) / 9007199254740992.0;
}

static inline double gauss(void) {
    return sqrt(-2 * log(uniform(1e-12, 1))) * cos(uniform(0, 6.283185307179586));
}

static const arris_camera camera = {
    .width = 320, .height = 240, .fx = 380, .fy = 378, .skew = 0.5, .cx = 160, .cy = 119};

typedef struct scan_plan {
    uint32_t frames, lines;
    double step, position, rotation, px; /* mm; sigmas in mm, rad, px */
    bool parallel;
} scan_plan;

typedef struct truth {
    arris_pose pose[400];
    double P[400][3], Q[400][3];
} truth;

static truth sim;

static inline void assert_near(double a, double b, double tolerance) {
    assert_true(fabs(a - b) <= tolerance);
}

/* A camera that moves along x over lines at 670 to 1000 mm; poses as they are in `sim`. */
static inline void simulate(const scan_plan *plan, record *r, arris_lines *lines) {
    double middle = plan->step * (plan->frames - 1) / 2;
    assert_int_equal(record_init(r, &camera, plan->frames, plan->frames * plan->lines), 0);
    lines->item = calloc(plan->lines, sizeof *lines->item);
    lines->n = lines->max = plan->lines;
    for (uint32_t l = 0; l < plan->lines; l++) {
        double z = uniform(670, 1000), x = uniform(-middle - 80, middle + 80), y = uniform(-60, 60);
        double turn = plan->parallel ? 1.5 : l % 4 == 0 ? uniform(-0.3, 0.3) : uniform(1, 2);
        double half[3] = {60 * cos(turn), 60 * sin(turn), plan->parallel ? 0 : uniform(-20, 20)};
        arris_line *o = &lines->item[l];
        *o = (arris_line){.id = (int32_t)l, .state = ARRIS_MEASURED, .into = -1};
        for (int k = 0; k < 3; k++) {
            double c = k == 0 ? x : k == 1 ? y : z;
            sim.P[l][k] = c - half[k], sim.Q[l][k] = c + half[k];
            o->p[k] = sim.P[l][k] + 0.2 * gauss(), o->q[k] = sim.Q[l][k] + 0.2 * gauss();
        }
    }
    for (uint32_t i = 0; i < plan->frames; i++) {
        arris_pose reported = {.valid = true, .C = {i * plan->step - middle, 0, 0}};
        arris_pose *t = &sim.pose[i];
        arris_rotation(0, 0, 0, reported.R);
        *t = reported;
        double w[3];
        for (int k = 0; k < 3; k++) {
            t->C[k] += plan->position * gauss();
            w[k] = plan->rotation * gauss();
        }
        arris_rotation(w[0], w[1], w[2], t->R);
        assert_true(record_frame(r, i, (int64_t)i * 40000, &reported));
        for (uint32_t l = 0; l < plan->lines; l++) {
            double a[2], b[2], m[2], length;
            if (!(arris_project(&camera, t, sim.P[l], &a[0], &a[1]) > 0) ||
                !(arris_project(&camera, t, sim.Q[l], &b[0], &b[1]) > 0))
                continue;
            m[0] = (a[0] + b[0]) / 2, m[1] = (a[1] + b[1]) / 2;
            if (m[0] < 0 || m[0] > 320)
                continue;
            length = hypot(b[0] - a[0], b[1] - a[1]);
            double nx = -(b[1] - a[1]) / length, ny = (b[0] - a[0]) / length;
            double offset = plan->px * gauss(), bend = sqrt(3) * plan->px * gauss();
            arris_segment s = {
                .x1 = a[0] + nx * (offset - bend),
                .y1 = a[1] + ny * (offset - bend),
                .x2 = b[0] + nx * (offset + bend),
                .y2 = b[1] + ny * (offset + bend),
                .cov = {plan->px * plan->px, 0, 12 * plan->px * plan->px / (length * length)}};
            record_add(r, (int32_t)l, &s, &camera);
        }
    }
}

/* The same as a problem, all views with their line. */
static inline void make_problem(const record *r, const arris_lines *lines, adj_problem *p) {
    assert_int_equal(adj_init(p, r->n_frames, lines->n, r->n), 0);
    p->camera = camera;
    for (uint32_t i = 0; i < r->n_frames; i++)
        adj_add_frame(p, &r->frame[i].pose, i * 0.04);
    for (uint32_t i = 0; i < lines->n; i++)
        adj_add_line(p, lines->item[i].p, lines->item[i].q, 250);
    for (uint32_t i = 0; i < r->n; i++) {
        const sighting *o = &r->item[i];
        arris_segment s = {.x1 = o->x1,
                           .y1 = o->y1,
                           .x2 = o->x2,
                           .y2 = o->y2,
                           .cov = {(double)o->cov[0], (double)o->cov[1], (double)o->cov[2]}};
        assert_true(adj_add_view(p, o->frame, (uint32_t)o->track, &s) >= 0);
    }
    for (int k = 0; k < 6; k++)
        p->sigma[k] = k < 3 ? 0.2 : 2e-4;
    p->robust = 4;
}

/* Squared distance of the line from the true one at both ends, by its covariance, over 4. */
static inline double nees_of(const arris_line *l, uint32_t i) {
    double u[3], a[3], b[3], V[4][5] = {{0}}, sum = 0;
    for (int k = 0; k < 3; k++)
        u[k] = sim.Q[i][k] - sim.P[i][k];
    arris_unit(u);
    double e[3] = {fabs(u[0]) < 0.7, fabs(u[0]) >= 0.7, 0};
    arris_cross(u, e, a), arris_unit(a), arris_cross(u, a, b);
    for (int k = 0; k < 4; k++) {
        const double *t = k % 2 ? b : a, *at = k < 2 ? l->p : l->q;
        for (int c = 0; c < 3; c++)
            V[k][4] += t[c] * (at[c] - sim.P[i][c]);
        for (int m = 0; m < 4; m++)
            for (int c = 0; c < 3; c++)
                for (int d = 0; d < 3; d++) {
                    int x = k / 2 * 3 + c, y = m / 2 * 3 + d, lo = x < y ? x : y, hi = x + y - lo;
                    V[k][m] +=
                        t[c] * l->cov[lo * 6 - lo * (lo - 1) / 2 + hi - lo] * (m % 2 ? b : a)[d];
                }
    }
    double d[4] = {V[0][4], V[1][4], V[2][4], V[3][4]};
    for (int k = 0; k < 4; k++) {
        assert_true(V[k][k] > 0);
        for (int m = k + 1; m < 4; m++) {
            double f = V[m][k] / V[k][k];
            for (int c = k; c < 5; c++)
                V[m][c] -= f * V[k][c];
        }
    }
    for (int k = 3; k >= 0; k--) {
        for (int m = k + 1; m < 4; m++)
            V[k][4] -= V[k][m] * V[m][4];
        V[k][4] /= V[k][k];
        sum += V[k][4] * d[k];
    }
    return sum / 4;
}

/* Adds nees_of the lines that many frames saw, and how many these are. */
static inline void add_nees(const arris_lines *lines, double *nees, double *n) {
    for (uint32_t i = 0; i < lines->n; i++)
        if (i % 4 && lines->item[i].views > 20)
            *nees += nees_of(&lines->item[i], i), ++*n;
}

static inline void free_scan(record *r, arris_lines *lines, adjusted *result) {
    record_adjusted_free(result);
    record_free(r);
    free(lines->item);
}

#endif
