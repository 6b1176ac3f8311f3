/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * fill.c: fills the normal equations, and steps by their solution (system.h).
 */
#include <math.h>
#include <string.h>

#include "system.h"

static const double NEAR = 0.2; /* of its distance: how far a line is moved in one step */
enum { SHORTER = 5 };           /* tries to shorten it; the last is not to move it */

/* ---- what was seen --------------------------------------------------------------------------- */

/* By the Cholesky factor of the inverse covariance. */
static void whiten(const adj_view *v, double weight, adj_rows *o) {
    double c = v->cov[1] / v->cov[0], a = sqrt(weight / v->cov[0]);
    double b = sqrt(weight / (v->cov[2] - c * v->cov[1]));
    o->r[1] = b * (o->r[1] - c * o->r[0]), o->r[0] *= a;
    for (int i = 0; i < 6; i++)
        o->Jp[1][i] = b * (o->Jp[1][i] - c * o->Jp[0][i]), o->Jp[0][i] *= a;
    for (int i = 0; i < 4; i++)
        o->Jl[1][i] = b * (o->Jl[1][i] - c * o->Jl[0][i]), o->Jl[0][i] *= a;
    for (int i = 0; i < ADJ_LENS_TERMS; i++)
        o->Jc[1][i] = b * (o->Jc[1][i] - c * o->Jc[0][i]), o->Jc[0][i] *= a;
}

bool adj_linearise(const adj_problem *p, const adj_view *v, adj_rows *o) {
    const adj_line *l = &p->line[v->line];
    if (!adj_residual(p, v, &p->frame[v->frame].pose, l, o->r, o->Jp, o->Jl))
        return false;
    memset(o->Jc, 0, sizeof o->Jc);
    if (p->common & ADJ_LENS)
        adj_residual_lens(p, v, &p->frame[v->frame].pose, l, o->Jc);
    double weight = v->apart ? 0 : adj_weight(p, adj_distance(v, l, o->r));
    whiten(v, weight / (l->variance * l->memory), o);
    return true;
}

static void add_view(adj_system *s, const adj_problem *p, uint32_t view, const adj_rows *o) {
    const adj_view *v = &p->view[view];
    int line = 4 * (int)v->line, frame = s->poses + 6 * (int)v->frame, own = s->own[v->frame];
    for (int c = 0; c < 4; c++) {
        double *to = s->S.val + s->S.ptr[line + c];
        for (int r = 0; r <= c; r++)
            to[r] += o->Jl[0][r] * o->Jl[0][c] + o->Jl[1][r] * o->Jl[1][c];
        s->rhs[line + c] -= o->Jl[0][c] * o->r[0] + o->Jl[1][c] * o->r[1];
    }
    for (int c = 0; c < 6; c++) {
        double *column = s->S.val + s->S.ptr[frame + c], *to = column + s->slot[view];
        for (int r = 0; r < 4; r++)
            to[r] += o->Jl[0][r] * o->Jp[0][c] + o->Jl[1][r] * o->Jp[1][c];
        for (int r = 0; r <= c; r++)
            column[own + r] += o->Jp[0][r] * o->Jp[0][c] + o->Jp[1][r] * o->Jp[1][c];
        s->rhs[frame + c] -= o->Jp[0][c] * o->r[0] + o->Jp[1][c] * o->r[1];
    }
}

/* The lens states' share of it, in the border. */
static void add_lens(adj_system *s, const adj_view *v, const adj_rows *o) {
    int line = 4 * (int)v->line, frame = s->poses + 6 * (int)v->frame;
    int first = s->S.n - ADJ_LENS_TERMS;
    for (int c = 0; c < ADJ_LENS_TERMS; c++) {
        double *to = s->S.val + s->S.ptr[first + c], a = o->Jc[0][c], b = o->Jc[1][c];
        for (int r = 0; r < 4; r++)
            to[line + r] += o->Jl[0][r] * a + o->Jl[1][r] * b;
        for (int r = 0; r < 6; r++)
            to[frame + r] += o->Jp[0][r] * a + o->Jp[1][r] * b;
        for (int r = 0; r <= c; r++)
            to[first + r] += o->Jc[0][r] * a + o->Jc[1][r] * b;
        s->rhs[first + c] -= a * o->r[0] + b * o->r[1];
    }
}

/* What is known of a line beforehand. */
static void add_line(adj_system *s, const adj_problem *p, uint32_t line) {
    const adj_line *l = &p->line[line];
    double hold = 1 / (l->hold * l->hold);
    for (uint32_t c = 4 * line; c < 4 * line + 4; c++) {
        s->S.val[s->S.ptr[c + 1] - 1] += hold;
        s->rhs[c] -= hold * l->x[c - 4 * line];
    }
}

/* ---- the prior ------------------------------------------------------------------------------- */

/* e and its derivatives by the six of the pose (a diagonal but for the rotation) and the states. */
typedef struct error {
    double e[6], D[6][6], G[6][ADJ_COMMON];
} error;

static void error_of(const adj_problem *p, uint32_t frame, error *o) {
    double J[9];
    memset(o->D, 0, sizeof o->D);
    adj_error(p, frame, o->e, J, o->G);
    for (int i = 0; i < 3; i++) {
        o->D[i][i] = 1 / adj_scale(p);
        memcpy(&o->D[3 + i][3], J + 3 * i, 3 * sizeof *J);
    }
}

/* Adds t e² of one axis. */
static void add_error(adj_system *s, const error *o, uint32_t frame, int axis, double t) {
    const double *D = o->D[axis];
    int first = s->poses + 6 * (int)frame;
    for (int c = 0; c < 6; c++) {
        double *to = s->S.val + s->S.ptr[first + c] + s->own[frame];
        for (int r = 0; r <= c; r++)
            to[r] += D[r] * t * D[c];
        s->rhs[first + c] -= D[c] * t * o->e[axis];
    }
}

/* The same between the frame and the common states. */
static void add_border(adj_system *s, const error *o, uint32_t frame, int axis, double t) {
    const double *G = o->G[axis];
    for (int c = 0; c < s->S.n - s->common; c++) {
        double *to = s->S.val + s->S.ptr[s->common + c];
        int own = s->poses - s->border + 6 * (int)frame;
        for (int r = 0; r < 6; r++)
            to[own + r] -= o->D[axis][r] * t * G[c];
        for (int r = 0; r <= c; r++)
            to[s->common - s->border + r] += t * G[r] * G[c];
        s->rhs[s->common + c] += t * G[c] * o->e[axis];
    }
}

static void add_prior(adj_system *s, const adj_problem *p) {
    error o;
    for (uint32_t i = 0; i < p->n_frames; i++) {
        error_of(p, i, &o);
        for (int axis = 0; axis < 6; axis++) {
            double t = adj_precision(p, axis, i);
            add_error(s, &o, i, axis, t);
            add_border(s, &o, i, axis, t);
        }
    }
    for (int c = s->common; c < s->S.n; c++) {
        double sigma = p->state_sigma[c - s->common], weight = 1 / (sigma * sigma);
        s->S.val[s->S.ptr[c + 1] - 1] += weight;
        s->rhs[c] -= weight * p->state[c - s->common];
    }
}

/* ---- all of it ------------------------------------------------------------------------------- */

bool adj_system_fill(adj_system *s, const adj_problem *p, double damping) {
    adj_rows o;
    memset(s->S.val, 0, (size_t)s->S.ptr[s->S.n] * sizeof *s->S.val);
    memset(s->rhs, 0, (size_t)s->S.n * sizeof *s->rhs);
    for (uint32_t i = 0; i < p->n_views; i++) {
        if (!adj_linearise(p, &p->view[i], &o))
            return false;
        add_view(s, p, i, &o);
        if (p->common & ADJ_LENS)
            add_lens(s, &p->view[i], &o);
    }
    for (uint32_t i = 0; i < p->n_lines; i++)
        add_line(s, p, i);
    add_prior(s, p);
    for (int c = 0; c < s->S.n; c++) {
        double *diagonal = &s->S.val[s->S.ptr[c + 1] - 1];
        *diagonal += damping * *diagonal;
    }
    return true;
}

/* Whether all that see the line have it in front of them. */
static bool in_front(const adj_system *s, const adj_problem *p, uint32_t line) {
    double r[2];
    for (uint32_t k = s->first[line]; k < s->first[line + 1]; k++) {
        const adj_view *v = &p->view[s->order[k]];
        if (!adj_residual(p, v, &p->frame[v->frame].pose, &p->line[line], r, NULL, NULL))
            return false;
    }
    return true;
}

/* A line of which little is known may be sent anywhere: its step is shortened to what the
 * derivatives are good for, and until it stays in front of the cameras. */
static void move_line(const adj_system *s, adj_problem *p, uint32_t line, const double step[4]) {
    adj_line *l = &p->line[line];
    double x[4], longest = 0, share;
    memcpy(x, l->x, sizeof x);
    for (int m = 0; m < 4; m++)
        longest = fmax(longest, fabs(step[m]));
    share = longest > NEAR * l->hold ? NEAR * l->hold / longest : 1;
    for (int i = 0; i < SHORTER; i++, share = i + 1 < SHORTER ? share / 4 : 0) {
        for (int m = 0; m < 4; m++)
            l->x[m] = x[m] + share * step[m];
        if (in_front(s, p, line))
            return;
    }
}

void adj_system_move(adj_system *s, adj_problem *p, const double *d) {
    s->predicted = 0;
    for (int c = 0; c < s->S.n; c++)
        s->predicted += s->rhs[c] * d[c];
    for (uint32_t i = 0; i < p->n_frames; i++)
        adj_pose_move(&p->frame[i].pose, d + s->poses + 6 * i);
    for (uint32_t l = 0; l < p->n_lines; l++)
        move_line(s, p, l, d + 4 * l);
    for (int c = s->common; c < s->S.n; c++)
        p->state[c - s->common] += d[c];
}
