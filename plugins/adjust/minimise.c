/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * minimise.c: Levenberg and Marquardt's way to the least cost (adjust.h).
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "work.h"

static const double DAMPING = 1e-6, LEAST = 1e-12, MOST = 1e8; /* Marquardt's, at the start */
static const double STEADY = 1e-3; /* with less of it, a step that gains nothing is the last */
static const double MISSED = 1e-3; /* of what a step takes off the cost, by not solving exactly */
enum { TURNS = 12, WORN = 6 }; /* of conjugate gradients, at most; and after which, by what they */
                               /* cost, the factor is the next time made anew */

adj_work *adj_work_new(const adj_problem *p, const adj_backend *backend) {
    adj_work *w = calloc(1, sizeof *w);
    size_t rows = 6 * (size_t)p->max_frames + 4 * (size_t)p->max_lines + ADJ_COMMON;
    if (!w)
        return NULL;
    w->backend = backend;
    w->solver = backend->create();
    w->step = malloc(rows * sizeof *w->step);
    w->scratch = malloc(ADJ_CONJUGATE * rows * sizeof *w->scratch);
    w->place = malloc(rows * sizeof *w->place);
    w->poses = malloc((p->max_frames + (size_t)1) * sizeof *w->poses);
    w->lines = malloc((p->max_lines + (size_t)1) * sizeof *w->lines);
    if (adj_system_init(&w->system, p) || !w->solver || !w->step || !w->scratch || !w->place ||
        !w->poses || !w->lines) {
        adj_work_free(w);
        return NULL;
    }
    return w;
}

void adj_work_free(adj_work *w) {
    if (!w)
        return;
    adj_system_free(&w->system);
    w->backend->free(w->solver);
    free(w->step);
    free(w->scratch);
    free(w->place);
    free(w->poses);
    free(w->lines);
    free(w->inverse);
    free(w);
}

static void save(const adj_problem *p, adj_work *w) {
    for (uint32_t i = 0; i < p->n_frames; i++)
        w->poses[i] = p->frame[i].pose;
    for (uint32_t i = 0; i < p->n_lines; i++)
        memcpy(w->lines[i], p->line[i].x, sizeof *w->lines);
    memcpy(w->state, p->state, sizeof w->state);
}

static void restore(adj_problem *p, const adj_work *w) {
    for (uint32_t i = 0; i < p->n_frames; i++)
        p->frame[i].pose = w->poses[i];
    for (uint32_t i = 0; i < p->n_lines; i++)
        memcpy(p->line[i].x, w->lines[i], sizeof *w->lines);
    memcpy(p->state, w->state, sizeof w->state);
}

int adj_work_plan(adj_work *w, const adj_problem *p) {
    int rc = w->planned ? 0 : adj_system_plan(&w->system, p);
    if (rc == 0 && !w->planned)
        rc = w->backend->analyse(w->solver, &w->system.S);
    w->planned = rc == 0;
    return rc;
}

int adj_work_factor(adj_work *w) {
    int rc = w->backend->factor(w->solver, &w->system.S, &w->factor);
    w->factored = rc == 0;
    return rc;
}

/* Solves what was filled: by the factor of an earlier one, as long as it is near. It mostly is,
 * when only the robust weights change, and a factor costs as much as many solutions by it. */
static int solve(adj_work *w) {
    adj_system *s = &w->system;
    int turns = w->factored
                    ? adj_conjugate(&s->S, &w->factor, s->rhs, w->step, TURNS, MISSED, w->scratch)
                    : 0;
    w->factored = turns <= WORN;
    if (turns > 0)
        return 0;
    int rc = adj_work_factor(w);
    if (rc == 0)
        adj_factor_solve(&w->factor, s->rhs, w->step, w->scratch);
    return rc;
}

int adj_minimise(adj_problem *p, adj_work *w, int rounds, double least) {
    double cost = adj_cost(p), damping = DAMPING;
    int steps = 0, rc = adj_work_plan(w, p);
    if (rc)
        return rc;
    for (int i = 0; i < rounds && damping < MOST; i++) {
        if (!isfinite(cost) || !adj_system_fill(&w->system, p, damping))
            return ARRIS_E_INPUT;
        save(p, w);
        rc = solve(w);
        if (rc == ARRIS_E_MEMORY)
            return rc;
        if (rc == 0)
            adj_system_move(&w->system, p, w->step);
        double now = rc ? (double)INFINITY : adj_cost(p);
        if (!(now <= cost)) {
            restore(p, w);
            damping *= 100;
            if (!rc && w->system.predicted < least)
                break; /* what is left is rounding */
            continue;
        }
        steps++;
        damping = fmax(damping / 10, LEAST);
        double gain = cost - now;
        cost = now;
        if (gain < least && damping < STEADY)
            break;
    }
    return steps;
}
