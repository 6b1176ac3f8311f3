/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * problem.c: lines, poses, and what bears on them (problem.h).
 *
 * A line through P and Q is seen in the picture as K^-T R n, where n = (P - C) x (Q - C) (Hartley
 * and Zisserman, 8.1); so every derivative goes by way of n.
 */
#include "problem.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double BEHIND = 0.1; /* of a line's hold: nearer is not in front of the camera */

int adj_init(adj_problem *p, uint32_t frames, uint32_t lines, uint32_t views) {
    memset(p, 0, sizeof *p);
    p->frame = calloc(frames + (size_t)1, sizeof *p->frame);
    p->line = calloc(lines + (size_t)1, sizeof *p->line);
    p->view = calloc(views + (size_t)1, sizeof *p->view);
    if (!p->frame || !p->line || !p->view)
        return ARRIS_E_MEMORY;
    p->max_frames = frames, p->max_lines = lines, p->max_views = views;
    return 0;
}

void adj_free(adj_problem *p) {
    free(p->frame);
    free(p->line);
    free(p->view);
    memset(p, 0, sizeof *p);
}

/* ---- what is added --------------------------------------------------------------------------- */

int64_t adj_add_frame(adj_problem *p, const arris_pose *reported, double time) {
    if (p->n_frames == p->max_frames)
        return -1;
    adj_frame *f = &p->frame[p->n_frames];
    memset(f, 0, sizeof *f);
    memcpy(f->reported.C, reported->C, sizeof reported->C);
    memcpy(f->reported.R, reported->R, sizeof reported->R);
    f->pose = f->reported;
    f->time = time;
    return p->n_frames++;
}

/* Two unit vectors across u. */
static void across(const double u[3], double a[3], double b[3]) {
    int least = 0;
    for (int i = 1; i < 3; i++)
        if (fabs(u[i]) < fabs(u[least]))
            least = i;
    double e[3] = {least == 0, least == 1, least == 2};
    arris_cross(u, e, a);
    arris_unit(a);
    arris_cross(u, a, b);
}

int64_t adj_add_line(adj_problem *p, const double P[3], const double Q[3], double hold) {
    if (p->n_lines == p->max_lines)
        return -1;
    adj_line *l = &p->line[p->n_lines];
    memset(l, 0, sizeof *l);
    for (int i = 0; i < 3; i++) {
        l->X[i] = (P[i] + Q[i]) / 2;
        l->u[i] = Q[i] - P[i];
    }
    l->h = arris_unit(l->u) / 2;
    across(l->u, l->a, l->b);
    l->hold = hold;
    l->variance = l->memory = 1;
    return p->n_lines++;
}

int64_t adj_add_view(adj_problem *p, uint32_t frame, uint32_t line, const arris_segment *s) {
    double half2 = ((s->x2 - s->x1) * (s->x2 - s->x1) + (s->y2 - s->y1) * (s->y2 - s->y1)) / 4;
    double mixed = 2 * sqrt(half2) * s->cov[1], bend = half2 * s->cov[2];
    if (p->n_views == p->max_views || !(half2 > 0) || !(s->cov[0] > 0 && s->cov[2] > 0) ||
        !isfinite(half2 + s->x1 + s->y1 + s->cov[0] + s->cov[1] + s->cov[2]) ||
        s->cov[1] * s->cov[1] >= s->cov[0] * s->cov[2])
        return -1;
    p->view[p->n_views] =
        (adj_view){frame,
                   line,
                   {{s->x1, s->y1}, {s->x2, s->y2}},
                   {s->cov[0] - mixed + bend, s->cov[0] - bend, s->cov[0] + mixed + bend},
                   false};
    return p->n_views++;
}

/* ---- common states --------------------------------------------------------------------------- */

static const struct {
    unsigned bit;
    int n;
    double sigma[2]; /* of the first three and of the others */
} commons[] = {{ADJ_SCALE, 1, {0.01, 0}},
               {ADJ_DRIFT, 6, {1, 1e-3}},
               {ADJ_HAND_EYE, 6, {5, 1e-2}},
               {ADJ_DELAY, 1, {0.05, 0}}};
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

/* ---- moving ---------------------------------------------------------------------------------- */

void adj_line_points(const adj_line *l, double P[3], double Q[3]) {
    for (int i = 0; i < 3; i++) {
        P[i] = l->X[i] - l->h * l->u[i] + l->x[0] * l->a[i] + l->x[1] * l->b[i];
        Q[i] = l->X[i] + l->h * l->u[i] + l->x[2] * l->a[i] + l->x[3] * l->b[i];
    }
}

/* exp [w]: by Rodrigues. */
static void exponential(const double w[3], double E[9]) {
    double t2 = arris_dot(w, w), t = sqrt(t2);
    double s = t > 1e-4 ? sin(t) / t : 1 - t2 / 6;
    double c = t > 1e-4 ? (1 - cos(t)) / t2 : 0.5 - t2 / 24;
    double W[9] = {0, -w[2], w[1], w[2], 0, -w[0], -w[1], w[0], 0};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            E[3 * i + j] = s * W[3 * i + j] + c * (w[i] * w[j] - (i == j) * t2) + (i == j);
}

void adj_pose_move(adj_pose *pose, const double d[6]) {
    double E[9], R[9];
    exponential(d + 3, E);
    for (int i = 0; i < 3; i++) /* R exp[-w] = R E' */
        for (int j = 0; j < 3; j++)
            R[3 * i + j] = arris_dot(pose->R + 3 * i, E + 3 * j);
    memcpy(pose->R, R, sizeof R);
    for (int i = 0; i < 3; i++)
        pose->C[i] += d[i];
}

/* ---- what a segment says --------------------------------------------------------------------- */

static void world(const double R[9], const double v[3], double out[3]) {
    for (int i = 0; i < 3; i++)
        out[i] = R[i] * v[0] + R[3 + i] * v[1] + R[6 + i] * v[2];
}

/* n, seen by the camera, as a line of the picture: m = K^-T R n, times fx fy. */
static void picture_line(const arris_camera *c, const double R[9], const double n[3], double m[3]) {
    double x = arris_dot(R, n), y = arris_dot(R + 3, n), z = arris_dot(R + 6, n);
    m[0] = c->fy * x;
    m[1] = c->fx * y - c->skew * x;
    m[2] = c->fx * c->fy * z - c->cx * m[0] - c->cy * m[1];
}

/* The derivative by n in the world of what has the derivative g by m. */
static void by_normal(const arris_camera *c, const double R[9], const double g[3], double out[3]) {
    double u = g[0] - c->cx * g[2], v = g[1] - c->cy * g[2];
    double k[3] = {c->fy * u - c->skew * v, c->fx * v, c->fx * c->fy * g[2]};
    world(R, k, out);
}

/* The derivatives of a residual whose derivative by n is g. */
static void derive(const double g[3], const double A[3], const double B[3], const double n[3],
                   const adj_line *l, double Jp[6], double Jl[4]) {
    double D[3] = {B[0] - A[0], B[1] - A[1], B[2] - A[2]}, by_P[3], by_Q[3];
    if (Jp) {
        arris_cross(g, D, Jp);
        arris_cross(g, n, Jp + 3);
    }
    if (Jl) {
        arris_cross(B, g, by_P);
        arris_cross(g, A, by_Q);
        Jl[0] = arris_dot(by_P, l->a), Jl[1] = arris_dot(by_P, l->b);
        Jl[2] = arris_dot(by_Q, l->a), Jl[3] = arris_dot(by_Q, l->b);
    }
}

/* Whether the point of the line that is seen at `end` is in front of the camera. With A and B in
 * the camera's axes, A + s (B - A) is seen there: across the line's own direction in the picture.
 */
static bool in_front(const adj_problem *p, const adj_pose *pose, const double A[3],
                     const double B[3], const adj_view *v, double near) {
    const arris_camera *c = &p->camera;
    double dx = v->end[1][0] - v->end[0][0], dy = v->end[1][1] - v->end[0][1];
    double a[3], b[3];
    for (int i = 0; i < 3; i++) {
        a[i] = arris_dot(pose->R + 3 * i, A);
        b[i] = arris_dot(pose->R + 3 * i, B);
    }
    double along_a =
        dx * (c->fx * a[0] + c->skew * a[1] + c->cx * a[2]) + dy * (c->fy * a[1] + c->cy * a[2]);
    double along_b =
        dx * (c->fx * b[0] + c->skew * b[1] + c->cx * b[2]) + dy * (c->fy * b[1] + c->cy * b[2]);
    for (int k = 0; k < 2; k++) {
        double t = dx * v->end[k][0] + dy * v->end[k][1]; /* (along - t z) is 0 at s */
        double at_a = along_a - t * a[2], at_b = along_b - t * b[2];
        double z = (at_a * b[2] - at_b * a[2]) / (at_a - at_b);
        if (!(z > near))
            return false;
    }
    return true;
}

bool adj_residual(const adj_problem *p, const adj_view *v, const adj_pose *pose,
                  const adj_line *line, double r[2], double Jp[2][6], double Jl[2][4]) {
    double A[3], B[3], n[3], m[3], g[3];
    adj_line_points(line, A, B);
    for (int i = 0; i < 3; i++)
        A[i] -= pose->C[i], B[i] -= pose->C[i];
    if (!in_front(p, pose, A, B, v, BEHIND * line->hold))
        return false;
    arris_cross(A, B, n);
    picture_line(&p->camera, pose->R, n, m);
    double dx = v->end[1][0] - v->end[0][0], dy = v->end[1][1] - v->end[0][1];
    double norm = copysign(hypot(m[0], m[1]), m[1] * dx - m[0] * dy);
    for (int k = 0; k < 2; k++) {
        const double *x = v->end[k];
        r[k] = (m[0] * x[0] + m[1] * x[1] + m[2]) / norm;
        double along = r[k] / norm;
        double by_m[3] = {(x[0] - along * m[0]) / norm, (x[1] - along * m[1]) / norm, 1 / norm};
        if (!Jp && !Jl)
            continue;
        by_normal(&p->camera, pose->R, by_m, g);
        derive(g, A, B, n, line, Jp ? Jp[k] : NULL, Jl ? Jl[k] : NULL);
    }
    return true;
}

double adj_distance(const adj_view *v, const adj_line *l, const double r[2]) {
    double det = v->cov[0] * v->cov[2] - v->cov[1] * v->cov[1];
    return (v->cov[2] * r[0] * r[0] - 2 * v->cov[1] * r[0] * r[1] + v->cov[0] * r[1] * r[1]) /
           (det * l->variance);
}

double adj_loss(const adj_problem *p, double d2) {
    double c2 = p->robust * p->robust;
    return c2 > 0 ? c2 * log1p(d2 / c2) : d2;
}

double adj_weight(const adj_problem *p, double d2) {
    double c2 = p->robust * p->robust;
    return c2 > 0 ? 1 / (1 + d2 / c2) : 1;
}

/* ---- what was reported ----------------------------------------------------------------------- */

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

void adj_error(const adj_problem *p, uint32_t frame, double e[6], double J[9],
               double G[6][ADJ_COMMON]) {
    typedef void add(const adj_problem *, uint32_t, double[6][ADJ_COMMON], int);
    static add *const adds[COMMONS] = {add_scale, add_drift, add_hand_eye, add_delay};
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
            adds[i](p, frame, g, n);
            n += commons[i].n;
        }
    for (int i = 0; i < 6; i++)
        for (int k = 0; k < n; k++)
            e[i] -= g[i][k] * p->state[k];
}

double adj_precision(const adj_problem *p, int axis, uint32_t frame) {
    return p->frame[frame].outlier ? 0 : 1 / (p->sigma[axis] * p->sigma[axis]);
}

/* ---- all of it ------------------------------------------------------------------------------- */

static double cost_of_prior(const adj_problem *p) {
    double sum = 0, e[6];
    for (uint32_t i = 0; i < p->n_frames; i++) {
        adj_error(p, i, e, NULL, NULL);
        for (int k = 0; k < 6; k++)
            sum += adj_precision(p, k, i) * e[k] * e[k];
    }
    for (int k = 0; k < adj_n_common(p); k++)
        sum += p->state[k] * p->state[k] / (p->state_sigma[k] * p->state_sigma[k]);
    return sum;
}

static double cost_of_line(const adj_line *l) {
    double sum = 0;
    for (int i = 0; i < 4; i++)
        sum += l->x[i] * l->x[i] / (l->hold * l->hold);
    return sum;
}

double adj_cost(const adj_problem *p) {
    double sum = cost_of_prior(p), r[2];
    for (uint32_t i = 0; i < p->n_lines; i++)
        sum += cost_of_line(&p->line[i]);
    for (uint32_t i = 0; i < p->n_views; i++) {
        const adj_view *v = &p->view[i];
        const adj_line *l = &p->line[v->line];
        if (!adj_residual(p, v, &p->frame[v->frame].pose, l, r, NULL, NULL))
            return (double)INFINITY;
        if (!v->apart)
            sum += adj_loss(p, adj_distance(v, l, r)) / l->memory;
    }
    return sum;
}
