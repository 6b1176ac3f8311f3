/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * window_noise.c: the noise in the fixed lag (window_parts.h), as estimate.c has it for a whole
 * scan: what has left the window is summed up, what is in it is summed anew in every frame.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "window_parts.h"

static const double START = 1e-3; /* sigma of the poses till it is told: of the distance, and rad */
static const double LEAST = 1e-6; /* below which it is none; likewise */
static const double ENOUGH = 20;  /* degrees of freedom that tell it */
static const double FEW = 3;      /* of them, that say beforehand that there is none */
static const double POOLED = 20;  /* weight of all axes' variance against an axis' own */
static const double NOISE = 3;    /* sigmas from which a correlation is none by chance */
static const double VALUES = 2;   /* independent ones, of what no profile explains, in any views */
static const double CHANCE = 0.1; /* of misfit, that says nothing */
static const double FAR = 4;      /* sigmas from which a pose counts less */

/* ---- lines ----------------------------------------------------------------------------------- */

static void sum_views(const window *w, uint32_t place, adj_fit *sums) {
    double r[2];
    for (uint32_t i = 0; i < w->n_views[place]; i++) {
        const adj_view *v = &w->p.view[WINDOW_VIEWS * place + i];
        if (v->line >= w->p.n_lines ||
            !adj_residual(&w->p, v, &w->p.frame[place].pose, &w->p.line[v->line], r, NULL, NULL))
            continue;
        sums[v->line].misfit += (double)w->misfit[WINDOW_VIEWS * place + i];
        adj_fit_add(&sums[v->line], &w->p, v, r, w->expected);
    }
}

static void weigh_lines(window *w) {
    double views = 0;
    for (uint32_t i = 0; i < w->p.n_lines; i++)
        views += w->now[i].views;
    double share = 1 - w->redundancy / fmax(2 * views, w->redundancy + 1);
    double usual = adj_usual_variance(w->now, w->p.n_lines, share);
    for (uint32_t i = 0; i < w->p.n_lines; i++) {
        const adj_fit *f = &w->now[i];
        double misfit = fmax(f->misfit - CHANCE * f->views, 0);
        w->p.line[i].variance =
            fmax(adj_fit_variance(f, share, usual), 1) * (misfit / VALUES + adj_fit_memory(f));
    }
}

/* ---- poses ----------------------------------------------------------------------------------- */

/* How far the reported pose is off, in squared sigmas. */
static double distance(const window *w, uint32_t place) {
    double e[6], sum = 0;
    adj_error(&w->p, place, e, NULL, NULL);
    for (int k = 0; k < 6; k++)
        sum += e[k] * e[k] / (w->sigma[k] * w->sigma[k]);
    return sum;
}

/* By Geman and McClure. */
double window_pose_weight(const window *w, uint32_t place) {
    double t = 1 / (1 + distance(w, place) / (FAR * FAR * w->usual));
    return t * t;
}

static int by_size(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* The median distance, or what it is by the sigmas: as long as these are wrong, nobody is off. */
static double usual_distance(const window *w) {
    double d[WINDOW_FRAMES];
    for (uint32_t i = 0; i < w->n; i++)
        d[i] = distance(w, window_place(w, i));
    qsort(d, w->n, sizeof *d, by_size);
    return w->n > 0 ? fmax(d[w->n / 2], 6) : 6;
}

/* The i-th oldest frame alone, and with those before it. */
static void sum_pose(window *w, uint32_t i, pose_sums *o) {
    uint32_t place = window_place(w, i), at = w->time - w->n + 1 + i;
    double e[6], weight = window_pose_weight(w, place), *error = w->error[at % WINDOW_ERRORS];
    adj_error(&w->p, place, e, NULL, NULL);
    for (int k = 0; k < 6; k++) {
        double v = w->sigma[k] * w->sigma[k], r = w->redundant[place][k];
        o->squares[k] += weight * (e[k] * e[k] - v * r * (1 - r));
        o->dof[k] += weight * r * r;
        o->redundancy[k] += weight * r;
        error[k] = sqrt(weight) * e[k] / w->sigma[k];
    }
    for (uint32_t lag = 1; lag < WINDOW_LAGS && 4 * lag < at; lag++) {
        const double *before = w->error[(at - lag) % WINDOW_ERRORS];
        for (int k = 0; k < 6; k++) {
            o->product[lag] += error[k] * before[k];
            o->square[lag] += (error[k] * error[k] + before[k] * before[k]) / 2;
            o->n[lag]++;
        }
    }
}

/* As estimate.c has it. */
static double memory_of(const pose_sums *o) {
    double sum = 1;
    for (int lag = 1; lag < WINDOW_LAGS; lag++) {
        if (!(o->product[lag] > NOISE * o->square[lag] / sqrt(o->n[lag] + 1)))
            break;
        sum += 2 * o->product[lag] / o->square[lag];
    }
    return sum;
}

double window_late_memory(const window *w) {
    return (w->counted * w->memory + w->n) / (w->left + w->n);
}

/* Of squared errors e² = v² y², y the slope of what else is known, v r (1 - r) is the noise of y,
 * and r² v0 the poses', v0 their true variance: the sums' ratio is free of bias and goes to 0 where
 * there is none (after Förstner 1979, whose e² / r stays where it is then). All axes' counts as
 * some residuals of each: which of two it is that errs, a shift or the turn that looks like it, a
 * few lines do not tell. */
static void estimate_sigmas(window *w, const pose_sums *o) {
    double usual = 0, all = 0;
    for (int k = 0; k < 6; k++) {
        usual += o->squares[k] * (k < 3 ? 1 : w->distance * w->distance);
        all += o->dof[k];
    }
    for (int k = 0; all > 0 && k < 6; k++) {
        double unit = k < 3 ? 1 : 1 / w->distance;
        double sum = o->squares[k] + POOLED * usual / (all + FEW) * unit * unit;
        w->sigma[k] = fmax(sqrt(fmax(sum, 0) / (o->dof[k] + POOLED)), LEAST * w->distance * unit);
    }
}

static void weigh_poses(window *w) {
    pose_sums o = w->past_poses;
    for (uint32_t i = 0; i < w->n; i++)
        sum_pose(w, i, &o);
    w->redundancy = 0;
    for (int k = 0; k < 6; k++) {
        w->redundancy += o.redundancy[k];
        w->sigma[k] = START * (k < 3 ? w->distance : 1);
    }
    w->determined |= w->redundancy > ENOUGH;
    if (w->determined)
        estimate_sigmas(w, &o);
    w->memory = memory_of(&o);
    for (int k = 0; k < 6; k++) {
        double given = k < 3 ? w->params.pose_sigma : w->params.rot_sigma;
        w->sigma[k] = given > 0 ? given : w->sigma[k];
        w->p.sigma[k] = w->sigma[k] * sqrt(w->memory);
    }
}

void window_weigh(window *w) {
    memcpy(w->now, w->past, sizeof w->now);
    for (uint32_t i = 0; i < w->n; i++)
        sum_views(w, window_place(w, i), w->now);
    w->usual = usual_distance(w);
    weigh_poses(w);
    weigh_lines(w);
}

void window_sum_oldest(window *w) {
    sum_views(w, w->first, w->past);
    sum_pose(w, 0, &w->past_poses);
    w->counted += 1 / w->memory;
    w->left++;
}
