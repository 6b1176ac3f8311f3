/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * beside.c: finds what lies beside edges (beside.h).
 */
#include "beside.h"

#include <math.h>

static const double RATIO = 1.1; /* px of the step for one of its blur, of bands 0.5 to 5 px wide */
static const double UNSURE = 0.5; /* sigma of that, as a share */
static const double CHANCE = 3;   /* sigma of changes that are none */
static const double SLIGHT = 0.1; /* share of what it might be, that is not worth it */
static const double STRAY = 2;    /* sigma of a mean of neighbouring views that may be chance */
enum {
    LEAST = 12, /* views that tell of their blur */
    SMOOTH = 6, /* that are averaged for the range of it */
    NEAR = 2    /* before a view and after it, that have to agree with it */
};

/* A number that was seen in some views, one after another. */
typedef struct series {
    double n, mean, squares, last, steps; /* of the steps: the squares */
} series;

static void add(series *a, double value) {
    double d = value - a->mean;
    a->n++;
    a->mean += d / a->n;
    a->squares += d * (value - a->mean);
    a->steps += a->n > 1 ? (value - a->last) * (value - a->last) : 0;
    a->last = value;
}

/* The variance of its noise, which is new in every view, by the steps (von Neumann 1941). */
static double noise_of(const series *a) {
    return a->steps / (2 * (a->n - 1));
}

/* The variance of what changes slowly. */
static double signal_of(const series *a) {
    return fmax(a->squares / (a->n - 1) - noise_of(a), 0);
}

/* Which of that is no chance. */
static double evident(const series *a) {
    double z = signal_of(a) / noise_of(a) * sqrt(a->n) / CHANCE;
    return z > 1 ? 1 - 1 / (z * z) : 0;
}

/* What the views of a line tell of their blur and of what is beside them. */
typedef struct sides {
    series blur, beside[2];
    double least, most; /* px of blur, smoothed */
} sides;

static sides look(const beside_view *v, uint32_t n) {
    sides u = {.least = (double)INFINITY};
    double smooth = 0;
    for (uint32_t i = 0; i < n; i++) {
        if (!v[i].counts || !(v[i].blur > 0))
            continue;
        add(&u.blur, v[i].blur);
        for (int side = 0; side < 2; side++)
            add(&u.beside[side], v[i].other[side]);
        smooth += (v[i].blur - smooth) / fmin(u.blur.n, SMOOTH);
        if (u.blur.n >= SMOOTH)
            u.least = fmin(u.least, smooth), u.most = fmax(u.most, smooth);
    }
    return u;
}

/* From -1 to 1: how surely something moves the line, from its right or from its left. */
static double side_of(const sides *u) {
    if (u->blur.n < LEAST || !(noise_of(&u->blur) > 0))
        return 0;
    double left = signal_of(&u->beside[0]), right = signal_of(&u->beside[1]);
    double side = (left * left - right * right) / (left * left + right * right + 1);
    return side * evident(&u->blur);
}

double beside_blur(const beside_view *v, uint32_t n, double *weight) {
    sides u = look(v, n);
    bool steady = u.blur.n >= LEAST && noise_of(&u.blur) > 0 && fabs(side_of(&u)) < SLIGHT;
    *weight = steady ? 1 / (noise_of(&u.blur) + signal_of(&u.blur)) : 0;
    return u.blur.mean;
}

/* The part of a view's blur that is not the edge's `own` by more than chance, as those before and
 * after it say; a share of what it is wider by. */
static double disturbed(const beside_view *v, uint32_t n, uint32_t i, double own, double noise) {
    double count = 0, sum = 0;
    for (uint32_t k = i > NEAR ? i - NEAR : 0; k <= i + NEAR && k < n; k++)
        if (v[k].counts && v[k].blur > 0)
            count++, sum += v[k].blur - own;
    return count > 0 ? fmax(1 - STRAY * STRAY * noise * count / (sum * sum), 0) : 0;
}

bool beside_find(const beside_view *v, uint32_t n, double usual, beside_move *move) {
    sides u = look(v, n);
    double share = side_of(&u), ratio = RATIO * share, noise = noise_of(&u.blur);
    if (fabs(share) < SLIGHT)
        return false;
    double own = usual > 0 ? fmax(u.least, fmin(u.most, usual)) : u.blur.mean;
    for (uint32_t i = 0; i < n; i++) {
        double part = v[i].blur > 0 ? disturbed(v, n, i, own, noise) : 0;
        double wider = part * (v[i].blur - own), known = part * part * noise;
        double doubt = v[i].blur > 0 ? UNSURE * UNSURE * wider * wider : signal_of(&u.blur);
        double all = known + doubt;
        move[i] = (beside_move){ratio * wider, ratio * ratio * all, all > 0 ? doubt / all : 0};
    }
    return true;
}
