/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * trace.c: finds the rows of a line (rows.h), eight at a time.
 */
#include "rows.h"

#include <math.h>
#include <string.h>

#define CLEAR 2.2  /* a neighbour's step is over at this many of its blurs */
#define END 2.0    /* px along the line that a row keeps from the line's end */
#define BLOCK 32.0 /* px over which a bent line is a parabola, to 0.001 px */

/* A point of the line in the picture: v is the number of the row, u the place in it. */
typedef struct node {
    double u, v, t;
} node;

/* A point `t` along the line and `d` to its right. */
static node node_at(const rows *r, const row_line *l, double t, double d) {
    double x = l->x + t * l->dx - d * l->dy, y = l->y + t * l->dy + d * l->dx;
    if (r->lens)
        arris_distort(r->lens, x, y, &x, &y);
    return r->columns ? (node){y, x, t} : (node){x, y, t};
}

/* A value at the first row, its change to the next, and the change of that. */
typedef struct course {
    double value, step, bend;
} course;

/* The course from row `first` of the parabola that has three values at v. */
static course through(const double v[3], double a, double b, double c, int first) {
    double ab = (b - a) / (v[1] - v[0]), bc = (c - b) / (v[2] - v[1]);
    double bend = (bc - ab) / (v[2] - v[0]), from0 = first - v[0], from1 = first - v[1];
    return (course){a + from0 * (ab + from1 * bend), ab + (from0 + from1 + 1) * bend, 2 * bend};
}

/* A stretch of the line: how it crosses the rows first .. end - 1. */
typedef struct stretch {
    int first, end;
    course u, t;     /* place in the row, and along the line from its middle */
    course across;   /* px across the line per px of the row */
    float per_along; /* px of the row per px along the line */
    float to_end;    /* px from the line's middle to its end */
    int clear;       /* px to keep from another edge */
    int own;         /* px within which a point is this edge's */
} stretch;

/* How far one px along the row is across the line where its slope is du/dv. */
static double across_at(const rows *r, const row_line *l, const node *a, double slope) {
    node b = node_at(r, l, a->t, 1);
    return 1 / (b.u - a->u - (b.v - a->v) * slope);
}

/* From t0 to t1. False when the line does not go through the rows one by one. */
static bool stretch_make(const rows *r, const row_line *l, double t0, double t1, float blur,
                         stretch *s) {
    node a = node_at(r, l, t0, 0), m = node_at(r, l, (t0 + t1) / 2, 0), b = node_at(r, l, t1, 0);
    if (a.v > b.v) {
        node swap = a;
        a = b, b = swap;
    }
    int lines = r->columns ? r->image->width : r->image->height;
    if (!(m.v > a.v && b.v > m.v && a.v < lines && b.v > -1))
        return false;
    double v[3] = {a.v, m.v, b.v}, middle = l->length / 2;
    double slope = (b.u - a.u) / (b.v - a.v), first, last;
    s->first = a.v > 0 ? (int)ceil(a.v) : 0;
    s->end = b.v < lines ? (int)ceil(b.v) : lines;
    s->u = through(v, a.u, m.u, b.u, s->first);
    s->t = through(v, a.t - middle, m.t - middle, b.t - middle, s->first);
    first = across_at(r, l, &a, slope - s->u.bend / 2 * (b.v - a.v));
    last = across_at(r, l, &b, slope + s->u.bend / 2 * (b.v - a.v));
    s->across = through(v, first, (first + last) / 2, last, s->first);
    s->per_along = (float)(sqrt(1 + slope * slope) / fmax(fabs(slope), 1e-3));
    s->to_end = (float)middle;
    s->clear = (int)((float)CLEAR * blur * r->slant + 0.5f);
    s->own = s->clear < 4 ? 2 : s->clear < 10 ? s->clear / 2 : 5;
    return true;
}

/* Eight rows of a stretch. */
typedef struct eight_rows {
    int32_t before[LANES]; /* the last pixel that is not behind the line */
    int32_t around[LANES]; /* the points there (crowd.h) */
    float part[LANES];     /* px from there to the line */
    float t[LANES], across[LANES], shift[LANES];
    int32_t half[LANES], filter[LANES], pull[LANES];
    int32_t kept[LANES]; /* -1 for those that have room, 0 else */
} eight_rows;

/* Where the line is in the rows from `first` on; what is beyond the stretch repeats its end. */
INLINE void follow(const rows *r, const stretch *s, course *u, course *t, course *across, int first,
                   int width, eight_rows *e) {
    for (int k = 0; k < LANES; k++) {
        int line = first + k < s->end ? first + k : s->end - 1;
        double x = u->value > 0 ? u->value : 0;
        x = x < width - 1 ? x : width - 1;
        int before = (int)x;
        float part = (float)(x - before);
        e->before[k] = before;
        e->part[k] = part;
        e->around[k] = crowd_around(r->crowd, r->columns, line, before + (part > 0.5f));
        e->t[k] = (float)t->value;
        e->across[k] = (float)across->value;
        u->value += u->step, u->step += u->bend;
        t->value += t->step, t->step += t->bend;
        across->value += across->step;
    }
}

/* The half-widths that other edges, the border and the line's end leave, and what comes of them.
 * `left`: how many of the rows are the stretch's. */
INLINE void fit_in(const rows *r, const stretch *s, int left, int width, eight_rows *e) {
    eight part, t, most = (eight){0} + STEP_HALF;
    eight_ints around, before, near, row = {0, 1, 2, 3, 4, 5, 6, 7};
    memcpy(&part, e->part, sizeof part);
    memcpy(&t, e->t, sizeof t);
    memcpy(&around, e->around, sizeof around);
    memcpy(&before, e->before, sizeof before);
    crowd_nearest(&around, s->own, &near);
    eight_ints clear = near - s->clear, middle = (near + 1) >> 1, at = before + 1;
    eight_ints behind = width - at, between = EIGHT_MOST(clear, middle);
    eight to_end = (s->to_end - EIGHT_ABS(t) - (float)END) * s->per_along;
    to_end = EIGHT_CHOOSE(to_end < most, to_end, most);
    eight_ints half = __builtin_convertvector(to_end, eight_ints);
    half = EIGHT_LEAST(half, between);
    half = EIGHT_LEAST(half, at);
    half = EIGHT_LEAST(half, behind);
    /* a filter's phase counts from the pixel behind */
    eight_ints cell = __builtin_convertvector(part * STEP_PHASES, eight_ints);
    cell += cell == STEP_PHASES; /* rounded up */
    eight shift = part - (__builtin_convertvector(cell, eight) + 0.5f) / STEP_PHASES;
    eight_ints filter = (half - STEP_MIN) * STEP_PHASES + STEP_PHASES - 1 - cell;
    eight pull = __builtin_convertvector(near, eight) * (2 / r->slant);
    eight_ints kept =
        (half >= STEP_MIN) & (row < left) & (before < width - 1) & ((before > 0) | (part > 0));
    eight_ints pull_at = __builtin_convertvector(pull, eight_ints);
    memcpy(e->shift, &shift, sizeof shift);
    memcpy(e->half, &half, sizeof half);
    memcpy(e->filter, &filter, sizeof filter);
    memcpy(e->pull, &pull_at, sizeof pull_at);
    memcpy(e->kept, &kept, sizeof kept);
}

/* Appends row k of the eight from `first` on. */
INLINE void append(rows *r, const eight_rows *e, int first, int k) {
    r->place[r->n++] =
        (row_place){first + k, e->before[k] + 1, (uint8_t)e->half[k], (uint8_t)e->filter[k]};
    r->pull += r->pulls[e->pull[k]];
    r->room += (uint32_t)e->half[k];
}

/* Appends those of the eight that have room; mostly that is all of them. */
INLINE void keep(rows *r, const eight_rows *e, int first) {
    float *t = (float *)r->t + r->n, *across = (float *)r->across + r->n;
    float *shift = (float *)r->shift + r->n;
    int32_t all = -1;
    for (int k = 0; k < LANES; k++)
        all &= e->kept[k];
    if (all) {
        memcpy(t, e->t, sizeof e->t);
        memcpy(across, e->across, sizeof e->across);
        memcpy(shift, e->shift, sizeof e->shift);
        for (int k = 0; k < LANES; k++)
            append(r, e, first, k);
        return;
    }
    for (int k = 0; k < LANES; k++) {
        if (!e->kept[k])
            continue;
        *t++ = e->t[k], *across++ = e->across[k], *shift++ = e->shift[k];
        append(r, e, first, k);
    }
}

/* Appends the rows of a stretch that have room. */
INLINE void place(rows *r, const stretch *s) {
    int width = r->columns ? r->image->height : r->image->width;
    course u = s->u, t = s->t, across = s->across;
    for (int i = s->first; i < s->end && r->n + LANES <= r->max; i += LANES) {
        eight_rows e;
        follow(r, s, &u, &t, &across, i, width, &e);
        fit_in(r, s, s->end - i, width, &e);
        keep(r, &e, i);
    }
}

static void place_portable(rows *r, const stretch *s) {
    place(r, s);
}

AVX2_PATH static void place_avx2(rows *r, const stretch *s) {
    place(r, s);
}

/* Whether rows or columns cut the line, and how slantwise. */
static void choose_rows(rows *r, const row_line *l, double t0, double t1) {
    r->columns = false;
    node a = node_at(r, l, t0, 0), b = node_at(r, l, t1, 0);
    double along = fabs(b.v - a.v), across = fabs(b.u - a.u);
    r->columns = across > along;
    double slope = r->columns ? along / across : across / along;
    r->slant = slope < 1 ? (float)sqrt(1 + slope * slope) : (float)M_SQRT2;
}

/* Repeats the last row until they are whole eights. */
static void fill_up(rows *r) {
    float *t = (float *)r->t, *across = (float *)r->across, *shift = (float *)r->shift;
    for (uint32_t i = r->n; i % LANES && r->n > 0; i++)
        t[i] = t[i - 1], across[i] = across[i - 1], shift[i] = shift[i - 1];
}

void rows_trace(rows *r, const row_line *l, double trim, float blur) {
    double t0 = trim, t1 = l->length - trim;
    r->n = r->room = 0;
    r->pull = 0;
    if (!(t1 > t0))
        return;
    choose_rows(r, l, t0, t1);
    int blocks = r->lens ? 1 + (int)((t1 - t0) / BLOCK) : 1;
    for (int k = 0; k < blocks; k++) {
        stretch s;
        double from = t0 + (t1 - t0) * k / blocks, to = t0 + (t1 - t0) * (k + 1) / blocks;
        if (stretch_make(r, l, from, to, blur, &s))
            (HAS_AVX2 && !r->portable ? place_avx2 : place_portable)(r, &s);
    }
    fill_up(r);
}
