/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * trace.c: finds the rows of a line (rows.h), eight at a time.
 */
#include "rows.h"

#include <math.h>
#include <string.h>

#define CORNER 3.15f    /* blurs along the line that a row keeps from an end of the edge, */
#define LOST 2.35f      /* and from where `edges` loses it, which is inside */
#define PULL_NONE 4.46f /* log2 of the px by which a neighbour 0 px away would move an edge */
#define PULL_FALL 3.17f /* px⁻¹ by which that falls */
#define BLOCK 32.0      /* px over which a bent line is a parabola, to 0.001 px */

/* A point of the line in the picture: v is the number of the row, u the place in it. */
typedef struct node {
    double u, v, t;
} node;

/* By how much the lens displaces points `t` along the line and `d` to its right, px. */
static void displace(const rows *r, const row_line *l, const eight *t, const eight *d, eight *x,
                     eight *y) {
    const lens *c = &r->lens;
    float dx = (float)l->dx, dy = (float)l->dy;
    eight px = (float)l->x + *t * dx - *d * dy, py = (float)l->y + *t * dy + *d * dx, e[2], J[3];
    lens_normalise(c, &px, &py, x, y);
    lens_displace(c, x, y, e, J);
    *x = c->fx * e[0] + c->skew * e[1], *y = c->fy * e[1];
}

/* A point `t` along the line and `d` to its right, displaced by (x, y). */
static node node_at(const rows *r, const row_line *l, double t, double d, float x, float y) {
    double px = l->x + t * l->dx - d * l->dy + (double)x;
    double py = l->y + t * l->dy + d * l->dx + (double)y;
    return r->columns ? (node){py, px, t} : (node){px, py, t};
}

/* A parabola over the rows, by their numbers from that of the first on. */
typedef struct course {
    double value, step, bend; /* value + step i + bend i² */
} course;

/* Where a parabola is known, and the reciprocals of the differences. */
typedef struct places {
    double v[3], per01, per12, per02;
} places;

/* The course from row `first` of the parabola that has three values there. */
static course through(const places *p, double a, double b, double c, int first) {
    double ab = (b - a) * p->per01, bc = (c - b) * p->per12, bend = (bc - ab) * p->per02;
    double from0 = first - p->v[0], from1 = first - p->v[1];
    return (course){a + from0 * (ab + from1 * bend), ab + (from0 + from1) * bend, bend};
}

/* A stretch of the line: how it crosses the rows first .. end - 1. */
typedef struct stretch {
    int first, end;
    int base;        /* a pixel that it crosses no row before */
    course u, t;     /* place in the row, and along the line from its middle */
    course across;   /* px across the line per px of the row */
    float per_along; /* px of the row per px along the line */
    float to_end;    /* px from the line's middle to where its end is felt */
    int clear;       /* px to keep from another edge */
    int own;         /* px within which a point is this edge's */
} stretch;

/* How far one px along the row is across the line at a, where its slope is du/dv; b is 1 px to its
 * right. */
static double across_at(const node *a, const node *b, double slope) {
    return 1 / (b->u - a->u - (b->v - a->v) * slope);
}

/* The rows between two places, from the pixel `least` on. False when there are none in the picture.
 */
static bool stretch_bound(const rows *r, double from, double to, double least, stretch *s) {
    int lines = r->columns ? r->image->width : r->image->height;
    int width = r->columns ? r->image->height : r->image->width;
    s->first = (int)greater(0, lesser(from, lines));
    s->end = (int)greater(0, lesser(to, lines));
    s->first += s->first < from, s->end += s->end < to && s->end < lines;
    s->base = (int)greater(0, lesser(least, width - 1));
    return from < lines && to > -1;
}

/* Without a lens, all follows from the line's direction. */
static bool stretch_straight(const rows *r, const row_line *l, double t0, double t1, stretch *s) {
    const double p[] = {l->x, l->y}, d[] = {l->dx, l->dy}; /* chosen without a branch */
    double u = p[r->columns], v = p[!r->columns], du = d[r->columns], dv = d[!r->columns];
    double per_row = 1 / dv, v0 = v + t0 * dv, v1 = v + t1 * dv, u0 = u + t0 * du, u1 = u + t1 * du;
    if (!stretch_bound(r, lesser(v0, v1), greater(v0, v1), lesser(u0, u1), s))
        return false;
    double t = (s->first - v) * per_row;
    s->u = (course){u + t * du, du * per_row, 0};
    s->t = (course){t - l->length / 2, per_row, 0};
    s->across = (course){(2 * r->columns - 1) * dv, 0, 0};
    s->per_along = (float)(1 / greater(fabs(du), 1e-3));
    return true;
}

/* From t0 to t1. False when the line does not go through the rows one by one. */
static bool stretch_bent(const rows *r, const row_line *l, double t0, double t1, stretch *s) {
    double tm = (t0 + t1) / 2;
    eight t = {(float)t0, (float)t1, (float)t0, (float)t1, (float)tm}, d = {0, 0, 1, 1}, x, y;
    displace(r, l, &t, &d, &x, &y);
    node a = node_at(r, l, t0, 0, x[0], y[0]), right_of_a = node_at(r, l, t0, 1, x[2], y[2]);
    node b = node_at(r, l, t1, 0, x[1], y[1]), right_of_b = node_at(r, l, t1, 1, x[3], y[3]);
    node m = node_at(r, l, tm, 0, x[4], y[4]);
    if (a.v > b.v) {
        node swap = a;
        a = b, b = swap;
        swap = right_of_a;
        right_of_a = right_of_b, right_of_b = swap;
    }
    double least = lesser(a.u, b.u) - fabs(2 * m.u - a.u - b.u);
    if (!(m.v > a.v && b.v > m.v) || !stretch_bound(r, a.v, b.v, least, s))
        return false;
    places at = {{a.v, m.v, b.v}, 1 / (m.v - a.v), 1 / (b.v - m.v), 1 / (b.v - a.v)};
    double middle = l->length / 2, slope = (b.u - a.u) * at.per02, first, last;
    s->u = through(&at, a.u, m.u, b.u, s->first);
    s->t = through(&at, a.t - middle, m.t - middle, b.t - middle, s->first);
    first = across_at(&a, &right_of_a, slope - s->u.bend * (b.v - a.v));
    last = across_at(&b, &right_of_b, slope + s->u.bend * (b.v - a.v));
    s->across = through(&at, first, (first + last) / 2, last, s->first);
    s->per_along = (float)(sqrt(1 + slope * slope) / greater(fabs(slope), 1e-3));
    return true;
}

static bool stretch_make(const rows *r, const row_line *l, double t0, double t1, stretch *s) {
    s->to_end = (float)(l->length / 2) - r->end;
    s->clear = r->clear;
    s->own = s->clear < 4 ? 2 : s->clear < 10 ? s->clear / 2 : 5;
    return (r->bent ? stretch_bent : stretch_straight)(r, l, t0, t1, s);
}

/* Where the line is in eight rows. */
typedef struct eight_rows {
    eight_ints line, before;      /* before: the last pixel that is not behind the line */
    eight part, t, across, shift; /* part: px from there to the line */
    eight_ints around;            /* the points there (crowd.h) */
    eight_ints half, filter;
    eight_ints kept; /* all bits for those that have room */
} eight_rows;

/* The points around the line, which were where it was then. */
INLINE void look_around(const rows *r, eight_rows *e) {
    size_t stride;
    const uint8_t *bits = crowd_view(r->crowd, r->columns, r->clear_only, &stride);
    eight_ints at = e->before - (e->part > 0.5f), line = e->line, bit, byte;
    if (r->moved[0] | r->moved[1]) {
        const eight_ints zero = {0};
        int width = r->columns ? r->image->height : r->image->width;
        int lines = r->columns ? r->image->width : r->image->height;
        at -= r->moved[r->columns], line -= r->moved[!r->columns];
        at = EIGHT_MOST(EIGHT_LEAST(at, zero + (width - 1)), zero);
        line = EIGHT_MOST(EIGHT_LEAST(line, zero + (lines - 1)), zero);
    }
    bit = at + CROWD_FIRST;
    byte = line * (int32_t)stride + (bit >> 3);
    for (int k = 0; k < LANES; k++) {
        int32_t word;
        memcpy(&word, bits + byte[k], sizeof word);
        e->around[k] = word;
    }
    e->around = (eight_ints)((eight_bits)e->around >> (eight_bits)(bit & 7));
}

/* A course at the numbers i. */
INLINE void follow(const course *c, const eight *i, eight *value) {
    *value = (float)c->value + *i * ((float)c->step + *i * (float)c->bend);
}

/* The eight rows from `first` on; what is beyond the stretch repeats its end. */
INLINE void follow_all(const rows *r, const stretch *s, int first, int width, eight_rows *e) {
    const eight_ints row = {0, 1, 2, 3, 4, 5, 6, 7};
    const eight ahead = {0, 1, 2, 3, 4, 5, 6, 7};
    double i = first - s->first, bend = s->u.bend;
    course u = {s->u.value + i * (s->u.step + i * bend) - s->base, s->u.step + 2 * i * bend, bend};
    eight x, at = ahead + (float)i, zero = {0}, most = zero + (float)(width - 1 - s->base);
    follow(&u, &ahead, &x);
    follow(&s->t, &at, &e->t);
    follow(&s->across, &at, &e->across);
    x = EIGHT_CHOOSE(x > 0, x, zero);
    x = EIGHT_CHOOSE(x < most, x, most);
    e->before = __builtin_convertvector(x, eight_ints);
    e->part = x - __builtin_convertvector(e->before, eight);
    e->before += (int32_t)s->base;
    e->line = row + first;
    e->line = EIGHT_LEAST(e->line, (eight_ints){0} + (s->end - 1));
    look_around(r, e);
}

/* The half-widths that other edges, the border and the line's end leave, and what comes of them.
 * `left`: how many of the rows are the stretch's. *pull: what other edges do. */
INLINE void fit_in(const rows *r, const stretch *s, int left, int width, eight_rows *e,
                   eight *pull) {
    const eight_ints row = {0, 1, 2, 3, 4, 5, 6, 7};
    eight most = (eight){0} + STEP_HALF, part = e->part;
    eight_ints near, before = e->before;
    crowd_nearest(&e->around, s->own, &near);
    eight_ints clear = near - s->clear, middle = (near + 1) >> 1, at = before + 1;
    eight_ints behind = width - at, between = EIGHT_MOST(clear, middle);
    eight to_end = (s->to_end - EIGHT_ABS(e->t)) * s->per_along;
    to_end = EIGHT_CHOOSE(to_end < most, to_end, most);
    eight_ints half = __builtin_convertvector(to_end, eight_ints);
    half = EIGHT_LEAST(half, between);
    half = EIGHT_LEAST(half, at);
    half = EIGHT_LEAST(half, behind);
    /* a filter's phase counts from the pixel behind */
    eight_ints cell = __builtin_convertvector(part * STEP_PHASES, eight_ints);
    e->shift = part - (__builtin_convertvector(cell, eight) + 0.5f) / STEP_PHASES;
    e->half = half;
    e->filter = (half - STEP_MIN) * STEP_PHASES + STEP_PHASES - 1 - cell;
    e->kept = (half >= STEP_MIN) & (row < left);
    /* whole halves of a px, as a neighbour may be a little nearer; a float's bits are nearly its
     * binary logarithm */
    eight_ints halves =
        __builtin_convertvector(__builtin_convertvector(near, eight) * (2 / r->slant), eight_ints);
    eight power = (PULL_NONE + 127) * (1 << 23) -
                  __builtin_convertvector(halves, eight) * (PULL_FALL / 2 * (1 << 23));
    *pull = (eight) __builtin_convertvector(power, eight_ints);
}

INLINE int32_t sum(const eight_ints *a) {
    eight_ints b = *a + __builtin_shufflevector(*a, *a, 4, 5, 6, 7, 0, 1, 2, 3);
    b += __builtin_shufflevector(b, b, 2, 3, 0, 1, 6, 7, 4, 5);
    return b[0] + b[1];
}

/* Appends those of the eight that have room; mostly that is all of them. */
INLINE void keep(rows *r, const eight_rows *e) {
    float *t = (float *)r->t + r->n, *across = (float *)r->across + r->n;
    float *shift = (float *)r->shift + r->n;
    row_place *place = r->place + r->n;
    eight_ints where = e->line + (e->before + 1) * 65536, how = e->half + e->filter * 256, two[2];
    two[0] = __builtin_shufflevector(where, how, 0, 8, 1, 9, 2, 10, 3, 11);
    two[1] = __builtin_shufflevector(where, how, 4, 12, 5, 13, 6, 14, 7, 15);
    memcpy(place, &two[0], sizeof two[0]); /* little-endian, as all our targets are */
    memcpy(place + LANES / 2, &two[1], sizeof two[1]);
    memcpy(t, &e->t, sizeof e->t);
    memcpy(across, &e->across, sizeof e->across);
    memcpy(shift, &e->shift, sizeof e->shift);
    int n = -sum(&e->kept);
    eight_ints first = (eight_ints){0, 1, 2, 3, 4, 5, 6, 7} < n;
    first = first == e->kept;
    if (eight_all(&first)) { /* none is left out between them */
        r->n += (uint32_t)n;
        return;
    }
    n = 0;
    for (int k = 0; k < LANES; k++) {
        place[n] = place[k];
        t[n] = t[k], across[n] = across[k], shift[n] = shift[k];
        n -= e->kept[k];
    }
    r->n += (uint32_t)n;
}

enum { ASKED = 2 * STEP_HALF + LANES }; /* px of a column */

/* Asks for the pixels around the line, which are measured after all rows are placed. */
INLINE void ask(const rows *r, const eight_rows *e) {
    const arris_image *im = r->image;
    ptrdiff_t size = (ptrdiff_t)im->format, first = e->before[0], last = e->before[LANES - 1];
    if (!r->columns) {
        eight_ints at = e->line * (int32_t)im->stride + e->before * (int32_t)size;
        for (int k = 0; k < LANES; k++)
            __builtin_prefetch(im->data + at[k]);
        return;
    }
    ptrdiff_t from = (first < last ? first : last) - STEP_HALF + 1, most = im->height - ASKED;
    from = from < most ? from : most;
    const uint8_t *p = im->data + (from > 0 ? from : 0) * im->stride + e->line[0] * size;
    for (int k = 0; k < ASKED && k < im->height; k++, p += im->stride)
        __builtin_prefetch(p);
}

/* Appends the rows of a stretch that have room. */
INLINE void place(rows *r, const stretch *s) {
    int width = r->columns ? r->image->height : r->image->width;
    eight pulls = {0};
    eight_ints room = {0};
    for (int i = s->first; i < s->end && r->n + LANES <= r->max; i += LANES) {
        eight_rows e;
        eight pull;
        follow_all(r, s, i, width, &e);
        ask(r, &e);
        fit_in(r, s, s->end - i, width, &e, &pull);
        pulls += (eight)((eight_ints)pull & e.kept);
        room += e.half & e.kept;
        keep(r, &e);
    }
    r->pull += eight_sum(&pulls);
    r->room += (uint32_t)sum(&room);
}

static void place_portable(rows *r, const stretch *s) {
    place(r, s);
}

AVX2_PATH static void place_avx2(rows *r, const stretch *s) {
    place(r, s);
}

/* Whether rows or columns cut the line, and how slantwise. */
static void choose_rows(rows *r, const row_line *l, double t0, double t1) {
    double x = fabs(l->dx), y = fabs(l->dy);
    if (r->bent) {
        eight t = {(float)t0, (float)t1}, d = {0}, ex, ey;
        displace(r, l, &t, &d, &ex, &ey);
        x = fabs((t1 - t0) * l->dx + (double)(ex[1] - ex[0]));
        y = fabs((t1 - t0) * l->dy + (double)(ey[1] - ey[0]));
    }
    r->columns = x > y;
    double slope = lesser(x, y) / greater(x, y);
    r->slant = slope < 1 ? (float)sqrt(1 + slope * slope) : (float)M_SQRT2;
}

void rows_trace(rows *r, const row_line *l, double trim, float blur) {
    double t0 = trim, t1 = l->length - trim;
    r->n = r->room = 0;
    r->pull = 0;
    if (!(t1 > t0))
        return;
    choose_rows(r, l, t0, t1);
    r->clear = rows_clear(r, blur);
    r->end = (r->whole ? CORNER : LOST) * blur;
    int blocks = r->bent ? 1 + (int)((t1 - t0) / BLOCK) : 1;
    double block = r->bent ? (t1 - t0) / blocks : t1 - t0;
    for (int k = 0; k < blocks; k++) {
        stretch s;
        if (stretch_make(r, l, t0 + k * block, t0 + (k + 1) * block, &s))
            (HAS_AVX2 && !r->portable ? place_avx2 : place_portable)(r, &s);
    }
}
