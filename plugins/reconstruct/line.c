/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * line.c: the running estimate of one 3D line (line.h).
 */
#include "line.h"

#include "memory.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double GATE = 14;           /* chi-square of 2 degrees of freedom: one in a thousand */
static const double FAR = 3;             /* px: a segment so far off is another edge's */
static const double MOVED = 1;           /* squared sigmas after which all is linearised anew */
static const double STANDS = 1e-4;       /* a step of fewer squared sigmas is the last one; */
static const double RUNS = 1e-2;         /* likewise, as long as views come */
static const double PRIOR_DOF = 10;      /* weight of the scene's scale against the line's own */
static const double SURROUNDINGS = 0.12; /* rad that the view turns until they look otherwise */
static const double INDEPENDENT = 2.3;   /* values of what is systematic, at most */
static const double EVIDENT = 1.5; /* times the usual, of a drift that is no chance: 1 in 15 is */
static const double LITTLE = 1e-3; /* of the variance: more than rounding */
enum { ITERATIONS = 10 };

void line_begin(line *l, int32_t id) {
    memset(l, 0, offsetof(line, kept));
    l->id = id;
    l->stride = 1;
    l->next_fit = 2;
}

/* ---- information ---------------------------------------------------------------------------- */

double line_chi2(const line *l) {
    return info_chi2(&l->all, l->x);
}

/* The variance of the residuals over the stated one; the scene's own counts as a few views. */
static double residual_scale(const line *l, const scene *s) {
    double dof = fmax(2 * l->all.weight - 4, 0);
    return (line_chi2(l) + PRIOR_DOF * s->scale) / (dof + PRIOR_DOF);
}

/* The inverse of H / scale + 1 / prior². */
static mat4 covariance(const line *l, double scale, double prior) {
    mat4 A = l->all.H, P = {{{0}}};
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++)
            A.m[i][j] /= scale;
        A.m[i][i] += 1 / (prior * prior);
    }
    if (!mat4_invert(&A, &P)) /* by rounding only: then let nothing be known */
        for (int i = 0; i < 4; i++)
            P.m[i][i] = prior * prior;
    return P;
}

double line_rest_weight(const line *l, const scene *s) {
    double n[3] = {l->kept[0].plane[0], l->kept[0].plane[1], l->kept[0].plane[2]}, across = 0;
    if (s->rest <= 0)
        return 1;
    arris_unit(n);
    for (int i = 0; i < 3; i++)
        across += n[i] * arris_dot(s->S + 3 * i, n);
    return s->rest * s->noise.position * s->noise.position / across;
}

/* Finds what the views share; nothing, once their poses are corrected. */
static void find_shared(line *l, const scene *s) {
    double scale = residual_scale(l, s);
    l->shared = l->known = 0;
    l->common = (mat4){{{0}}};
    if (s->rest > 0)
        return;
    if (!s->memories.known) {
        l->shared = scale * (s->memory - 1);
        return;
    }
    mat4 C = covariance(l, 1, l->prior);
    l->common = memory_covariance(&s->memories, l, s, scale, &C, &l->shared);
    l->known = scale + l->shared;
}

/* The variance of the estimate over the stated one, but for what is known: by the size of the
 * residuals and how they hang together, and since what the profile leaves unexplained is
 * systematic: it stays the same until the edge's surroundings look otherwise, so it is but few
 * independent values in any number of views. */
static double excess(const line *l, const scene *s) {
    double turn = (l->swing[1] - l->swing[0]) / SURROUNDINGS;
    double values = fmin(fmax(turn, 1), INDEPENDENT);
    double blend = l->blend * l->all.n / values;
    double usual = residual_scale(l, s) * (1 + fmax(l->all.misfit, 0) / values) + l->shared + blend;
    return fmax((l->drift > EVIDENT * usual ? l->drift : usual) - l->known, LITTLE);
}

mat4 line_covariance(const line *l, const scene *s, double prior, const double place[2]) {
    mat4 P = covariance(l, excess(l, s), prior), out = {{{0}}};
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++)
            P.m[i][j] += l->common.m[i][j];
    double w[2][2] = {{(1 - place[0]) / 2, (1 + place[0]) / 2},
                      {(1 - place[1]) / 2, (1 + place[1]) / 2}};
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++)
            for (int k = 0; k < 2; k++)
                for (int n = 0; n < 2; n++)
                    out.m[i][j] += w[i / 2][k] * w[j / 2][n] * P.m[2 * k + i % 2][2 * n + j % 2];
    return out;
}

/* One step to the least squares; returns its squared length in sigmas. */
static double step(line *l, const scene *s) {
    double rest[4], d[4];
    l->cov = covariance(l, 1, l->prior);
    info_slope(&l->all, l->x, rest);
    for (int i = 0; i < 4; i++)
        rest[i] -= l->x[i] / (l->prior * l->prior);
    mat4_times(&l->cov, rest, d);
    for (int i = 0; i < 4; i++)
        l->x[i] += d[i];
    l->scale = fmax(residual_scale(l, s), 1);
    return mat4_form(&l->all.H, d, d);
}

/* ---- fitting -------------------------------------------------------------------------------- */

/* Whether a view agrees with the estimate that is so far from it: squared sigmas, and px at both
 * ends. */
static bool agrees(const line *l, double distance, double r0, double r1) {
    return distance < GATE * l->scale && fabs(r0) < FAR && fabs(r1) < FAR;
}

info line_past(const line *l, const scene *s) {
    info sum = {0};
    for (uint32_t i = 0; i < l->n_kept && l->stride > 1; i++)
        if (l->rest[i].n > 0)
            info_sum(&sum, &l->rest[i]);
    info_weigh(&sum, line_rest_weight(l, s));
    return sum;
}

/* Sums past and kept views, linearised about l->x. */
static void gather(line *l, const scene *s, const info *past) {
    linears r;
    l->all = *past;
    for (uint32_t i = 0; i < l->n_kept; i += VIEWS) {
        uint32_t n = l->n_kept - i < VIEWS ? l->n_kept - i : VIEWS;
        bool take[VIEWS] = {false};
        views_linearise(&l->kept[i], n, 1, &l->f, l->x, &s->noise, &r);
        for (uint32_t k = 0; k < n; k++) {
            take[k] = agrees(l, r.distance[k], r.r[0][k], r.r[1][k]);
            l->inlier[i + k] = take[k];
            l->depth = take[k] ? r.depth[k] : l->depth;
        }
        info_add_views(&l->all, &r, take, l->x);
    }
    memcpy(l->at, l->x, sizeof l->at);
}

/* Repeats Gauss-Newton until a step is shorter than `stands` squared sigmas. */
static void refine(line *l, const scene *s, double stands) {
    double moved = (double)INFINITY;
    info past = line_past(l, s);
    if (past.n == 0)
        line_reframe(l);
    for (int i = 0; i < ITERATIONS && moved > stands; i++) {
        gather(l, s, &past);
        moved = step(l, s);
    }
    if (past.n == 0)
        line_measure_motion(l);
    l->settled = l->settled && 2 * (l->all.n - past.n) > l->n_kept;
}

void line_refine(line *l, const scene *s) {
    refine(l, s, STANDS);
}

static void survey(line *l, const scene *s) {
    info group[LINE_KEPT];
    mat4 C;
    line_trim(l);
    l->drift = 0;
    if (l->settled) {
        find_shared(l, s);
        line_groups(l, s, group);
        l->drift = line_disagreement(group, l->n_kept, l->scale + l->shared, &C);
    }
    l->next_survey = l->seen + 1 + l->seen / 8;
}

void line_weigh(line *l, const scene *s) {
    info past = line_past(l, s);
    gather(l, s, &past);
    l->scale = fmax(residual_scale(l, s), 1);
    survey(l, s);
}

void line_forget(line *l, uint32_t from, uint32_t to) {
    uint32_t n = l->n_kept - to;
    memmove(l->kept + from, l->kept + to, n * sizeof *l->kept);
    memmove(l->inlier + from, l->inlier + to, n * sizeof *l->inlier);
    memmove(l->rest + from, l->rest + to, n * sizeof *l->rest);
    l->n_kept = from + n;
    l->seen = l->n_kept * l->stride;
}

void line_resume(line *l, const scene *s, const double x[4]) {
    l->rejected = 0;
    if (l->n_kept == 0 || !x || line_past(l, s).n == 0) {
        line_fit(l, s);
        return;
    }
    memcpy(l->x, x, sizeof l->x);
    line_refine(l, s);
    line_measure_motion(l);
    l->settled = l->settled && line_observable(l);
    survey(l, s);
}

/* Refines the estimate from l->f on. */
static void fit_from_start(line *l, const scene *s) {
    if (l->stride > 1)
        memset(l->rest, 0, l->n_kept * sizeof *l->rest);
    memset(l->x, 0, sizeof l->x);
    l->ends[0] = -1, l->ends[1] = 1;
    refine(l, s, RUNS);
}

/* Fits the line where nothing but a start is known. False when it is not observable. */
static bool fit_anew(line *l, const scene *s) {
    if (!line_may_be_observable(l, s) || !line_start(l, s))
        return false;
    fit_from_start(l, s);
    if (!line_observable(l))
        return false;
    line_trim(l); /* the start may be far off */
    refine(l, s, RUNS);
    return line_observable(l);
}

void line_fit(line *l, const scene *s) {
    bool observable = fit_anew(l, s);
    l->settled = observable && 2 * l->all.n > l->n_kept;
    if (!observable) {
        line_guess(l, s);
        fit_from_start(l, s);
    }
    survey(l, s);
    l->rejected = 0;
    l->next_fit = l->seen + 1 + l->seen / 2;
}

/* Drops every second kept view. */
static void thin(line *l, const scene *s) {
    linear r;
    for (uint32_t i = 0; i < l->n_kept; i += 2) {
        uint32_t k = i + 1, to = i / 2;
        if (k < l->n_kept) {
            info_sum(&l->rest[i], &l->rest[k]);
            if (l->settled && l->inlier[k] &&
                view_linearise(&l->kept[k], &l->f, l->x, &s->noise, &r))
                info_add(&l->rest[i], &r, l->x);
        }
        l->rest[to] = l->rest[i];
        l->kept[to] = l->kept[i];
        l->inlier[to] = l->inlier[i];
    }
    l->n_kept = (l->n_kept + 1) / 2;
    l->stride *= 2;
}

/* Keeps the view when its turn is; its place among the kept, or -1. */
static int keep(line *l, const view *v, const scene *s) {
    if (l->seen++ % l->stride != 0)
        return -1;
    if (l->n_kept == LINE_KEPT)
        thin(l, s);
    l->inlier[l->n_kept] = false;
    l->rest[l->n_kept] = (info){0};
    l->kept[l->n_kept] = *v;
    return (int)l->n_kept++;
}

/* Adds a view to a settled line. */
static bool update(line *l, const view *v, int kept, const scene *s, linear *r) {
    if (!view_linearise(v, &l->f, l->x, &s->noise, r) ||
        !agrees(l, linear_distance(r, &l->cov), r->r[0], r->r[1])) {
        l->rejected++;
        l->settled = 2 * l->rejected < l->seen;
        return false;
    }
    info_add(&l->all, r, l->x);
    if (kept >= 0)
        l->inlier[kept] = true;
    else
        info_add(&l->rest[l->n_kept - 1], r, l->x);
    l->depth = r->depth;
    step(l, s);
    line_widen(l, v->C);
    double d[4];
    for (int i = 0; i < 4; i++)
        d[i] = l->x[i] - l->at[i];
    if (mat4_form(&l->all.H, d, d) > MOVED * l->scale)
        refine(l, s, RUNS);
    return true;
}

/* The estimate alone may be wrong about it; the last view alone, where one looks along the line. */
void line_align(const line *l, view *v) {
    double s[2];
    if (!l->settled || arris_dot(v->step, l->kept[l->n_kept - 1].step) >= 0)
        return;
    view_ends(v, &l->f, l->x, s);
    if (s[1] < s[0])
        view_turn(v);
}

bool line_add(line *l, const view *v, const scene *s, linear *r) {
    int kept = keep(l, v, s);
    bool taken = l->settled && update(l, v, kept, s, r);
    if (!l->settled && l->seen >= l->next_fit)
        line_fit(l, s);
    if (l->settled && l->seen >= l->next_survey) {
        refine(l, s, RUNS);
        survey(l, s);
    }
    return taken;
}

void line_complete(line *l, const scene *s) {
    if (l->settled)
        line_refine(l, s);
    if (l->settled)
        survey(l, s);
    else if (l->n_kept > 0)
        line_fit(l, s);
}

void line_absorb(line *a, const line *b, const scene *s) {
    linear r;
    a->next_fit = a->next_survey = UINT32_MAX; /* once is enough */
    scene reported = *s; /* what is not kept counts as the poses were reported */
    reported.noise.corrected = false;
    for (uint32_t i = 0; i < b->n_kept; i++) {
        view v = b->kept[i];
        line_align(a, &v);
        line_add(a, &v, &reported, &r);
    }
    a->next_fit = a->seen;
    line_complete(a, s);
}
