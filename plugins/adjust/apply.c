/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * apply.c: from a record and its lines to the problem, and back from its solution (record.h).
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit.h"
#include "record.h"
#include "tell.h"

enum { VIEWS = 3 };               /* of a line, at least */
static const double HOLD = 0.3;   /* of its distance, that a line may be off */
static const double SHORT = 1e-3; /* mm: shorter is no line */
static const double APART = 1;    /* px: nearer, it takes good poses to tell lines apart */
static const double LESS = 9;     /* times its variance before, and a line is weak */
static const double STRAY = 0.5;  /* of a frame's segments off their lines: it is an outlier */

/* The distance of the line from the middle camera, mm. */
static double distance_of(const record *r, const arris_line *l) {
    const double *C = r->frame[r->n_frames / 2].pose.C;
    double d[3];
    for (int i = 0; i < 3; i++)
        d[i] = (l->p[i] + l->q[i]) / 2 - C[i];
    return sqrt(arris_dot(d, d));
}

static bool usable(const arris_line *l, uint32_t views) {
    double d[3] = {l->q[0] - l->p[0], l->q[1] - l->p[1], l->q[2] - l->p[2]};
    double length = sqrt(arris_dot(d, d)), at = arris_dot(l->p, l->p) + arris_dot(l->q, l->q);
    return views >= VIEWS && length > SHORT && isfinite(length + at) && l->change != ARRIS_MERGED &&
           l->change != ARRIS_RETIRED;
}

/* place[i] becomes the problem's line for lines->item[i], or -1. */
static void add_lines(adj_problem *p, const record *r, const arris_lines *lines, int64_t *place) {
    for (uint32_t i = 0; i < lines->n; i++)
        place[i] = 0;
    for (uint32_t i = 0; i < r->n; i++)
        if (r->item[i].line >= 0)
            place[r->item[i].line]++;
    for (uint32_t i = 0; i < lines->n; i++) {
        const arris_line *l = &lines->item[i];
        place[i] = usable(l, (uint32_t)place[i])
                       ? adj_add_line(p, l->p, l->q, fmax(HOLD * distance_of(r, l), SHORT))
                       : -1;
    }
}

/* The sighting moved to where its edge alone would be; returns the share of its variance that is
 * the same in many views. */
static double moved(const sighting *o, const beside_move *m, arris_segment *s) {
    double dx = o->x2 - o->x1, dy = o->y2 - o->y1, px = m->px / hypot(dx, dy);
    double misfit = o->chi2 > 0 ? 1 - 1 / (double)o->chi2 : 0, own = (double)o->cov[0];
    *s = (arris_segment){.x1 = o->x1 - px * dy,
                         .y1 = o->y1 + px * dx,
                         .x2 = o->x2 - px * dy,
                         .y2 = o->y2 + px * dx,
                         .cov = {own + m->variance, (double)o->cov[1], (double)o->cov[2]}};
    return (misfit * own + m->share * m->variance) / s->cov[0];
}

static void add_views(adj_problem *p, const record *r, const beside_move *move,
                      const int64_t *place) {
    double rr[2];
    for (uint32_t i = 0; i < r->n; i++) {
        const sighting *o = &r->item[i];
        arris_segment s;
        if (o->line < 0 || place[o->line] < 0)
            continue;
        double misfit = moved(o, &move[i], &s);
        int64_t v = adj_add_view(p, o->frame, (uint32_t)place[o->line], &s);
        if (v >= 0 && !adj_residual(p, &p->view[v], &p->frame[o->frame].pose,
                                    &p->line[place[o->line]], rr, NULL, NULL))
            p->n_views--;
        else if (v >= 0)
            p->line[place[o->line]].misfit += misfit;
    }
}

static int build(adj_problem *p, const record *r, const arris_lines *lines,
                 const adjust_params *params, int64_t *place) {
    beside_move *move = malloc((r->n + (size_t)1) * sizeof *move);
    int rc = adj_init(p, r->n_frames, lines->n, r->n);
    rc = rc ? rc : move ? record_clear(r, lines, move) : ARRIS_E_MEMORY;
    if (rc) {
        free(move);
        return rc;
    }
    p->camera = r->camera;
    for (uint32_t i = 0; i < r->n_frames; i++) {
        const recorded_frame *f = &r->frame[i];
        adj_add_frame(p, &f->pose, (double)(f->utime - r->frame[0].utime) * 1e-6);
        memcpy(p->frame[i].pose.C, f->at.C, sizeof f->at.C);
        memcpy(p->frame[i].pose.R, f->at.R, sizeof f->at.R);
    }
    add_lines(p, r, lines, place);
    add_views(p, r, move, place);
    free(move);
    p->robust = params->robust;
    for (int k = 0; k < 6; k++)
        p->sigma[k] = k < 3 ? params->pose_sigma : params->rot_sigma;
    adj_set_common(p, params->common);
    return 0;
}

/* ---- back ------------------------------------------------------------------------------------ */

/* The sum of the variances of p and q, mm². */
static double trace(const arris_line *l) {
    double sum = 0;
    for (int i = 0, n = 0; i < 6; n += 6 - i++)
        sum += l->cov[n];
    return sum;
}

static int write_lines(const adj_problem *p, const adj_work *w, arris_lines *lines,
                       const int64_t *place) {
    adj_fit *fits = malloc(p->n_lines * sizeof *fits);
    double cov[16];
    if (!fits)
        return ARRIS_E_MEMORY;
    adj_fits(p, fits);
    for (uint32_t i = 0; i < lines->n; i++) {
        if (place[i] < 0)
            continue;
        uint32_t k = (uint32_t)place[i];
        arris_line *l = &lines->item[i];
        adj_line_points(&p->line[k], l->p, l->q);
        adj_line_covariance(w, k, cov);
        double was = trace(l);
        tell_line(&p->line[k], cov, l);
        if (l->state == ARRIS_MEASURED && trace(l) > LESS * was)
            l->state = ARRIS_WEAK;
        l->rms = adj_fit_rms(&fits[k]);
        l->views = (uint32_t)fits[k].agree;
    }
    free(fits);
    return 0;
}

static int write_poses(const adj_problem *p, record *r, adjusted *out) {
    free(out->pose);
    out->pose = malloc((p->n_frames + (size_t)1) * sizeof *out->pose);
    if (!out->pose)
        return ARRIS_E_MEMORY;
    for (uint32_t i = 0; i < p->n_frames; i++) {
        recorded_frame *f = &r->frame[i];
        out->pose[i] = p->frame[i].pose;
        memcpy(f->at.C, p->frame[i].pose.C, sizeof f->at.C);
        memcpy(f->at.R, p->frame[i].pose.R, sizeof f->at.R);
        f->outlier = p->frame[i].outlier || (f->seen > 3 && f->strays > STRAY * f->seen);
    }
    return 0;
}

void record_adjusted_free(adjusted *a) {
    free(a->pose);
    a->pose = NULL;
}

/* ---- what the scan does not tell ------------------------------------------------------------- */

enum { FRAMES = 3 };               /* at least */
static const double ALIKE = 0.035; /* rad: lines within 2° are of one direction */
static const double UNTOLD = 0.9; /* of what it was beforehand: a sigma that nothing made smaller */
static const double WIDE = 0.05;  /* sigma of the scale that is none */

static void state(adjusted *out, const char *what) {
    size_t n = strlen(out->undetermined);
    snprintf(out->undetermined + n, sizeof out->undetermined - n, "%s%s", n ? "; " : "", what);
}

static bool all_parallel(const adj_problem *p) {
    for (uint32_t i = 1; i < p->n_lines; i++) {
        double n[3];
        arris_cross(p->line[0].u, p->line[i].u, n);
        if (sqrt(arris_dot(n, n)) > ALIKE)
            return false;
    }
    return true;
}

/* Too little to adjust. */
static bool too_little(const adj_problem *p, adjusted *out) {
    if (p->n_frames < FRAMES)
        state(out, "two frames or fewer: lines and poses cannot be told apart");
    else if (p->n_lines < 2)
        state(out, p->n_lines ? "one line alone does not tell the poses"
                              : "no line was seen in 3 frames");
    return *out->undetermined;
}

/* Names each kind of common state of which one is no better known than beforehand. */
static void judge_states(const adj_problem *p, const adj_work *w, adjusted *out) {
    const char *said = "";
    for (int k = 0; k < adj_n_common(p); k++) {
        const char *name = adj_common_name(p, k);
        char what[80];
        if (strcmp(name, said) == 0 || sqrt(adj_state_variance(w, k)) < UNTOLD * p->state_sigma[k])
            continue;
        snprintf(what, sizeof what, "all of the state %s", name);
        state(out, what);
        said = name;
    }
}

static void judge(const adj_problem *p, const adj_work *w, adjusted *out) {
    static const char *const axes[6] = {"the noise of x",
                                        "the noise of y",
                                        "the noise of z",
                                        "the noise of the rotation about x",
                                        "the noise of the rotation about y",
                                        "the noise of the rotation about z"};
    if (all_parallel(p))
        state(out, "all lines are parallel: the poses along them are as reported");
    for (int k = 0; k < 6; k++)
        if (!out->q.determined[k])
            state(out, axes[k]);
    if (!(out->q.scale_sigma < WIDE))
        state(out, "the scale: no reported pose holds it");
    judge_states(p, w, out);
}

static int write(const adj_problem *p, const adj_work *w, record *r, arris_lines *lines,
                 const int64_t *place, adjusted *out) {
    int rc = write_poses(p, r, out);
    rc = rc ? rc : write_lines(p, w, lines, place);
    if (rc)
        return rc;
    lines->scale_sigma = isfinite(out->q.scale_sigma) ? out->q.scale_sigma : 0;
    lines->pose_sigma = sqrt(arris_dot(out->q.sigma, out->q.sigma) / 3);
    out->lines = p->n_lines, out->views = p->n_views, out->common = p->common;
    out->n_states = adj_n_common(p);
    memcpy(out->state, p->state, sizeof out->state);
    judge(p, w, out);
    return 0;
}

enum { LENS_STEPS = 20 };
static const double SETTLED = 0.1; /* of chi-square */
static const double EVIDENT = 6;   /* sigmas of what the lens model left, that is no chance */

/* Makes the lens one of the states where its model evidently left something, by the noise as it was
 * estimated without; moves the problem. 0 or an error of adj_minimise. */
static int look_at_lens(adj_problem *p, adjust_params *params) {
    bool evident = false;
    adj_set_common(p, p->common | ADJ_LENS);
    adj_work *w = adj_work_new(p, params->backend);
    int n = adj_n_common(p), rc = w ? adj_minimise(p, w, LENS_STEPS, SETTLED) : ARRIS_E_MEMORY;
    rc = rc < 0 ? rc : adj_marginals(p, w);
    for (int k = n - ADJ_LENS_TERMS; rc == 0 && k < n; k++)
        evident |= fabs(p->state[k]) > EVIDENT * sqrt(adj_state_variance(w, k));
    params->common |= evident ? ADJ_LENS : 0;
    adj_work_free(w);
    return rc;
}

/* Once, with the segments that are surely of their line, or all; where the frames are thought to be
 * goes into the record, and what the former tell of the lens into the parameters. */
static int adjust_once(record *r, arris_lines *lines, adjust_params *params, double apart,
                       int64_t *place, adjusted *out) {
    adj_problem p = {.frame = NULL};
    int rc = record_associate(r, lines, apart);
    rc = rc ? rc : build(&p, r, lines, params, place);
    *out->undetermined = 0;
    if (rc == 0 && !too_little(&p, out)) {
        adj_work *w = adj_work_new(&p, params->backend);
        rc = w ? adj_estimate(&p, w, &out->q) : ARRIS_E_MEMORY;
        rc = rc ? rc : write(&p, w, r, lines, place, out);
        adj_work_free(w);
        if (rc == 0 && apart > 0 && !(params->common & ADJ_LENS))
            rc = look_at_lens(&p, params);
    }
    adj_free(&p);
    return rc;
}

int record_adjust(record *r, arris_lines *lines, const adjust_params *params, adjusted *out) {
    int64_t *place = malloc((lines->n + (size_t)1) * sizeof *place);
    adjust_params p = *params;
    memset(out, 0, sizeof *out);
    int rc = place ? adjust_once(r, lines, &p, APART, place, out) : ARRIS_E_MEMORY;
    rc = rc ? rc : adjust_once(r, lines, &p, 0, place, out);
    if (rc < 0)
        record_adjusted_free(out);
    free(place);
    return rc;
}
