/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * fit.c: how well its views fit a line (fit.h).
 */
#include "fit.h"

#include <math.h>
#include <string.h>

static const double PRIOR_DOF = 10;   /* weight of all lines' variance against a line's own */
static const double CORRELATED = 0.9; /* of a line's residuals from view to view, at most */

/* The mean of t w(2 t) exp(-t). */
double adj_expected_share(const adj_problem *p) {
    double sum = 0, step = 0.01;
    for (double t = step / 2; t < 40; t += step)
        sum += t * adj_weight(p, 2 * t) * exp(-t) * step;
    return sum;
}

void adj_fit_add(adj_fit *f, const adj_problem *p, const adj_view *v, const double r[2],
                 double expected) {
    const adj_line *l = &p->line[v->line];
    double d2 = adj_distance(v, l, r), weight = adj_weight(p, d2);
    double offset = sqrt(weight) * (r[0] + r[1]);
    f->product += offset * f->before;
    f->square += offset * offset;
    f->before = offset;
    f->chi2 += weight * d2 * l->variance / expected;
    f->views++;
    f->agree += weight > 0.5;
    f->squares += weight * (r[0] * r[0] + r[1] * r[1]) / 2;
    f->weights += weight;
}

void adj_fits(const adj_problem *p, adj_fit *fits) {
    double r[2], expected = adj_expected_share(p);
    memset(fits, 0, p->n_lines * sizeof *fits);
    for (uint32_t i = 0; i < p->n_views; i++) {
        const adj_view *v = &p->view[i];
        const adj_pose *pose = &p->frame[v->frame].pose;
        if (!v->apart && adj_residual(p, v, pose, &p->line[v->line], r, NULL, NULL))
            adj_fit_add(&fits[v->line], p, v, r, expected);
    }
}

double adj_fit_rms(const adj_fit *f) {
    return f->weights > 0 ? sqrt(f->squares / f->weights) : 0;
}

double adj_fit_memory(const adj_fit *f) {
    double chance = 2 / sqrt(f->views + 1);
    double rho = f->square > 0 ? fmin(fmax(f->product / f->square - chance, 0), CORRELATED) : 0;
    return (1 + rho) / (1 - rho);
}

static double dof_of(const adj_fit *f, double share) {
    return fmax(2 * f->views * share - 4, 0);
}

double adj_usual_variance(const adj_fit *f, uint32_t n, double share) {
    double sum = 0, told = 0;
    for (uint32_t i = 0; i < n; i++) {
        double dof = dof_of(&f[i], share);
        if (dof < PRIOR_DOF)
            continue;
        sum += log(f[i].chi2 / dof + 1e-3);
        told++;
    }
    return told > 0 ? exp(sum / told) : 1;
}

double adj_fit_variance(const adj_fit *f, double share, double usual) {
    return (f->chi2 + PRIOR_DOF * usual) / (dof_of(f, share) + PRIOR_DOF);
}
