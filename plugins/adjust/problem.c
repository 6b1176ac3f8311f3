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
/* The share of its weight that an outlier keeps, lest nothing hold it where it sees too little. */
static const double BELIEVED = 1e-4;

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

void adj_lens(const arris_camera *c, const double x[2], double by[ADJ_LENS_TERMS][2]) {
    double edge = c->width / 2.0, u = (x[0] - c->cx) / edge;
    double v = (x[1] - c->cy) / edge * c->fx / c->fy, r2 = u * u + v * v;
    double to[ADJ_LENS_TERMS][2] = {{u * r2, v * r2},
                                    {u * r2 * r2, v * r2 * r2},
                                    {2 * u * v, r2 + 2 * v * v},
                                    {r2 + 2 * u * u, 2 * u * v}};
    memcpy(by, to, sizeof to);
}

/* The end of a segment but for the distortion that is left. */
static void ideal_end(const adj_problem *p, const double end[2], double x[2]) {
    double by[ADJ_LENS_TERMS][2];
    memcpy(x, end, 2 * sizeof *x);
    if (!(p->common & ADJ_LENS))
        return;
    const double *lens = p->state + adj_n_common(p) - ADJ_LENS_TERMS;
    adj_lens(&p->camera, end, by);
    for (int i = 0; i < ADJ_LENS_TERMS; i++)
        x[0] += lens[i] * by[i][0], x[1] += lens[i] * by[i][1];
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

/* The picture m of a line whose plane has the normal n; returns the length that makes distances of
 * it, those to the right of the segment above 0. */
static double seen_as(const adj_problem *p, const adj_view *v, const adj_pose *pose,
                      const double n[3], double m[3]) {
    double dx = v->end[1][0] - v->end[0][0], dy = v->end[1][1] - v->end[0][1];
    picture_line(&p->camera, pose->R, n, m);
    return copysign(hypot(m[0], m[1]), m[1] * dx - m[0] * dy);
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
    double norm = seen_as(p, v, pose, n, m);
    for (int k = 0; k < 2; k++) {
        double x[2];
        ideal_end(p, v->end[k], x);
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

void adj_residual_lens(const adj_problem *p, const adj_view *v, const adj_pose *pose,
                       const adj_line *line, double J[2][ADJ_LENS_TERMS]) {
    double A[3], B[3], n[3], m[3], by[ADJ_LENS_TERMS][2];
    adj_line_points(line, A, B);
    for (int i = 0; i < 3; i++)
        A[i] -= pose->C[i], B[i] -= pose->C[i];
    arris_cross(A, B, n);
    double norm = seen_as(p, v, pose, n, m);
    for (int k = 0; k < 2; k++) {
        adj_lens(&p->camera, v->end[k], by);
        for (int i = 0; i < ADJ_LENS_TERMS; i++)
            J[k][i] = (m[0] * by[i][0] + m[1] * by[i][1]) / norm;
    }
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

double adj_precision(const adj_problem *p, int axis, uint32_t frame) {
    double weight = p->frame[frame].outlier ? BELIEVED : 1;
    return weight / (p->sigma[axis] * p->sigma[axis]);
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
