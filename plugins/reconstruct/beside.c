/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * beside.c: takes out of a line's views what lies beside its edge. A face that is seen almost from
 * its edge is a band too narrow to be resolved. It moves the edge by up to a tenth of a pixel, and
 * by what changes with the view, so that it passes for depth and no residual tells of it. But what
 * is on one side of a step, whatever it is, lies under one tail of the blur: it moves the step and
 * changes its blur together, by about the same (RATIO), towards that side where it widens it. An
 * edge's blur is the same in all its views. So by how much that of a view differs from the others'
 * tells how far the view is off, once it is known which side it comes from: there what is no part
 * of a step changes from view to view, too.
 */
#include <math.h>

#include "line.h"

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

/* What the kept views of a line tell of their blur and of what is beside them. */
typedef struct sides {
    series blur, beside[2];
    double least, most; /* px of blur, smoothed */
} sides;

static sides look(const line *l) {
    sides u = {.least = (double)INFINITY};
    double smooth = 0;
    for (uint32_t i = 0; i < l->n_kept; i++) {
        const view *v = &l->kept[i];
        if (!l->inlier[i] || !(v->blur > 0))
            continue;
        add(&u.blur, (double)v->blur);
        for (int side = 0; side < 2; side++)
            add(&u.beside[side], (double)v->beside[side]);
        smooth += ((double)v->blur - smooth) / fmin(u.blur.n, SMOOTH);
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

double line_blur(const line *l, double *weight) {
    sides u = look(l);
    bool steady = u.blur.n >= LEAST && noise_of(&u.blur) > 0 && fabs(side_of(&u)) < SLIGHT;
    *weight = steady ? 1 / (noise_of(&u.blur) + signal_of(&u.blur)) : 0;
    return u.blur.mean;
}

/* The part of a view's blur that is not the edge's `own` by more than chance, as those before and
 * after it say; a share of what it is wider by. */
static double disturbed(const line *l, uint32_t i, double own, double noise) {
    double n = 0, sum = 0;
    for (uint32_t k = i > NEAR ? i - NEAR : 0; k <= i + NEAR && k < l->n_kept; k++)
        if (l->inlier[k] && l->kept[k].blur > 0)
            n++, sum += (double)l->kept[k].blur - own;
    return n > 0 ? fmax(1 - STRAY * STRAY * noise * n / (sum * sum), 0) : 0;
}

/* A view as one that is `px` to its right, where that is so unsure; the views that are not kept
 * with it likewise. */
static void move(line *l, uint32_t i, const scene *s, double px, double variance, double share) {
    pose_noise reported = s->noise;
    linear r;
    double before = l->kept[i].cov[0];
    reported.corrected = false;
    if (l->rest[i].n > 0 && view_linearise(&l->kept[i], &l->f, l->x, &reported, &r)) {
        info_move(&l->rest[i], &r, l->x, px);
        info_weigh(&l->rest[i], before / (before + variance));
    }
    view_move(&l->kept[i], px, variance, share);
}

void line_clear(line *l, const scene *s, double usual) {
    sides u = look(l);
    double share = side_of(&u), ratio = RATIO * share, noise = noise_of(&u.blur);
    if (fabs(share) < SLIGHT)
        return;
    double own = usual > 0 ? fmax(u.least, fmin(u.most, usual)) : u.blur.mean;
    for (uint32_t i = 0; i < l->n_kept; i++) {
        const view *v = &l->kept[i];
        double part = v->blur > 0 ? disturbed(l, i, own, noise) : 0;
        double wider = part * ((double)v->blur - own), known = part * part * noise;
        double doubt = v->blur > 0 ? UNSURE * UNSURE * wider * wider : signal_of(&u.blur);
        if (known + doubt > 0)
            move(l, i, s, ratio * wider, ratio * ratio * (known + doubt), doubt / (known + doubt));
    }
    line_refine(l, s);
}
