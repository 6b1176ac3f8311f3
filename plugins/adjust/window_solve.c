/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * window_solve.c: the fixed lag's equations (window_parts.h). Each pose is eliminated, 6x6, which
 * leaves a dense matrix of the lines.
 */
#include <math.h>
#include <string.h>

#include "system.h"
#include "window_parts.h"

static const double LEAST = 1e-12; /* mm⁻², rad⁻²: what is known of a pose that nobody reports */
static const double NEAR = 0.2;    /* of its distance: how far a line is moved in one step */
enum { LOOKS = 2, TURNS = 4 };     /* frames in which a pose's variance is computed once */

/* ---- a frame --------------------------------------------------------------------------------- */

static void add_prior(const window *w, uint32_t place, double C[6][6], double b[6]) {
    double e[6], weight = window_pose_weight(w, place);
    adj_error(&w->p, place, e, NULL, NULL);
    for (int k = 0; k < 6; k++) {
        double t = weight * adj_precision(&w->p, k, place) + LEAST;
        C[k][k] += t;
        b[k] -= t * e[k];
    }
}

/* Where the line stands in the part. */
static uint32_t entry_of(pose_part *o, uint32_t line) {
    uint32_t i = 0;
    while (i < o->n && o->line[i] != line)
        i++;
    if (i == o->n) {
        o->line[o->n++] = line;
        memset(o->B[i], 0, sizeof o->B[i]);
    }
    return i;
}

static void add_pose(pose_part *o, const adj_rows *r) {
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j <= i; j++)
            o->L[i][j] += r->Jp[0][i] * r->Jp[0][j] + r->Jp[1][i] * r->Jp[1][j];
        o->b[i] -= r->Jp[0][i] * r->r[0] + r->Jp[1][i] * r->r[1];
    }
}

static void add_view(pose_part *o, const adj_view *v, const adj_rows *r, dense H, double *s) {
    double(*B)[6] = o->B[entry_of(o, v->line)];
    uint32_t row = 4 * v->line;
    for (int i = 0; i < 4; i++) {
        for (int j = i; j < 4; j++)
            H[row + (uint32_t)i][row + (uint32_t)j] +=
                r->Jl[0][i] * r->Jl[0][j] + r->Jl[1][i] * r->Jl[1][j];
        for (int j = 0; j < 6; j++)
            B[i][j] += r->Jl[0][i] * r->Jp[0][j] + r->Jl[1][i] * r->Jp[1][j];
        s[row + (uint32_t)i] -= r->Jl[0][i] * r->r[0] + r->Jl[1][i] * r->r[1];
    }
    add_pose(o, r);
}

static void factor6(double L[6][6]) {
    for (int i = 0; i < 6; i++)
        for (int j = 0; j <= i; j++) {
            double sum = L[i][j];
            for (int k = 0; k < j; k++)
                sum -= L[i][k] * L[j][k];
            L[i][j] = i == j ? sqrt(sum) : sum / L[j][j];
        }
}

/* x becomes L^-1 x */
static void forward6(const double L[6][6], double x[6]) {
    for (int i = 0; i < 6; i++) {
        for (int k = 0; k < i; k++)
            x[i] -= L[i][k] * x[k];
        x[i] /= L[i][i];
    }
}

/* x becomes C^-1 x */
static void solve6(const double L[6][6], double x[6]) {
    forward6(L, x);
    for (int i = 5; i >= 0; i--) {
        for (int k = i + 1; k < 6; k++)
            x[i] -= L[k][i] * x[k];
        x[i] /= L[i][i];
    }
}

/* H -= B C^-1 B', s -= B C^-1 b */
static void eliminate(pose_part *o, dense H, double *s) {
    double Y[WINDOW_LINES][4][6], y[6];
    memcpy(y, o->b, sizeof y);
    forward6(o->L, y);
    memcpy(Y, o->B, o->n * sizeof *Y);
    for (uint32_t i = 0; i < o->n; i++)
        for (uint32_t k = 0; k < 4; k++) {
            forward6(o->L, Y[i][k]);
            for (int m = 0; m < 6; m++)
                s[4 * o->line[i] + k] -= Y[i][k][m] * y[m];
        }
    for (uint32_t i = 0; i < o->n; i++)
        for (uint32_t j = 0; j < o->n; j++)
            for (uint32_t k = 0; o->line[i] <= o->line[j] && k < 4; k++)
                for (uint32_t m = 0; m < 4; m++)
                    H[4 * o->line[i] + k][4 * o->line[j] + m] -=
                        Y[i][k][0] * Y[j][m][0] + Y[i][k][1] * Y[j][m][1] +
                        Y[i][k][2] * Y[j][m][2] + Y[i][k][3] * Y[j][m][3] +
                        Y[i][k][4] * Y[j][m][4] + Y[i][k][5] * Y[j][m][5];
}

/* Adds what a frame says of the lines, linear about where all are: s is half the cost's slope. */
static void add_frame(window *w, uint32_t place, dense H, double *s) {
    pose_part *o = &w->part[place];
    adj_rows r;
    o->n = 0;
    memset(o->L, 0, sizeof o->L);
    memset(o->b, 0, sizeof o->b);
    add_prior(w, place, o->L, o->b);
    for (uint32_t i = 0; i < w->n_views[place]; i++) {
        const adj_view *v = &w->p.view[WINDOW_VIEWS * place + i];
        if (v->line < w->p.n_lines && adj_linearise(&w->p, v, &r))
            add_view(o, v, &r, H, s);
    }
    factor6(o->L);
    eliminate(o, H, s);
}

void window_locate(window *w) {
    uint32_t place = window_place(w, w->n - 1);
    for (int i = 0; i < LOOKS; i++) {
        pose_part *o = &w->part[place];
        adj_rows r;
        memset(o->L, 0, sizeof o->L);
        memset(o->b, 0, sizeof o->b);
        add_prior(w, place, o->L, o->b);
        for (uint32_t m = 0; m < w->n_views[place]; m++) {
            const adj_view *v = &w->p.view[WINDOW_VIEWS * place + m];
            if (v->line < w->p.n_lines && adj_linearise(&w->p, v, &r))
                add_pose(o, &r);
        }
        factor6(o->L);
        solve6(o->L, o->b);
        adj_pose_move(&w->p.frame[place].pose, o->b);
    }
}

/* ---- the past -------------------------------------------------------------------------------- */

/* y += t H x */
static void add_times(const window *w, double t, double *y) {
    uint32_t n = 4 * w->p.n_lines;
    for (uint32_t i = 0; i < n; i++) {
        double x = w->p.line[i / 4].x[i % 4], sum = 0;
        y[i] += t * w->H[i][i] * x;
        for (uint32_t j = i + 1; j < n; j++) {
            sum += w->H[i][j] * w->p.line[j / 4].x[j % 4];
            y[j] += t * w->H[i][j] * x;
        }
        y[i] += t * sum;
    }
}

void window_retain(window *w) {
    add_times(w, -1, w->g); /* half the slope, where the lines are */
    add_frame(w, w->first, w->H, w->g);
    add_times(w, 1, w->g);
}

/* Eliminates one row. */
static void forget_row(window *w, uint32_t k, double hold) {
    uint32_t n = 4 * w->p.n_lines;
    double row[DENSE], d;
    for (uint32_t i = 0; i < n; i++)
        row[i] = i < k ? w->H[i][k] : w->H[k][i];
    d = row[k] + hold;
    row[k] = 0;
    for (uint32_t i = 0; i < n; i++) {
        double t = row[i] / d;
        dense_subtract(n - i, t, row + i, w->H[i] + i);
        w->g[i] -= t * w->g[k];
        *(i < k ? &w->H[i][k] : &w->H[k][i]) = 0;
    }
    w->g[k] = 0;
}

void window_eliminate(window *w, uint32_t line) {
    uint32_t last = w->p.n_lines - 1;
    double hold = 1 / (w->p.line[line].hold * w->p.line[line].hold);
    for (uint32_t k = 0; k < 4; k++)
        forget_row(w, 4 * line + k, hold);
    for (uint32_t k = 0; k < 4; k++) {
        uint32_t from = 4 * last + k, to = 4 * line + k;
        for (uint32_t i = 0; i < 4 * last; i++) {
            if (i / 4 == line)
                continue;
            *(i < to ? &w->H[i][to] : &w->H[to][i]) = w->H[i][from];
        }
        for (uint32_t m = k; m < 4; m++)
            w->H[to][4 * line + m] = w->H[from][4 * last + m];
        w->g[to] = w->g[from];
    }
    for (uint32_t i = 0; i < 4 * last + 4; i++)
        for (uint32_t k = 0; k < 4; k++)
            w->H[i][4 * last + k] = 0;
    memset(w->g + 4 * last, 0, 4 * sizeof *w->g);
}

/* ---- all together ---------------------------------------------------------------------------- */

static void build(window *w) {
    uint32_t n = 4 * w->p.n_lines;
    for (uint32_t i = 0; i < n; i++) {
        const adj_line *l = &w->p.line[i / 4];
        double hold = 1 / (l->hold * l->hold);
        memcpy(w->U[i] + i, w->H[i] + i, (n - i) * sizeof(double));
        w->U[i][i] += hold;
        w->step[i] = w->g[i] - hold * l->x[i % 4];
    }
    add_times(w, -1, w->step);
    for (uint32_t i = 0; i < w->n; i++)
        add_frame(w, window_place(w, i), w->U, w->step);
}

static void move(window *w) {
    for (uint32_t l = 0; l < w->p.n_lines; l++) {
        double longest = 0, *d = w->step + 4 * l, most = NEAR * w->p.line[l].hold;
        for (int k = 0; k < 4; k++)
            longest = fmax(longest, fabs(d[k]));
        for (int k = 0; k < 4; k++) {
            d[k] *= longest > most ? most / longest : 1;
            w->p.line[l].x[k] += d[k];
        }
    }
    for (uint32_t i = 0; i < w->n; i++) {
        uint32_t place = window_place(w, i);
        pose_part *o = &w->part[place];
        double d[6];
        memcpy(d, o->b, sizeof d);
        for (uint32_t k = 0; k < o->n; k++)
            for (int m = 0; m < 6; m++)
                for (uint32_t r = 0; r < 4; r++)
                    d[m] -= o->B[k][r][m] * w->step[4 * o->line[k] + r];
        solve6(o->L, d);
        adj_pose_move(&w->p.frame[place].pose, d);
    }
}

bool window_step(window *w) {
    uint32_t n = 4 * w->p.n_lines;
    build(w);
    if (!dense_factor(w->U, n))
        return false;
    dense_forward(w->U, 0, n, w->step);
    dense_backward(w->U, n, w->step);
    move(w);
    return true;
}

/* ---- covariances ----------------------------------------------------------------------------- */

/* The diagonal of C^-1 + (B C^-1)' P B C^-1 */
static void pose_variances(const window *w, uint32_t place, double v[6]) {
    const pose_part *o = &w->part[place];
    uint32_t n = 4 * w->p.n_lines;
    double Z[6][DENSE];
    memset(Z, 0, sizeof Z);
    for (uint32_t i = 0; i < o->n; i++)
        for (uint32_t k = 0; k < 4; k++) {
            double row[6];
            uint32_t at = 4 * o->line[i] + k;
            memcpy(row, o->B[i][k], sizeof row);
            solve6(o->L, row);
            for (int m = 0; m < 6; m++)
                dense_subtract(n - at, -row[m], w->V[at] + at, Z[m] + at);
        }
    for (int i = 0; i < 6; i++) {
        double e[6] = {i == 0, i == 1, i == 2, i == 3, i == 4, i == 5};
        solve6(o->L, e);
        v[i] = e[i];
        for (uint32_t j = 0; j < n; j++)
            v[i] += Z[i][j] * Z[i][j];
    }
}

void window_covariances(window *w) {
    uint32_t n = 4 * w->p.n_lines;
    for (uint32_t i = 0; i < n; i++) {
        memset(w->V[i], 0, n * sizeof(double));
        w->V[i][i] = 1;
        dense_forward(w->U, i, n, w->V[i]);
    }
    for (uint32_t i = 0; i < w->n; i++) {
        uint32_t place = window_place(w, i);
        double v[6], weight = window_pose_weight(w, place);
        if (w->n == w->params.frames && (w->time + i) % TURNS != 0 && i + 1 < w->n)
            continue;
        pose_variances(w, place, v);
        for (int k = 0; k < 6; k++)
            w->redundant[place][k] = fmax(1 - weight * adj_precision(&w->p, k, place) * v[k], 0);
    }
}

void window_line_covariance(const window *w, uint32_t line, double cov[16]) {
    uint32_t n = 4 * w->p.n_lines;
    for (uint32_t i = 0; i < 4; i++)
        for (uint32_t j = 0; j < 4; j++) {
            double sum = 0;
            for (uint32_t k = 4 * line; k < n; k++)
                sum += w->V[4 * line + i][k] * w->V[4 * line + j][k];
            cov[4 * i + j] = sum;
        }
}
