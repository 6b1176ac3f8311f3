/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * rows.c: traces a line through the picture's rows or columns and measures each (rows.h).
 */
#include "rows.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define CLEAR 2.2  /* a neighbour's step is over at this many of its blurs */
#define END 2.0    /* px along the line that a row keeps from the line's end */
#define BLOCK 32.0 /* px over which a bent line is a parabola, to 0.001 px */

enum { PROBES = 4, TELLS_SLOPES = 5 };

int rows_init(rows *r, int width, int height) {
    *r = (rows){.max = (uint32_t)(width > height ? width : height)};
    r->item = aligned_alloc(_Alignof(row), r->max * sizeof *r->item);
    return r->item ? 0 : ARRIS_E_MEMORY;
}

void rows_free(rows *r) {
    free(r->item);
}

/* ---- where the line is ---------------------------------------------------------------------- */

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

/* The parabola through three nodes over v: f(v) = f0 + (v - v0) (f1 + (v - v1) f2). */
typedef struct parabola {
    double f0, f1, f2;
} parabola;

static parabola through(const double v[3], double fa, double fb, double fc) {
    double ab = (fb - fa) / (v[1] - v[0]), bc = (fc - fb) / (v[2] - v[1]);
    return (parabola){fa, ab, (bc - ab) / (v[2] - v[0])};
}

/* A stretch of the line: where it crosses the rows first .. end - 1. */
typedef struct stretch {
    int first, end;
    double v[3];
    parabola u, t;
    double across, widen; /* px across the line per px of the row: at v[0], and its change */
    float along;          /* px along the line per px of the row */
    int clear, own;       /* px to keep from another edge; within which it is this one */
} stretch;

/* How far one px along the row is across the line where its slope is du/dv. */
static double across_at(const rows *r, const row_line *l, const node *a, double slope) {
    node b = node_at(r, l, a->t, 1);
    return 1 / (b.u - a->u - (b.v - a->v) * slope);
}

/* From t0 to t1. False when the line does not go through the rows one by one. */
static bool stretch_make(rows *r, const row_line *l, double t0, double t1, float blur,
                         stretch *s) {
    node a = node_at(r, l, t0, 0), m = node_at(r, l, (t0 + t1) / 2, 0), b = node_at(r, l, t1, 0);
    if (a.v > b.v) {
        node swap = a;
        a = b, b = swap;
    }
    int lines = r->columns ? r->image->width : r->image->height;
    if (!(m.v > a.v && b.v > m.v && a.v < lines && b.v > -1))
        return false;
    s->v[0] = a.v, s->v[1] = m.v, s->v[2] = b.v;
    s->u = through(s->v, a.u, m.u, b.u);
    s->t = through(s->v, a.t, m.t, b.t);
    double bend = s->u.f2 * (b.v - a.v), slope = s->u.f1 + bend / 2;
    s->across = across_at(r, l, &a, slope - bend);
    s->widen = (across_at(r, l, &b, slope + bend) - s->across) / (b.v - a.v);
    r->slant = (float)sqrt(1 + slope * slope);
    s->along = (float)fabs(slope) / r->slant;
    s->clear = (int)((float)CLEAR * blur * r->slant + 0.5f);
    s->own = s->clear < 4 ? 2 : s->clear < 10 ? s->clear / 2 : 5;
    s->first = a.v > 0 ? (int)ceil(a.v) : 0;
    s->end = b.v < lines ? (int)ceil(b.v) : lines;
    return true;
}

/* The half-width that other edges, the border and the line's end leave to a row, px. `at` is the
 * first pixel behind the line, `near` the nearest. */
INLINE int room(const rows *r, const stretch *s, int line, int at, int near, float to_end) {
    int width = r->columns ? r->image->height : r->image->width;
    int half = at < width - at ? at : width - at;
    half = half < STEP_HALF ? half : STEP_HALF;
    if (half < STEP_MIN)
        return 0;
    int d = crowd_nearest(r->crowd, r->columns, line, near, s->own), middle = (d + 1) / 2;
    int free = d - s->clear > middle ? d - s->clear : middle;
    half = half < free ? half : free;
    if ((float)half * s->along > to_end - (float)END)
        half = (int)((to_end - (float)END) / s->along);
    return half;
}

/* ---- what is there -------------------------------------------------------------------------- */

INLINE void widen(const uint8_t *restrict b, four *restrict px) {
    int16_t wide[STEP_WIDTH];
    float *restrict level = (float *)px;
    for (int j = 0; j < STEP_WIDTH; j++)
        wide[j] = b[j];
    for (int j = 0; j < STEP_WIDTH; j++)
        level[j] = (float)wide[j];
}

INLINE void fetch_column(const uint8_t *p, ptrdiff_t s, four *px) {
    const uint8_t *q = p + 8 * s;
    bytes b = {p[0], p[s], p[2 * s], p[3 * s], p[4 * s], p[5 * s], p[6 * s], p[7 * s],
               q[0], q[s], q[2 * s], q[3 * s], q[4 * s], q[5 * s], q[6 * s], q[7 * s]};
    widen((const uint8_t *)&b, px);
}

/* Any format, and at the border. */
static void fetch_some(const uint8_t *p, ptrdiff_t step, bool wide, int half, four *px) {
    float *level = (float *)px;
    memset(px, 0, STEP_WIDTH * sizeof *level);
    for (int j = STEP_HALF - half; j < STEP_HALF + half; j++, p += step)
        level[j] = wide ? (float)*(const uint16_t *)(const void *)p : (float)*p;
}

/* The pixels around the place before pixel `at` of a row, those within `half` less the base and the
 * others 0. */
INLINE void fetch(const rows *r, int line, int at, int half, four *px) {
    const arris_image *im = r->image;
    const four *inside = r->steps->inside[half - STEP_MIN];
    ptrdiff_t size = (ptrdiff_t)im->format, step = r->columns ? im->stride : size;
    int width = r->columns ? im->height : im->width;
    const uint8_t *p = im->data + line * (r->columns ? size : im->stride);
    if (at < STEP_HALF || at > width - STEP_HALF || size == 2)
        fetch_some(p + (at - half) * step, step, size == 2, half, px);
    else if (r->columns)
        fetch_column(p + (at - STEP_HALF) * step, step, px);
    else
        widen(p + at - STEP_HALF, px);
    for (int k = 0; k < 4; k++)
        px[k] = (px[k] - r->base) * inside[k];
}

/* The filters' answers to a row. */
INLINE void filter(const step_filter *f, const four *px, eight *answer) {
    const float *level = (const float *)px;
    eight a = {0}, b = {0}, c = {0}, d = {0};
#pragma GCC unroll 4
    for (int j = 0; j < STEP_WIDTH; j += 4) {
        a += f->w[j] * level[j];
        b += f->w[j + 1] * level[j + 1];
        c += f->w[j + 2] * level[j + 2];
        d += f->w[j + 3] * level[j + 3];
    }
    *answer = (a + b) + (c + d);
}

INLINE void add(row_sums *s, const row *q, const four *px) {
    const step_filter *f = q->filter;
    eight answer = f->response * q->answer, weight = f->response * f->response;
    s->answer += answer;
    s->answer_t += answer * q->t;
    s->weight += weight;
    s->weight_t += weight * q->t;
    s->weight_tt += weight * (q->t * q->t);
    s->squares += px[0] * px[0] + px[1] * px[1] + (px[2] * px[2] + px[3] * px[3]);
    s->explained += q->answer * q->answer;
    s->step += f->sum;
    s->tilt += f->response[STEP_CONTRAST] * f->tilt * q->answer[STEP_SLOPE];
    s->dof += f->dof;
}

INLINE void measure(rows *r, const stretch *s, const step_filter *filters, double length) {
    int width = r->columns ? r->image->height : r->image->width;
    for (int i = s->first; i < s->end && r->n < r->max; i++) {
        double v0 = i - s->v[0], v1 = i - s->v[1];
        double x = s->u.f0 + v0 * (s->u.f1 + v1 * s->u.f2);
        double t = s->t.f0 + v0 * (s->t.f1 + v1 * s->t.f2);
        if (!(x > 0 && x < width - 1))
            continue;
        int before = (int)x;
        float part = (float)(x - before), to_end = (float)(t < length - t ? t : length - t);
        int half = room(r, s, i, before + 1, before + (part > 0.5f), to_end);
        if (half < STEP_MIN)
            continue;
        int cell = (int)(part * STEP_PHASES); /* the filters count from the pixel behind */
        row *q = &r->item[r->n++];
        four px[STEP_WIDTH / 4];
        q->filter = filters + (half - STEP_MIN) * STEP_PHASES + STEP_PHASES - 1 - cell;
        q->t = (float)(t - length / 2);
        q->across = (float)(s->across + v0 * s->widen);
        q->shift = part - ((float)cell + 0.5f) / STEP_PHASES;
        fetch(r, i, before + 1, half, px);
        filter(q->filter, px, &q->answer);
        add(&r->sum, q, px);
        r->sum.wide += half >= TELLS_SLOPES;
    }
}

static void measure_portable(rows *r, const stretch *s, const step_filter *f, double length) {
    measure(r, s, f, length);
}

#if defined(__x86_64__)
__attribute__((target("avx2"))) static void measure_avx2(rows *r, const stretch *s,
                                                         const step_filter *f, double length) {
    measure(r, s, f, length);
}
#else
#define measure_avx2 measure_portable
#endif

void rows_measure(rows *r, const row_line *l, double trim, float blur, float base) {
    r->n = 0;
    r->base = base;
    r->sum = (row_sums){0};
    r->columns = false;
    double t0 = trim, t1 = l->length - trim;
    if (!(t1 > t0))
        return;
    node a = node_at(r, l, t0, 0), b = node_at(r, l, t1, 0);
    r->columns = fabs(b.u - a.u) > fabs(b.v - a.v);
    int blocks = r->lens ? 1 + (int)((t1 - t0) / BLOCK) : 1;
    for (int k = 0; k < blocks; k++) {
        stretch s;
        if (!stretch_make(r, l, t0 + (t1 - t0) * k / blocks, t0 + (t1 - t0) * (k + 1) / blocks,
                          blur, &s))
            continue;
        const step_filter *f = r->steps->f[step_scale(blur * r->slant)][0];
        (r->portable ? measure_portable : measure_avx2)(r, &s, f, l->length);
    }
}

/* ---- a first look --------------------------------------------------------------------------- */

static int inside(double x, int n) {
    return x > 0 ? x < n - 1 ? (int)(x + 0.5) : n - 1 : 0;
}

static double level_at(const rows *r, const row_line *l, double t, double d) {
    const arris_image *im = r->image;
    node a = node_at(r, l, t, d);
    const uint8_t *p = im->data + inside(a.v, im->height) * im->stride;
    int x = inside(a.u, im->width);
    return im->format == ARRIS_GREY16 ? ((const uint16_t *)(const void *)p)[x] : p[x];
}

void rows_probe(rows *r, const row_line *l, double d, double *left, double *right) {
    r->columns = false;
    *left = *right = 0;
    for (int k = 0; k < PROBES; k++) {
        double t = l->length * (k + 0.5) / PROBES;
        *left += level_at(r, l, t, -d) / PROBES;
        *right += level_at(r, l, t, d) / PROBES;
    }
}
