/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * model.c: the camera as `arris calibrate` estimates it, with its derivatives (model.h).
 */
#include "model.h"

#include <math.h>
#include <string.h>

const char *const cal_names[CAL_N] = {"fx", "fy", "skew", "cx", "cy", "k1", "k2", "p1", "p2", "k3"};
const char *const cal_units[CAL_N] = {"px", "px", "px", "px", "px", "", "", "", "", ""};

void cal_from_camera(const arris_camera *c, double k[CAL_N]) {
    const double from[CAL_N] = {c->fx, c->fy, c->skew, c->cx, c->cy,
                                c->k1, c->k2, c->p1,   c->p2, c->k3};
    memcpy(k, from, sizeof from);
}

arris_camera cal_to_camera(const double k[CAL_N], int32_t width, int32_t height) {
    return (arris_camera){.width = width,
                          .height = height,
                          .fx = k[CAL_FX],
                          .fy = k[CAL_FY],
                          .skew = k[CAL_SKEW],
                          .cx = k[CAL_CX],
                          .cy = k[CAL_CY],
                          .k1 = k[CAL_K1],
                          .k2 = k[CAL_K2],
                          .p1 = k[CAL_P1],
                          .p2 = k[CAL_P2],
                          .k3 = k[CAL_K3]};
}

/* ---- poses ---------------------------------------------------------------------------------- */

void cal_rotation(const double w[3], double R[9]) {
    double a = sqrt(arris_dot(w, w)), s = a > 1e-8 ? sin(a) / a : 1;
    double c = a > 1e-4 ? (1 - cos(a)) / (a * a) : 0.5 - a * a / 24;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            R[3 * i + j] = c * w[i] * w[j] + (i == j ? cos(a) : 0);
    R[1] -= s * w[2], R[3] += s * w[2];
    R[2] += s * w[1], R[6] -= s * w[1];
    R[5] -= s * w[0], R[7] += s * w[0];
}

/* By the unit quaternion's greatest component, which is good at every angle. */
void cal_rotation_vector(const double R[9], double w[3]) {
    double q[4] = {1 + R[0] + R[4] + R[8], 1 + R[0] - R[4] - R[8], 1 - R[0] + R[4] - R[8],
                   1 - R[0] - R[4] + R[8]};
    int big = 0;
    for (int i = 1; i < 4; i++)
        big = q[i] > q[big] ? i : big;
    const double row[4][4] = {{q[0], R[7] - R[5], R[2] - R[6], R[3] - R[1]},
                              {R[7] - R[5], q[1], R[1] + R[3], R[2] + R[6]},
                              {R[2] - R[6], R[1] + R[3], q[2], R[5] + R[7]},
                              {R[3] - R[1], R[2] + R[6], R[5] + R[7], q[3]}};
    memcpy(w, row[big] + 1, 3 * sizeof *w);
    double sign = row[big][0] < 0 ? -1 : 1, real = sign * row[big][0];
    double n = arris_unit(w), angle = 2 * atan2(n, real);
    for (int i = 0; i < 3; i++)
        w[i] *= sign * angle;
}

void cal_multiply(const double A[9], const double B[9], double C[9]) {
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            C[3 * i + j] = A[3 * i] * B[j] + A[3 * i + 1] * B[3 + j] + A[3 * i + 2] * B[6 + j];
}

static void apply(const cal_pose *p, const double X[3], double Y[3]) {
    for (int i = 0; i < 3; i++)
        Y[i] = arris_dot(p->R + 3 * i, X) + p->t[i];
}

cal_pose cal_compose(const cal_pose *a, const cal_pose *b) {
    cal_pose c;
    cal_multiply(a->R, b->R, c.R);
    apply(a, b->t, c.t);
    return c;
}

cal_pose cal_inverse(const cal_pose *p) {
    cal_pose q;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            q.R[3 * i + j] = p->R[3 * j + i];
        q.t[i] = -arris_dot(q.R + 3 * i, p->t);
    }
    return q;
}

cal_pose cal_moved(const cal_pose *p, const double d[6]) {
    cal_pose q = *p;
    double turn[9];
    cal_rotation(d, turn);
    cal_multiply(turn, p->R, q.R);
    for (int i = 0; i < 3; i++)
        q.t[i] += d[3 + i];
    return q;
}

/* ---- the board ------------------------------------------------------------------------------ */

void cal_corner(const cal_board *b, const double *shape, int i, double X[3],
                double basis[CAL_SHAPE]) {
    int col = i % b->cols, row = i / b->cols;
    double u = 2.0 * col / (b->cols - 1) - 1, v = 2.0 * row / (b->rows - 1) - 1, term[CAL_SHAPE];
    X[0] = col * b->square;
    X[1] = row * b->square;
    X[2] = 0;
    if (!shape && !basis)
        return;
    for (int degree = 2, n = 0; degree <= 4; degree++)
        for (int k = 0; k <= degree; k++, n++) {
            term[n] = pow(u, degree - k) * pow(v, k);
            X[2] += shape ? shape[n] * term[n] : 0;
        }
    if (basis)
        memcpy(basis, term, sizeof term);
}

/* ---- projection ----------------------------------------------------------------------------- */

/* A point on its way through the camera. */
typedef struct passage {
    double x, y;   /* ideal, normalised */
    double dx, dy; /* distorted */
    double r2;
    double J[2][2]; /* d(dx, dy) / d(x, y) */
} passage;

static void pass_lens(const double k[CAL_N], passage *q) {
    double x = q->x, y = q->y, r2 = q->r2 = x * x + y * y;
    double radial = 1 + r2 * (k[CAL_K1] + r2 * (k[CAL_K2] + r2 * k[CAL_K3]));
    double slope = 2 * (k[CAL_K1] + r2 * (2 * k[CAL_K2] + r2 * 3 * k[CAL_K3]));
    double p1 = k[CAL_P1], p2 = k[CAL_P2];
    q->dx = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x);
    q->dy = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y;
    q->J[0][0] = radial + x * x * slope + 2 * p1 * y + 6 * p2 * x;
    q->J[0][1] = q->J[1][0] = x * y * slope + 2 * p1 * x + 2 * p2 * y;
    q->J[1][1] = radial + y * y * slope + 6 * p1 * y + 2 * p2 * x;
}

static void by_parameters(const double k[CAL_N], const passage *q, double J[2][CAL_N]) {
    double x = q->x, y = q->y, r2 = q->r2, fx = k[CAL_FX], fy = k[CAL_FY], s = k[CAL_SKEW];
    const double row[2][CAL_N] = {
        {q->dx, 0, q->dy, 1, 0, r2 * (fx * x + s * y), r2 * r2 * (fx * x + s * y),
         fx * 2 * x * y + s * (r2 + 2 * y * y), fx * (r2 + 2 * x * x) + s * 2 * x * y,
         r2 * r2 * r2 * (fx * x + s * y)},
        {0, q->dy, 0, 0, 1, r2 * fy * y, r2 * r2 * fy * y, fy * (r2 + 2 * y * y), fy * 2 * x * y,
         r2 * r2 * r2 * fy * y}};
    memcpy(J, row, sizeof row);
}

bool cal_project(const double k[CAL_N], const cal_pose *pose, const double X[3], double p[2],
                 double Jk[2][CAL_N], double Jp[2][6], double JX[2][3]) {
    double Y[3], turned[3];
    apply(pose, X, Y);
    if (!(Y[2] > 1e-9))
        return false;
    passage q = {.x = Y[0] / Y[2], .y = Y[1] / Y[2]};
    pass_lens(k, &q);
    p[0] = k[CAL_FX] * q.dx + k[CAL_SKEW] * q.dy + k[CAL_CX];
    p[1] = k[CAL_FY] * q.dy + k[CAL_CY];
    if (Jk)
        by_parameters(k, &q, Jk);
    for (int i = 0; i < 3; i++)
        turned[i] = Y[i] - pose->t[i];
    for (int r = 0; r < 2; r++) {
        double a = r == 0 ? k[CAL_FX] * q.J[0][0] + k[CAL_SKEW] * q.J[1][0] : k[CAL_FY] * q.J[1][0];
        double b = r == 0 ? k[CAL_FX] * q.J[0][1] + k[CAL_SKEW] * q.J[1][1] : k[CAL_FY] * q.J[1][1];
        const double by_Y[3] = {a / Y[2], b / Y[2], -(a * q.x + b * q.y) / Y[2]};
        if (Jp) {
            arris_cross(turned, by_Y, Jp[r]);
            memcpy(Jp[r] + 3, by_Y, sizeof by_Y);
        }
        for (int i = 0; JX && i < 3; i++)
            JX[r][i] = by_Y[0] * pose->R[i] + by_Y[1] * pose->R[3 + i] + by_Y[2] * pose->R[6 + i];
    }
    return true;
}
