/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * agree.c: whether a line's views agree (adjust.h). What was followed as one edge may have become
 * another one on the way; a fit to both lies between them, and every view is a little off. So the
 * line is fitted to the views of a part of the scan, and to those that agree with it, and the one
 * is taken that most views agree with (Rousseeuw 1984, with stretches in place of random samples).
 */
#include <math.h>
#include <string.h>

#include "invert.h"
#include "work.h"

enum { STRETCHES = 5, LEAST = 12, STEPS = 6 }; /* of a line's views; of a fit */
static const double LENGTH = 1 / 3.0;          /* of a stretch, of the views */
static const double AGREES = 9;                /* squared sigmas */
static const double APART = 25;                /* likewise, of a view that is none of the line's */
static const double HALF = 0.5;                /* of the views, at least, agree */
static const double ENOUGH = 0.95;             /* of the views, that need no other fit */

/* Solves the normal equations of a line, N x = b, which its hold makes positive definite. */
static void solve(double N[4][5], double x[4]) {
    bool solved = invert(&N[0][0], 4, 5);
    for (int i = 0; i < 4; i++) {
        x[i] = 0;
        for (int j = 0; solved && j < 4; j++)
            x[i] += N[i][j] * N[j][4];
    }
}

/* Adds what a view says of a step of x. */
static void add(const adj_view *v, const double r[2], double J[2][4], double N[4][5]) {
    double c = v->cov[1] / v->cov[0], a = 1 / sqrt(v->cov[0]);
    double b = 1 / sqrt(v->cov[2] - c * v->cov[1]), row[2][5];
    for (int i = 0; i < 5; i++) {
        double first = i < 4 ? J[0][i] : -r[0], second = i < 4 ? J[1][i] : -r[1];
        row[0][i] = a * first;
        row[1][i] = b * (second - c * first);
    }
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 5; j++)
            N[i][j] += row[0][i] * row[0][j] + row[1][i] * row[1][j];
}

/* A step of the line to the views from..to, those of them that agree with it when `chosen`. Returns
 * how many of all agree with it before the step. */
static uint32_t fit_step(const adj_problem *p, const adj_system *s, uint32_t line, adj_line *l,
                         uint32_t from, uint32_t to, bool chosen) {
    double N[4][5] = {{0}}, r[2], J[2][4], step[4];
    uint32_t agree = 0;
    for (uint32_t k = s->first[line]; k < s->first[line + 1]; k++) {
        const adj_view *v = &p->view[s->order[k]];
        if (!adj_residual(p, v, &p->frame[v->frame].pose, l, r, NULL, J))
            continue;
        bool agrees = adj_distance(v, l, r) < AGREES;
        agree += agrees;
        if (chosen ? agrees : k >= from && k < to)
            add(v, r, J, N);
    }
    for (int i = 0; i < 4; i++) {
        N[i][i] += 1 / (l->hold * l->hold);
        N[i][4] -= l->x[i] / (l->hold * l->hold);
    }
    solve(N, step);
    for (int i = 0; i < 4; i++)
        l->x[i] += step[i];
    return agree;
}

/* Sets the line to `best`, and the views apart that do not agree with it; unless one is behind it.
 */
static void settle(adj_problem *p, const adj_system *s, uint32_t line, const adj_line *best) {
    const uint32_t *view = s->order + s->first[line], n = s->first[line + 1] - s->first[line];
    double r[2];
    for (uint32_t k = 0; k < n; k++) {
        const adj_view *v = &p->view[view[k]];
        if (!adj_residual(p, v, &p->frame[v->frame].pose, best, r, NULL, NULL))
            return;
    }
    for (uint32_t k = 0; k < n; k++) {
        adj_view *v = &p->view[view[k]];
        adj_residual(p, v, &p->frame[v->frame].pose, best, r, NULL, NULL);
        v->apart = adj_distance(v, best, r) > APART;
    }
    memcpy(p->line[line].x, best->x, sizeof best->x);
}

/* Looks for a better fit in stretches of the views. */
static void settle_line(adj_problem *p, const adj_system *s, uint32_t line, double variance) {
    uint32_t first = s->first[line], n = s->first[line + 1] - first;
    uint32_t length = (uint32_t)(LENGTH * n);
    adj_line best = p->line[line];
    best.variance = variance;
    adj_line now = best;
    uint32_t were = fit_step(p, s, line, &now, 0, 0, true), most = were;
    for (int w = 0; w < STRETCHES && were < ENOUGH * n; w++) {
        uint32_t from = first + (n - length) * (uint32_t)w / (STRETCHES - 1);
        now = p->line[line], now.variance = variance;
        for (int k = 0; k < STEPS; k++) {
            adj_line before = now;
            uint32_t agree = fit_step(p, s, line, &now, from, from + length, 2 * k >= STEPS);
            if (agree > most)
                most = agree, best = before;
        }
    }
    if (most > HALF * n)
        settle(p, s, line, &best);
}

void adj_agree(adj_problem *p, const adj_system *s, double variance) {
    for (uint32_t i = 0; i < p->n_lines; i++)
        if (s->first[i + 1] - s->first[i] >= LEAST)
            settle_line(p, s, i, variance);
}
