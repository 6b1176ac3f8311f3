/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * inverse.c: the inverse of the lens model by Newton's method, eight points at once.
 *
 * It starts from another lens of the same model, fitted so that it nearly undoes this one, and
 * takes as many steps as are needed: one for common lenses. Where no number of them is enough, or
 * may end beyond the fold of an extreme lens, points go through arris_undistort instead: the
 * corners of all cells of a grid are tried beforehand.
 */
#include "inverse.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "arris_geometry.h"
#include "invert.h"
#include "lens.h"

enum { PITCH = 16, MOST_STEPS = 3, TERMS = 5 }; /* PITCH: px from corner to corner */
static const double TOLERANCE = 1e-4;           /* px */
/* px: after so small a step the next would not show; near a fold */
static const float SMALL = 0.5f, SMALLER = 0.01f;

struct inverse {
    arris_camera camera;
    lens lens, back; /* back: where to start from, by the distorted point */
    int steps;
    float small;       /* px, at most, is the last of them */
    int columns, rows; /* of cells */
    bool *bad;         /* by corner */
    bool any_bad;
};

/* Moves eight points to where an ideal camera sees them. Tells which of them got there. */
INLINE void solve(const inverse *inv, eight *u, eight *v, eight_ints *good) {
    const lens *c = &inv->lens;
    eight x, y, d[2], J[3], q[2], sx = {0}, sy = {0};
    lens_normalise(c, u, v, &x, &y);
    lens_displace(&inv->back, &x, &y, q, J);
    *good = (eight_ints){0} - 1;
    for (int i = 0; i < inv->steps; i++) {
        eight ax = x + q[0], ay = y + q[1];
        lens_displace(c, &ax, &ay, d, J);
        J[0] += 1, J[2] += 1;
        eight det = J[0] * J[2] - J[1] * J[1], ex = q[0] + d[0], ey = q[1] + d[1], one = 1 / det;
        sx = (J[2] * ex - J[1] * ey) * one, sy = (J[0] * ey - J[1] * ex) * one;
        q[0] -= sx, q[1] -= sy;
        *good &= det > 0;
    }
    sx *= c->fx, sy *= c->fy;
    *good &= (EIGHT_ABS(sx) < inv->small) & (EIGHT_ABS(sy) < inv->small);
    *u += c->fx * q[0] + c->skew * q[1];
    *v += c->fy * q[1];
}

static bool solve_exactly(const inverse *inv, float *x, float *y) {
    double ideal_x, ideal_y;
    if (arris_undistort(&inv->camera, (double)*x, (double)*y, &ideal_x, &ideal_y))
        return false;
    *x = (float)ideal_x;
    *y = (float)ideal_y;
    return true;
}

/* Whether a corner of the cell of a point in the picture is bad. */
static bool near_bad(const inverse *inv, float x, float y) {
    const bool *cell = inv->bad + (int)y / PITCH * (inv->columns + 1) + (int)x / PITCH;
    return cell[0] || cell[1] || cell[inv->columns + 1] || cell[inv->columns + 2];
}

/* Of eight points those that are not good, one by one. Returns how many have no inverse: their x
 * becomes NAN. */
__attribute__((noinline)) static uint32_t mend(const inverse *inv, const arris_edge_point *in,
                                               const int32_t *good, arris_edge_point *out) {
    static const int lane[LANES] = {0, 4, 1, 5, 2, 6, 3, 7};
    uint32_t dropped = 0;
    for (uint32_t k = 0; k < LANES; k++) {
        arris_edge_point p = in[k];
        if (good[lane[k]] && !(inv->any_bad && near_bad(inv, p.x, p.y)))
            continue;
        if (!solve_exactly(inv, &p.x, &p.y))
            p.x = NAN, dropped++;
        out[k] = p;
    }
    return dropped;
}

/* Moves eight points; x becomes NAN where there is no inverse. Returns how often that was. The even
 * points are the first four lanes. */
INLINE uint32_t move(const inverse *inv, const arris_edge_point in[LANES],
                     arris_edge_point out[LANES]) {
    float right = (float)(inv->camera.width - 1), bottom = (float)(inv->camera.height - 1);
    eight p[4], xy[2], x, y;
    eight_ints good, inside;
    for (int k = 0; k < 4; k++)
        eight_load(&in[2 * k], &p[k]);
    for (int k = 0; k < 2; k++)
        xy[k] = __builtin_shufflevector(p[2 * k], p[2 * k + 1], 0, 1, 8, 9, 4, 5, 12, 13);
    x = __builtin_shufflevector(xy[0], xy[1], 0, 2, 8, 10, 4, 6, 12, 14);
    y = __builtin_shufflevector(xy[0], xy[1], 1, 3, 9, 11, 5, 7, 13, 15);
    inside = (x >= 0) & (y >= 0) & (x <= right) & (y <= bottom);
    solve(inv, &x, &y, &good);
    good &= inside;
    xy[0] = __builtin_shufflevector(x, y, 0, 8, 1, 9, 4, 12, 5, 13);
    xy[1] = __builtin_shufflevector(x, y, 2, 10, 3, 11, 6, 14, 7, 15);
    for (int k = 0; k < 2; k++) {
        p[2 * k] = __builtin_shufflevector(xy[k], p[2 * k], 0, 1, 10, 11, 4, 5, 14, 15);
        p[2 * k + 1] = __builtin_shufflevector(xy[k], p[2 * k + 1], 2, 3, 10, 11, 6, 7, 14, 15);
    }
    for (int k = 0; k < 4; k++)
        memcpy(&out[2 * k], &p[k], sizeof p[k]);
    return inv->any_bad || !eight_all(&good) ? mend(inv, in, (const int32_t *)&good, out) : 0;
}

INLINE uint32_t move_all(const inverse *inv, const arris_edge_point *in, uint32_t n,
                         arris_edge_point *out) {
    uint32_t dropped = 0, i = 0;
    for (; i + LANES <= n; i += LANES)
        dropped += move(inv, in + i, out + i);
    if (i == n)
        return dropped;
    arris_edge_point from[LANES], to[LANES];
    for (uint32_t k = 0; k < LANES; k++)
        from[k] = in[i + k < n ? i + k : i];
    move(inv, from, to);
    for (uint32_t k = 0; i < n; i++, k++) {
        out[i] = to[k];
        dropped += isnan(to[k].x);
    }
    return dropped;
}

static uint32_t move_portable(const inverse *inv, const arris_edge_point *in, uint32_t n,
                              arris_edge_point *out) {
    return move_all(inv, in, n, out);
}

AVX2_PATH static uint32_t move_avx2(const inverse *inv, const arris_edge_point *in, uint32_t n,
                                    arris_edge_point *out) {
    return move_all(inv, in, n, out);
}

static uint32_t move_points(const inverse *inv, const arris_edge_point *in, uint32_t n,
                            arris_edge_point *out) {
    return (HAS_AVX2 ? move_avx2 : move_portable)(inv, in, n, out);
}

bool inverse_point(const inverse *inv, float *x, float *y) {
    arris_edge_point p = {.x = *x, .y = *y}, to;
    if (move_points(inv, &p, 1, &to))
        return false;
    *x = to.x, *y = to.y;
    return true;
}

/* ---- the grid ------------------------------------------------------------------------------- */

/* The corner of the cells in column i and row j, px. */
static void corner(const inverse *inv, int i, int j, double *u, double *v) {
    *u = fmin(PITCH * i, inv->camera.width - 1);
    *v = fmin(PITCH * j, inv->camera.height - 1);
}

/* Adds to the normal equations that the terms should make up q. */
static void add_equation(const double term[TERMS], double q, double N[TERMS * TERMS],
                         double b[TERMS]) {
    for (int k = 0; k < TERMS; k++) {
        b[k] += term[k] * q;
        for (int l = 0; l < TERMS; l++)
            N[TERMS * k + l] += term[k] * term[l];
    }
}

/* Fits the lens `back` to what undoes the lens at the corners, by least squares. False when that is
 * not determined. */
static bool fit_back(inverse *inv) {
    const arris_camera *c = &inv->camera;
    double N[TERMS * TERMS] = {0}, b[TERMS] = {0}, k[TERMS] = {0}, u, v, iu, iv;
    for (int j = 0; j <= inv->rows; j++)
        for (int i = 0; i <= inv->columns; i++) {
            corner(inv, i, j, &u, &v);
            if (arris_undistort(c, u, v, &iu, &iv))
                continue;
            double y = (v - c->cy) / c->fy, x = (u - c->cx - c->skew * y) / c->fx;
            double qy = (iv - v) / c->fy, qx = (iu - u - c->skew * qy) / c->fx;
            double xx = x * x, yy = y * y, xy = x * y, r2 = xx + yy, r4 = r2 * r2, r6 = r2 * r4;
            add_equation((double[]){x * r2, x * r4, x * r6, 2 * xy, r2 + 2 * xx}, qx, N, b);
            add_equation((double[]){y * r2, y * r4, y * r6, r2 + 2 * yy, 2 * xy}, qy, N, b);
        }
    if (!invert(N, TERMS, TERMS))
        return false;
    for (int i = 0; i < TERMS * TERMS; i++)
        k[i / TERMS] += N[i] * b[i % TERMS];
    inv->back = (lens){.k1 = (float)k[0],
                       .k2 = (float)k[1],
                       .k3 = (float)k[2],
                       .p1 = (float)k[3],
                       .p2 = (float)k[4]};
    return true;
}

/* Finds the bad corners: where there is no inverse, or the solution is not what it claims to be.
 * Returns whether all are solved. */
static bool try_corners(inverse *inv) {
    bool all = true;
    inv->any_bad = false;
    for (int j = 0; j <= inv->rows; j++)
        for (int i = 0; i <= inv->columns; i++) {
            double u, v, x, y;
            corner(inv, i, j, &u, &v);
            bool there = arris_undistort(&inv->camera, u, v, &x, &y) == 0;
            eight a = (eight){0} + (float)u, b = (eight){0} + (float)v;
            eight_ints good;
            solve(inv, &a, &b, &good);
            double off = hypot((double)a[0] - x, (double)b[0] - y);
            bool bad = !there || (good[0] && !(off < TOLERANCE + 1e-7 * fabs(u + v)));
            inv->bad[j * (inv->columns + 1) + i] = bad;
            inv->any_bad |= bad;
            all &= good[0] && !bad;
        }
    return all;
}

/* Sets where to start from and how many steps to take. An extreme lens's own displacement is the
 * better start, as what is fitted to all of it is good nowhere. */
static void choose_start(inverse *inv) {
    inv->small = SMALL;
    if (fit_back(inv))
        for (inv->steps = 1; inv->steps < MOST_STEPS; inv->steps++)
            if (try_corners(inv))
                return;
    const lens *c = &inv->lens;
    inv->back = (lens){.k1 = -c->k1, .k2 = -c->k2, .k3 = -c->k3, .p1 = -c->p1, .p2 = -c->p2};
    inv->steps = MOST_STEPS, inv->small = SMALLER;
    try_corners(inv);
}

inverse *inverse_new(const arris_camera *camera) {
    inverse *inv = calloc(1, sizeof *inv);
    if (!inv)
        return NULL;
    inv->camera = *camera;
    inv->lens = lens_of(camera);
    inv->columns = (camera->width - 1) / PITCH + 1;
    inv->rows = (camera->height - 1) / PITCH + 1;
    inv->bad = calloc((size_t)(inv->columns + 1) * (inv->rows + 1), sizeof *inv->bad);
    if (!inv->bad) {
        inverse_free(inv);
        return NULL;
    }
    choose_start(inv);
    return inv;
}

void inverse_free(inverse *inv) {
    if (!inv)
        return;
    free(inv->bad);
    free(inv);
}

/* ---- chains --------------------------------------------------------------------------------- */

/* Closes the chain whose points start at `first`; one that doesn't fit is lost. */
static void end_chain(arris_edges *out, uint32_t first, bool closed) {
    uint32_t n = out->n - first;
    if (n && out->n_chains < out->max_chains) {
        out->chain[out->n_chains++] = (arris_chain){first, n, closed};
    } else if (n) {
        out->lost_chains++;
        out->lost += n;
        out->n = first;
    }
}

/* Takes up the n points behind those of `out`, of which some have no inverse. */
static void split_chain(arris_edges *out, uint32_t n) {
    uint32_t first = out->n;
    for (const arris_edge_point *p = out->point + out->n, *end = p + n; p < end; p++) {
        if (!isnan(p->x)) {
            out->point[out->n++] = *p;
            continue;
        }
        end_chain(out, first, false);
        first = out->n;
    }
    end_chain(out, first, false);
}

static uint32_t undistort_chain(const inverse *inv, const arris_edges *in, const arris_chain *c,
                                arris_edges *out) {
    uint32_t first = out->n, room = out->max - out->n, n = c->n < room ? c->n : room;
    uint32_t dropped = move_points(inv, in->point + c->first, n, out->point + first);
    out->lost += c->n - n;
    if (dropped > 0) {
        split_chain(out, n);
        return dropped;
    }
    out->n += n;
    end_chain(out, first, c->closed && n == c->n);
    return 0;
}

uint32_t inverse_edges(const inverse *inv, const arris_edges *in, const arris_camera *ideal,
                       arris_edges *out) {
    uint32_t dropped = 0;
    out->n = out->n_chains = 0;
    out->lost = in->lost;
    out->lost_chains = in->lost_chains;
    out->noise = in->noise;
    out->camera = ideal;
    if (in->n <= out->max && in->n_chains <= out->max_chains &&
        move_points(inv, in->point, in->n, out->point) == 0) {
        memcpy(out->chain, in->chain, in->n_chains * sizeof *in->chain);
        out->n = in->n;
        out->n_chains = in->n_chains;
        return 0;
    }
    for (uint32_t i = 0; i < in->n_chains; i++)
        dropped += undistort_chain(inv, in, &in->chain[i], out);
    return dropped;
}
