/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * estimate.c: the noise along with the rest (adjust.h). Each component's variance becomes what its
 * residuals sum to over their redundancy, until nothing changes; that is the maximum of the
 * likelihood of what was seen, with the lines and poses integrated out.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit.h"
#include "work.h"

enum { ROUNDS = 19, STEPS = 20, FEWER = 4 };
/* Rounds until lines have their own variance; until they have a memory, and are told from others;
 * and until that is what it is, and the variance of the poses is estimated. Until then poses are as
 * loose as a robot's, or as they were found to be: what they do not take up is the lines' own. Else
 * a line could take the poses' errors for its own, weigh little for that, and leave them as they
 * are; and with poses that are free, where edges are poor, lines leave theirs to the poses. */
enum { ALIKE = 3, APART = 5, TIED = 8 };
static const double STILL = 0.03;            /* relative change of a sigma that is none */
static const double COARSE = 0.1;            /* of chi-square, while the noise is not known */
static const double FINE = 1e-9;             /* at the end */
static const double START[2] = {4e-4, 3e-4}; /* sigma of the poses: of the distance, and rad */
static const double LEAST[2] = {1e-6, 1e-6}; /* below which it is none; likewise */
static const double FITTED = 2;              /* numbers of an axis that the scan's place takes */
static const double NOISE = 3;               /* sigmas from which a correlation is none by chance */
static const double ENOUGH = 3;              /* degrees of freedom that tell a sigma */
static const double INDEPENDENT = 2.3;       /* values at most, of what no profile explains */
static const double FAR = 7;                 /* robust sigmas from which a pose is an outlier */
enum { FEW = 10 };                           /* frames that do not tell what an outlier is */

/* ---- segments -------------------------------------------------------------------------------- */

/* Sets the lines' variances, the whole scan's counting as a few residuals of each; `share` is that
 * of the residuals which the poses leave; `fits` has room for all lines. */
static void weigh_lines(adj_problem *p, double share, int round, adj_fit *fits) {
    adj_fits(p, fits);
    double usual = adj_usual_variance(fits, p->n_lines, share);
    for (uint32_t i = 0; i < p->n_lines; i++) {
        double own = adj_fit_variance(&fits[i], share, usual);
        p->line[i].variance = fmax(round < ALIKE ? usual : own, 1);
        p->line[i].memory = round < APART ? 1 : adj_fit_memory(&fits[i]);
    }
}

/* ---- poses ----------------------------------------------------------------------------------- */

/* Of one axis, summed over the frames, in sigmas. */
typedef struct component {
    double squares, redundancy;
} component;

static void sum_components(const adj_problem *p, const adj_work *w, component c[6]) {
    double e[6], v[6];
    memset(c, 0, 6 * sizeof *c);
    for (uint32_t i = 0; i < p->n_frames; i++) {
        if (p->frame[i].outlier)
            continue;
        adj_error(p, i, e, NULL, NULL);
        adj_error_variance(w, p, i, v);
        for (int k = 0; k < 6; k++) {
            double t = adj_precision(p, k, i);
            c[k].squares += t * e[k] * e[k];
            c[k].redundancy += 1 - t * v[k];
        }
    }
}

/* How many successive frames count as one, since the poses' errors hang together: 1 plus twice the
 * sum of their autocorrelation, as far as that is above the noise (Geyer 1992). */
static double memory_of(const adj_problem *p) {
    double sum = 1, e[6], later[6];
    for (uint32_t lag = 1; 4 * lag < p->n_frames; lag++) {
        double product = 0, square = 0, n = 0;
        for (uint32_t i = 0; i + lag < p->n_frames; i++) {
            if (p->frame[i].outlier || p->frame[i + lag].outlier)
                continue;
            adj_error(p, i, e, NULL, NULL);
            adj_error(p, i + lag, later, NULL, NULL);
            for (int k = 0; k < 6; k++) {
                double t = adj_precision(p, k, i);
                product += t * e[k] * later[k];
                square += t * (e[k] * e[k] + later[k] * later[k]) / 2;
                n++;
            }
        }
        if (!(product > NOISE * square / sqrt(n + 1)))
            break;
        sum += 2 * product / square;
    }
    return sum / fmax(1 - FITTED * sum / p->n_frames, 0.5);
}

/* The variance of the three axes from `first` on taken together, as far as they tell one. */
static double usual_variance(const adj_problem *p, const component c[6], int first) {
    double squares = 0, redundancy = 0;
    for (int k = first; k < first + 3; k++) {
        squares += fmax(c[k].squares, 0) * p->sigma[k] * p->sigma[k];
        redundancy += fmax(c[k].redundancy, 0);
    }
    return redundancy > ENOUGH ? squares / redundancy : p->sigma[first] * p->sigma[first];
}

/* What the residuals do not tell of an axis, its neighbours tell. Returns the greatest relative
 * change. */
static double update_sigmas(adj_problem *p, const component c[6], const bool known[6],
                            double distance, bool determined[6]) {
    double most = 0, usual[2] = {usual_variance(p, c, 0), usual_variance(p, c, 3)};
    for (int k = 0; k < 6; k++) {
        double was = p->sigma[k], least = LEAST[k / 3] * (k < 3 ? distance : 1);
        double told = fmax(c[k].redundancy, 0), lacking = fmax(ENOUGH - told, 0);
        determined[k] = known[k] || lacking == 0;
        if (known[k])
            continue;
        double v = (c[k].squares * was * was + lacking * usual[k / 3]) / (told + lacking);
        double share = fmin(fmax(v / (was * was), 0.1), 10);
        p->sigma[k] = fmax(was * sqrt(share), least);
        most = fmax(most, fabs(p->sigma[k] / was - 1));
    }
    return most;
}

static int by_size(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Whether a frame became an outlier, or is none any more. */
static bool find_outliers(adj_problem *p, double distance, double *scratch, adj_quality *q) {
    uint32_t n = p->n_frames, found = 0;
    bool changed = false;
    double limit[6], e[6];
    if (n < FEW)
        return false;
    for (int k = 0; k < 6; k++) {
        for (uint32_t i = 0; i < n; i++) {
            adj_error(p, i, e, NULL, NULL);
            scratch[i] = fabs(e[k]);
        }
        qsort(scratch, n, sizeof *scratch, by_size);
        double least = 10 * LEAST[k / 3] * (k < 3 ? distance : 1);
        limit[k] = FAR * fmax(1.4826 * scratch[n / 2], least);
    }
    for (uint32_t i = 0; i < n; i++) {
        bool far = false;
        adj_error(p, i, e, NULL, NULL);
        for (int k = 0; k < 6; k++)
            far |= fabs(e[k]) > limit[k];
        changed |= far != p->frame[i].outlier;
        p->frame[i].outlier = far;
        found += far;
    }
    q->outliers = found;
    return changed;
}

/* ---- all of it ------------------------------------------------------------------------------- */

static double median_distance(const adj_problem *p, double *scratch) {
    for (uint32_t i = 0; i < p->n_lines; i++)
        scratch[i] = 3 * p->line[i].hold;
    qsort(scratch, p->n_lines, sizeof *scratch, by_size);
    return p->n_lines ? scratch[p->n_lines / 2] : 1;
}

static void begin(adj_problem *p, double distance, const adj_quality *q, bool known[6]) {
    for (int k = 0; k < 6; k++) {
        known[k] = p->sigma[k] > 0;
        if (!known[k])
            p->sigma[k] = fmax(START[k / 3] * (k < 3 ? distance : 1), q->sigma[k]);
    }
}

/* Upper tail of chi-square (Wilson and Hilferty 1931). */
static double tail(double chi2, double dof) {
    double v = 2 / (9 * dof), z = (cbrt(chi2 / dof) - (1 - v)) / sqrt(v);
    return dof > 0 ? erfc(z / sqrt(2)) / 2 : 1;
}

static void judge(const adj_problem *p, const adj_fit *fits, double poses, adj_quality *q) {
    double views = 0, centre[3], cov[49];
    q->chi2 = 0;
    for (uint32_t i = 0; i < p->n_lines; i++) {
        q->chi2 += fits[i].chi2;
        views += fits[i].views;
    }
    q->dof = fmax(2 * views - 4.0 * p->n_lines - poses, 0);
    q->factor = q->dof > 0 ? sqrt(q->chi2 / q->dof) : 1;
    q->significance = tail(q->chi2, q->dof);
    q->scale_sigma = adj_gauge(p, centre, cov) ? sqrt(cov[48]) : (double)INFINITY;
}

static double told_of_poses(const component c[6]) {
    double sum = 0;
    for (int k = 0; k < 6; k++)
        sum += c[k].redundancy;
    return fmax(sum, 0);
}

/* What hangs together tells less than its number: of the poses, and of each line's views, as far as
 * no profile explained them. */
static void discount(adj_problem *p, const adj_fit *fits, double memory) {
    for (int k = 0; k < 6; k++)
        p->sigma[k] *= sqrt(memory);
    for (uint32_t i = 0; i < p->n_lines; i++) {
        adj_line *l = &p->line[i];
        l->memory = fmax(fmax(l->memory, adj_fit_memory(&fits[i])), 1 + l->misfit / INDEPENDENT);
    }
}

/* The middle one of the lines' variances. */
static double usual_line(const adj_problem *p, double *scratch) {
    for (uint32_t i = 0; i < p->n_lines; i++)
        scratch[i] = p->line[i].variance;
    qsort(scratch, p->n_lines, sizeof *scratch, by_size);
    return p->n_lines ? scratch[p->n_lines / 2] : 1;
}

static int estimate(adj_problem *p, adj_work *w, adj_quality *q, double *scratch, adj_fit *fits) {
    bool known[6], changed = true, again = q->rounds > 0;
    component c[6];
    double poses = 0, most = 1, distance = median_distance(p, scratch);
    int rc = 0, first = again ? ALIKE : 0;
    begin(p, distance, q, known);
    q->rounds = 0;
    for (int i = first; rc >= 0 && i < ROUNDS && (i <= TIED || most > STILL || changed);
         i++, q->rounds++) {
        double share = 1 - poses / fmax(2.0 * p->n_views, poses + 1);
        rc = adj_work_plan(w, p);
        if (rc < 0)
            break;
        if (i >= APART)
            adj_agree(p, &w->system, usual_line(p, scratch));
        if (i <= TIED)
            weigh_lines(p, share, i, fits);
        rc = adj_minimise(p, w, i < APART ? STEPS : FEWER, COARSE);
        changed = rc >= 0 && find_outliers(p, distance, scratch, q);
        if (rc < 0 || i + 1 < APART)
            continue;
        rc = adj_marginals(p, w);
        if (rc < 0)
            break;
        sum_components(p, w, c);
        if (i == TIED && again)
            memcpy(p->sigma, q->sigma, sizeof p->sigma);
        else if (i >= TIED)
            most = update_sigmas(p, c, known, distance, q->determined);
        poses = told_of_poses(c);
    }
    rc = rc < 0 ? rc : adj_minimise(p, w, STEPS, FINE);
    if (rc < 0)
        return rc;
    memcpy(q->sigma, p->sigma, sizeof q->sigma);
    q->memory = memory_of(p);
    adj_fits(p, fits);
    discount(p, fits, q->memory);
    rc = adj_marginals(p, w);
    judge(p, fits, poses, q);
    return rc;
}

int adj_estimate(adj_problem *p, adj_work *w, adj_quality *q) {
    size_t n = p->n_frames > p->n_lines ? p->n_frames : p->n_lines;
    double *scratch = malloc((n + 1) * sizeof *scratch);
    adj_fit *fits = malloc((n + 1) * sizeof *fits);
    int rc = scratch && fits ? estimate(p, w, q, scratch, fits) : ARRIS_E_MEMORY;
    free(scratch);
    free(fits);
    return rc;
}
