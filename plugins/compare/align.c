/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * align.c: the rigid motion from the nominal to the lines.
 */
#include "align.h"

#include <math.h>
#include <string.h>

#include "arris_geometry.h"
#include "invert.h"

static const double LEAST = 1e-3; /* mm, of the spread by which the edges do not fit */
static const double OUTER = 9;    /* squared distances, in that spread, that weigh half or less */
enum { STEPS = 40 };

void place_identity(place *w, const nominal *m) {
    double size = 0;
    *w = (place){.R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    for (uint32_t i = 0; i < m->n_edges; i++)
        for (int k = 0; k < 3; k++)
            w->c[k] += (m->edge[i].p[k] + m->edge[i].q[k]) / 2 / m->n_edges;
    for (uint32_t i = 0; i < m->n_edges; i++)
        for (int k = 0; k < 3; k++)
            size = fmax(size, fabs(m->edge[i].p[k] - w->c[k]));
    w->size = fmax(size, 1);
}

/* The weight matrix of a piece: the inverse of its covariance with the spread, times its weight. */
static void weigh(const piece *e, double form, double W[4][4]) {
    memcpy(W, e->cov, sizeof e->cov);
    for (int i = 0; i < 4; i++)
        W[i][i] += form;
    if (!invert(&W[0][0], 4, 4))
        memset(W, 0, sizeof e->cov);
    for (int i = 0; i < 4; i++)
        for (int k = 0; k < 4; k++)
            W[i][k] *= e->weight;
}

/* JW = J' W, 6 rows of 4. */
static void transpose_times(const double J[4][6], const double W[4][4], double JW[6][4]) {
    for (int i = 0; i < 6; i++)
        for (int k = 0; k < 4; k++) {
            JW[i][k] = 0;
            for (int m = 0; m < 4; m++)
                JW[i][k] += J[m][i] * W[m][k];
        }
}

/* G = A^-1 J' W: what a piece's noise does to the motion. */
static void gain(const place *w, const piece *e, const double J[4][6], double G[6][4]) {
    double W[4][4], JW[6][4];
    weigh(e, w->form, W);
    transpose_times(J, (const double(*)[4])W, JW);
    for (int i = 0; i < 6; i++)
        for (int k = 0; k < 4; k++) {
            G[i][k] = 0;
            for (int m = 0; m < 6; m++)
                G[i][k] += w->inverse[i][m] * JW[m][k];
        }
}

/* R becomes turn(v) R, by Rodrigues' formula. */
static void turn(double R[9], const double v[3]) {
    double k[3] = {v[0], v[1], v[2]}, angle = arris_unit(k), old[9];
    double c = cos(angle), s = sin(angle);
    memcpy(old, R, sizeof old);
    if (!(angle > 0))
        return;
    double T[9] = {c + k[0] * k[0] * (1 - c),        k[0] * k[1] * (1 - c) - k[2] * s,
                   k[0] * k[2] * (1 - c) + k[1] * s, k[0] * k[1] * (1 - c) + k[2] * s,
                   c + k[1] * k[1] * (1 - c),        k[1] * k[2] * (1 - c) - k[0] * s,
                   k[0] * k[2] * (1 - c) - k[1] * s, k[1] * k[2] * (1 - c) + k[0] * s,
                   c + k[2] * k[2] * (1 - c)};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            R[3 * i + j] =
                T[3 * i] * old[j] + T[3 * i + 1] * old[3 + j] + T[3 * i + 2] * old[6 + j];
}

static double square(const double d[4]) {
    return d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + d[3] * d[3];
}

/* Weights by the distances, and the spread by the weights; it narrows to 0.7 of itself at most. */
static uint32_t reweigh(place *w, piece *e, uint32_t n, const bool *use, bool first) {
    double sum = 0, weights = 0;
    uint32_t used = 0;
    for (uint32_t i = 0; i < n; i++) {
        double far = square(e[i].d) / 4 / (OUTER * w->form), f = 1 / (1 + far);
        e[i].weight = e[i].line < 0 || (use && !use[i]) ? 0 : first ? 1 : f * f;
        sum += e[i].weight * square(e[i].d) / 4;
        weights += e[i].weight;
        used += e[i].weight > 0;
    }
    if (weights > 0)
        w->form = fmax(LEAST * LEAST, fmax(0.5 * w->form, sum / weights));
    return used;
}

/* One step of Gauss-Newton; `moved` is the motion so far, in parameters, about which the search is
 * the prior. Returns the step's length, mm. */
static double step(place *w, const piece *e, uint32_t n, double search, double moved[6]) {
    double b[6], x[6] = {0}, length = 0;
    memset(w->inverse, 0, sizeof w->inverse);
    for (int i = 0; i < 6; i++) {
        w->inverse[i][i] = 1 / (search * search);
        b[i] = -moved[i] / (search * search);
    }
    for (uint32_t i = 0; i < n; i++) {
        double J[4][6], W[4][4], JW[6][4];
        if (!(e[i].weight > 0))
            continue;
        piece_jacobian(&e[i], w, J);
        weigh(&e[i], w->form, W);
        transpose_times((const double(*)[6])J, (const double(*)[4])W, JW);
        for (int r = 0; r < 6; r++)
            for (int k = 0; k < 4; k++) {
                b[r] -= JW[r][k] * e[i].d[k];
                for (int c = 0; c < 6; c++)
                    w->inverse[r][c] += JW[r][k] * J[k][c];
            }
    }
    if (!invert(&w->inverse[0][0], 6, 6))
        memset(w->inverse, 0, sizeof w->inverse);
    for (int i = 0; i < 6; i++) {
        for (int k = 0; k < 6; k++)
            x[i] += w->inverse[i][k] * b[k];
        moved[i] += x[i];
        length += x[i] * x[i];
    }
    double v[3] = {x[0] / w->size, x[1] / w->size, x[2] / w->size};
    turn(w->R, v);
    for (int i = 0; i < 3; i++)
        w->t[i] += x[3 + i];
    return sqrt(length);
}

/* cov = sum of G C G', and what the prior leaves. */
static void propagate(place *w, const piece *e, uint32_t n, double search) {
    for (int i = 0; i < 6; i++)
        for (int k = 0; k < 6; k++) {
            w->cov[i][k] = 0;
            for (int m = 0; m < 6; m++)
                w->cov[i][k] += w->inverse[i][m] * w->inverse[m][k] / (search * search);
        }
    for (uint32_t p = 0; p < n; p++) {
        double J[4][6], G[6][4], GC[6][4] = {{0}};
        if (!(e[p].weight > 0))
            continue;
        piece_jacobian(&e[p], w, J);
        gain(w, &e[p], (const double(*)[6])J, G);
        for (int i = 0; i < 6; i++)
            for (int k = 0; k < 4; k++)
                for (int m = 0; m < 4; m++)
                    GC[i][k] += G[i][m] * e[p].cov[m][k];
        for (int i = 0; i < 6; i++)
            for (int k = 0; k < 6; k++)
                for (int m = 0; m < 4; m++)
                    w->cov[i][k] += GC[i][m] * G[k][m];
    }
}

static void rematch(const place *w, const nominal *m, piece *e, const arris_lines *lines,
                    double search, candidates *c, int32_t *owner) {
    for (uint32_t i = 0; i < m->n_edges; i++) {
        double weight = e[i].weight;
        piece_place(&e[i], &m->edge[i], w);
        e[i].weight = weight;
    }
    match(e, m->n_edges, lines, search, c, owner);
}

uint32_t align(place *where, const nominal *m, piece *e, const bool *use, const arris_lines *lines,
               double search, candidates *c, int32_t *owner) {
    double moved[6] = {0}, form = 0;
    uint32_t used = 0;
    where->form = search * search;
    rematch(where, m, e, lines, search, c, owner);
    for (int i = 0; i < STEPS; i++) {
        used = reweigh(where, e, m->n_edges, use, i == 0);
        if (used == 0)
            return 0;
        double length = step(where, e, m->n_edges, search, moved);
        rematch(where, m, e, lines, search, c, owner);
        if (length < 1e-6 && fabs(where->form - form) <= 1e-3 * form)
            break;
        form = where->form;
    }
    propagate(where, e, m->n_edges, search);
    return used;
}

void align_spread(const place *where, piece *e) {
    double J[4][6], JG[4][4] = {{0}}, G[6][4] = {{0}}, add[4][4] = {{0}};
    piece_jacobian(e, where, J);
    if (e->weight > 0)
        gain(where, e, (const double(*)[6])J, G);
    for (int i = 0; i < 4 && e->weight > 0; i++)
        for (int k = 0; k < 4; k++)
            for (int m = 0; m < 6; m++)
                JG[i][k] += J[i][m] * G[m][k];
    for (int i = 0; i < 4; i++)
        for (int k = 0; k < 4; k++) {
            for (int m = 0; m < 4; m++)
                add[i][k] -= JG[i][m] * e->cov[m][k] + e->cov[i][m] * JG[k][m];
            for (int m = 0; m < 6; m++)
                for (int n = 0; n < 6; n++)
                    add[i][k] += J[i][m] * where->cov[m][n] * J[k][n];
        }
    for (int i = 0; i < 4; i++)
        for (int k = 0; k < 4; k++)
            e->cov[i][k] += add[i][k];
}
