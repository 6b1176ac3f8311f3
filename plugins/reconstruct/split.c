/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * split.c: parts a line whose track went over to another edge nearby, for good or for a while. Of
 * all runs of successive views that one is found which makes two lines explain the views best, one
 * those of the run, one all others (circular binary segmentation, Olshen 2004). The one of the two
 * that is the more certain is the line. What the others saw is another line when that is some way
 * off; else it is this one, seen worse, as where the face behind an edge comes into sight too
 * narrow to be resolved.
 */
#include <math.h>
#include <string.h>

#include "line.h"

static const double ELSEWHERE = 0.12; /* px, rms, from the line where another line is seen */
static const double RESOLVED = 2;     /* px: edges that are farther apart do not move each other */
static const double SHARE = 0.5;      /* of the distance between them, by which they do, at most */
static const double LEFT = 0.35;   /* of what moved a line in views that are dropped, in others */
static const double REACH = 3;     /* px: what is farther off is of something else */
static const double WORTH = 0.7;   /* dropping views must bring the square error to this share */
static const double CLEAR = 2;     /* and they be this much worse, in variance */
static const double OTHER = 0.5;   /* of the contrast, by which levels of two surfaces differ */
static const double STRAYS = 0.33; /* of the views may have either level, in passing */
enum { LEAST = 4, STEP = 2 };      /* kept views of a run; steps of its search */

/* ---- which run ------------------------------------------------------------------------------ */

/* sum[j] - sum[i] is of the groups i .. j - 1 of n. */
typedef struct sums {
    info sum[LINE_KEPT + 1];
    uint32_t n;
    double hold; /* added to the information, so that a short run has some */
} sums;

typedef struct run {
    uint32_t from, to;
    double gain; /* of chi-square, over what is left for a number */
} run;

/* Of every kept view, also those that do not take part. */
static void add_up(sums *u, const line *l, const scene *s) {
    linear r;
    u->sum[0] = (info){0};
    for (uint32_t i = 0; i < l->n_kept; i++) {
        u->sum[i + 1] = u->sum[i];
        if (view_linearise(&l->kept[i], &l->f, l->x, &s->noise, &r) && fabs(r.r[0]) < REACH &&
            fabs(r.r[1]) < REACH)
            info_add(&u->sum[i + 1], &r, l->x);
    }
    u->n = l->n_kept;
    u->hold = 1 / (l->depth * l->depth);
}

/* a - b */
static info difference(const info *a, const info *b) {
    info d = *a;
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++)
            d.H.m[i][j] -= b->H.m[i][j];
        d.g[i] -= b->g[i];
    }
    d.c -= b->c;
    d.n -= b->n;
    return d;
}

/* chi-square about its own line, which goes to x. */
static double misfit(const info *in, double hold, double x[4]) {
    mat4 held = in->H, C;
    for (int i = 0; i < 4; i++)
        held.m[i][i] += hold;
    if (!mat4_invert(&held, &C))
        return 0;
    mat4_times(&C, in->g, x);
    return info_chi2(in, x);
}

/* The lines x of the run and y of the rest, and their chi-square. */
static double two_lines(const sums *u, uint32_t from, uint32_t to, double x[4], double y[4]) {
    info in = difference(&u->sum[to], &u->sum[from]), out = difference(&u->sum[u->n], &in);
    return misfit(&in, u->hold, x) + misfit(&out, u->hold, y);
}

/* The run that explains most, at the beginning when `at_end`. */
static run find_run(const sums *u, double usual, bool at_end) {
    double x[4], y[4], whole = misfit(&u->sum[u->n], u->hold, x), least = whole;
    double dof = 2.0 * u->sum[u->n].n - 8;
    run best = {0};
    for (uint32_t i = 0; i + LEAST <= u->n; i += at_end ? u->n : STEP)
        for (uint32_t j = i + LEAST; j <= u->n && j - i + LEAST <= u->n; j += at_end ? 1 : STEP) {
            double two = two_lines(u, i, j, x, y);
            if (two < least)
                least = two, best.from = i, best.to = j;
        }
    best.gain = dof > 0 ? (whole - least) / fmax(usual, least / dof) : 0;
    return best;
}

/* ---- two lines ------------------------------------------------------------------------------ */

/* Of the kept views those of the run, or all but those. */
static void choose(line *l, const run *r, bool within) {
    if (within) {
        line_forget(l, r->to, l->n_kept);
        line_forget(l, 0, r->from);
    } else {
        line_forget(l, r->from, r->to);
    }
}

/* The line from the run or the rest, beginning at x. */
static void part_of(line *part, const line *l, const scene *s, const run *r, bool within,
                    const double x[4]) {
    memcpy(part, l, sizeof *l);
    choose(part, r, within);
    line_resume(part, s, x);
}

/* The mean square of the line's distances from the segments of the views that `of` keeps, in px²;
 * *variances is that over the stated ones. */
static double off(const line *l, const line *of, const scene *s, double *variances) {
    double squares = 0, weighted = 0;
    uint32_t n = 0;
    linear r;
    for (uint32_t i = 0; i < of->n_kept; i++)
        if (view_linearise(&of->kept[i], &l->f, l->x, &s->noise, &r)) {
            squares += r.r[0] * r.r[0] + r.r[1] * r.r[1];
            weighted += linear_distance(&r, NULL);
            n += 2;
        }
    *variances = n ? weighted / n : 0;
    return n ? squares / n : 0;
}

/* Whether what b saw is another edge than a. When the two are too near to be told apart, either
 * moves the other in the picture by a share of what is between them. */
static bool elsewhere(const line *a, line *b, const scene *s) {
    double variances, rest, away = off(a, b, s, &variances), own = off(b, b, s, &rest);
    if (!b->settled || away < ELSEWHERE * ELSEWHERE || away < 4 * own || line_same(a, b, s, false))
        return false;
    b->parted = away < RESOLVED * RESOLVED;
    b->blend = b->parted ? SHARE * SHARE * variances : 0;
    return true;
}

/* The longest run of kept views that do not take part. */
static run find_rejected(const line *l) {
    run longest = {0};
    for (uint32_t i = 0, n = 0; i < l->n_kept; i++) {
        n = l->inlier[i] ? 0 : n + 1;
        if (n > longest.to - longest.from)
            longest.from = i + 1 - n, longest.to = i + 1;
    }
    return longest;
}

/* The variance of the worse end of a line from its kept views. */
static double uncertainty(const line *l, const scene *s) {
    info group[LINE_KEPT];
    mat4 C;
    line_groups(l, s, group);
    double v = line_disagreement(group, l->n_kept, s->scale, &C);
    return l->settled && v > 0
               ? fmax(v, s->scale) * fmax(C.m[0][0] + C.m[1][1], C.m[2][2] + C.m[3][3])
               : (double)INFINITY;
}

/* The lines of the run and of the rest, beginning at x and y; the more certain one goes to *best.
 */
static void part(const line *l, const scene *s, const run *r, const double x[4], const double y[4],
                 line *best, line *other) {
    part_of(best, l, s, r, true, x);
    part_of(other, l, s, r, false, y);
    if (uncertainty(best, s) <= uncertainty(other, s))
        return;
    part_of(best, l, s, r, false, y);
    part_of(other, l, s, r, true, x);
}

/* Likewise, of views that contradict each other. */
static void part_contradicting(const line *l, const scene *s, const sums *u, const run *r,
                               line *best, line *other) {
    double x[4], y[4];
    two_lines(u, r->from, r->to, x, y);
    part(l, s, r, x, y, best, other);
}

/* Those that do not take part saw another edge, out of the line's reach. */
static bool part_rejected(line *l, line *other, const scene *s) {
    run r = find_rejected(l);
    line best;
    if (r.to - r.from < 2 * LEAST)
        return false;
    part(l, s, &r, NULL, l->x, &best, other);
    if (!elsewhere(&best, other, s))
        return false;
    memcpy(l, &best, sizeof *l);
    return true;
}

double line_contradiction(const line *l, const scene *s) {
    sums u;
    return l->settled ? add_up(&u, l, s), find_run(&u, s->scale, false).gain : 0;
}

bool line_split(line *l, line *other, const scene *s) {
    sums u;
    line best;
    if (part_rejected(l, other, s))
        return true;
    add_up(&u, l, s);
    run r = find_run(&u, s->scale, false);
    if (r.from == r.to)
        return false;
    part_contradicting(l, s, &u, &r, &best, other);
    if (!elsewhere(&best, other, s))
        return false;
    memcpy(l, &best, sizeof *l);
    return true;
}

/* The variance of an estimate, mm²; also by the poses as they are reported, which fewer views
 * average less, `memory` of which count as one. */
static double cost(const line *l, const scene *s, double memory) {
    scene reported = *s;
    reported.noise.corrected = false;
    reported.rest = 0;
    return uncertainty(l, s) + memory * uncertainty(l, &reported);
}

/* The square of how far apart two lines are at the worse end of a, mm². */
static double apart(const line *a, const line *b) {
    double worst = 0, P[3], Q[2][3], u[3];
    for (int end = 0; end < 2; end++)
        frame_point(&b->f, b->x, 2 * end - 1, Q[end]);
    for (int i = 0; i < 3; i++)
        u[i] = Q[1][i] - Q[0][i];
    arris_unit(u);
    for (int end = 0; end < 2; end++) {
        frame_point(&a->f, a->x, 2 * end - 1, P);
        for (int i = 0; i < 3; i++)
            P[i] -= Q[0][i];
        double along = arris_dot(P, u);
        worst = fmax(worst, arris_dot(P, P) - along * along);
    }
    return worst;
}

/* The mean grey level of a side in the kept views. */
static double mean_level(const line *l, int side) {
    double sum = 0;
    for (uint32_t i = 0; i < l->n_kept; i++)
        sum += l->kept[i].level[side];
    return sum / l->n_kept;
}

/* Whether few kept views saw a side on the other side of `level` than their mean is. */
static bool keeps_to(const line *l, int side, double level) {
    double mean = mean_level(l, side);
    uint32_t across = 0;
    for (uint32_t i = 0; i < l->n_kept; i++)
        across += (l->kept[i].level[side] > level) != (mean > level);
    return across < STRAYS * l->n_kept;
}

/* Whether the two saw other surfaces beside the edge: levels that differ by half the contrast. */
static bool look_different(const line *a, const line *b) {
    double mean[2][2];
    for (int side = 0; side < 2; side++)
        mean[0][side] = mean_level(a, side), mean[1][side] = mean_level(b, side);
    double contrast = fmin(fabs(mean[0][1] - mean[0][0]), fabs(mean[1][1] - mean[1][0]));
    for (int side = 0; side < 2; side++) {
        double middle = (mean[0][side] + mean[1][side]) / 2;
        if (fabs(mean[0][side] - mean[1][side]) > OTHER * contrast && keeps_to(a, side, middle) &&
            keeps_to(b, side, middle))
            return true;
    }
    return false;
}

/* The whole is off by what lies between it and the rest, beyond what chance explains. Of two that
 * are about as certain one cannot tell which is wrong. But when they look different, it is what
 * they see that moves them, not the poses' slow noise, and the line has nothing of it. */
void line_prune(line *l, const scene *s) {
    sums u;
    line best, other;
    add_up(&u, l, s);
    run r = find_run(&u, s->scale, true);
    if (r.from == r.to)
        return;
    part_contradicting(l, s, &u, &r, &best, &other);
    bool different = look_different(&best, &other);
    double memory = different ? 1 : s->memory;
    double dropped = cost(&best, s, memory), off_by = apart(&best, l) - dropped;
    if (dropped >= WORTH * cost(l, s, memory) + fmax(off_by, 0) ||
        (!different && cost(&other, s, memory) < CLEAR * dropped))
        return;
    double variances;
    off(&best, &other, s, &variances);
    best.blend = different ? 0 : LEFT * LEFT * variances;
    memcpy(l, &best, sizeof *l);
}
