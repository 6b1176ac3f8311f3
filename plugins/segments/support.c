/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * support.c: the rows of a foreseen line (support.h).
 */
#include "support.h"

#include <math.h>
#include <stdlib.h>

#include "lanes.h"

#define REACH 1.25f       /* px of a row, from where the line is foreseen to where it is */
#define BLOCK 32.0        /* px along which a lens bends no line by more than 0.1 px */
#define SHARP 0.995f      /* share of a step within 1.5 px that no lens exceeds */
#define LOGISTIC 1.702f   /* the normal distribution is nearly 1 / (1 + exp(-1.702 x)) */
#define SMOOTHED (4. / 3) /* px²: a Gaussian of 1 px and central differences */

enum {
    MARGIN = 4, /* px at the border where `edges` finds nothing */
    SIDE = 2,   /* rows to either side that are averaged */
    GAP = 2,    /* rows without a step that do not end a stretch */
    FEWEST = 8, /* rows of a stretch */
    GROW = 16   /* px that are looked at beyond an end, at a time */
};

int support_init(support *s, int width, int height) {
    *s = (support){.row = malloc((size_t)(width > height ? width : height) * sizeof *s->row)};
    return s->row ? 0 : ARRIS_E_MEMORY;
}

void support_free(support *s) {
    free(s->row);
}

/* ---- rows ----------------------------------------------------------------------------------- */

/* The line from (x, y) along the unit vector (dx, dy), with the rows rising along it. */
typedef struct course {
    double x, y, dx, dy, length;
    double nx, ny; /* unit vector across it, to where u rises */
    float sign;    /* 1: that is the right of the foreseen line; -1: the left */
    bool reversed; /* the foreseen line goes the other way */
} course;

typedef struct node {
    double u, v;
} node;

static node node_at(const support *s, const course *c, double t) {
    double x = c->x + t * c->dx, y = c->y + t * c->dy;
    if (s->lens)
        arris_distort(s->lens, x, y, &x, &y);
    return s->columns ? (node){y, x} : (node){x, y};
}

static int lines_of(const support *s) {
    return s->columns ? s->image->width : s->image->height;
}

INLINE int32_t level(const uint8_t *p, bool wide) {
    return wide ? *(const uint16_t *)(const void *)p : *p;
}

/* Looks at row v, which the line crosses at u. */
INLINE void look(const support *s, const course *c, int v, float u, float t, bool wide) {
    const arris_image *im = s->image;
    support_row *r = &s->row[v];
    int width = s->columns ? im->height : im->width;
    *r = (support_row){.u = u, .t = t};
    if (!(u >= MARGIN && u < (float)(width - 1 - MARGIN)))
        return;
    ptrdiff_t size = wide ? 2 : 1, step = s->columns ? im->stride : size;
    int b = (int)u; /* the last pixel before the line */
    const uint8_t *p = im->data + v * (s->columns ? size : im->stride) + b * step;
    int32_t near0 = level(p - step, wide), near1 = level(p + 2 * step, wide);
    int32_t before = level(p - 3 * step, wide) + level(p - 2 * step, wide);
    int32_t behind = level(p + 3 * step, wide) + level(p + 4 * step, wide);
    int32_t inner = near0 + level(p, wide) + level(p + step, wide) + near1;
    r->step = c->sign * (float)(behind - before) / 2;
    r->core = c->sign * (float)(near1 - near0);
    r->off = r->step * ((float)b + 0.5f - u) + c->sign * (float)(before + behind - inner);
}

/* Looks at the rows between two places along the line that it has not looked at. */
static void look_between(support *s, const course *c, double t0, double t1) {
    int blocks = s->lens ? 1 + (int)((t1 - t0) / BLOCK) : 1, lines = lines_of(s);
    int first = s->first, end = s->end;
    bool wide = s->image->format == ARRIS_GREY16;
    node a = node_at(s, c, t0);
    for (int k = 1; k <= blocks; k++) {
        double ta = t0 + (t1 - t0) * (k - 1) / blocks, tb = t0 + (t1 - t0) * k / blocks;
        node b = node_at(s, c, tb);
        double slope = 1 / (b.v - a.v);
        int v = a.v > MARGIN ? (int)ceil(a.v) : MARGIN;
        for (; v < lines - MARGIN && v < b.v && b.v > a.v; v++) {
            if (v >= first && v < end)
                continue;
            double w = (v - a.v) * slope;
            float u = (float)(a.u + w * (b.u - a.u)), t = (float)(ta + w * (tb - ta));
            wide ? look(s, c, v, u, t, true) : look(s, c, v, u, t, false);
            s->first = v < s->first ? v : s->first;
            s->end = v >= s->end ? v + 1 : s->end;
        }
        a = b;
    }
}

/* ---- the stretch ---------------------------------------------------------------------------- */

/* The longest stretch, with gaps of up to GAP rows, of rows around which there is the step, near
 * the line: by the mean of the rows up to SIDE away. */
static void find_stretch(support *s, float least) {
    int from = s->first, to = s->first;
    float step = 0, off = 0, n = 0;
    s->from = s->to = s->first;
    for (int v = s->first - SIDE; v < s->end; v++) {
        int in = v + SIDE, out = v - SIDE - 1;
        if (in < s->end)
            step += s->row[in].step, off += s->row[in].off, n++;
        if (out >= s->first)
            step -= s->row[out].step, off -= s->row[out].off, n--;
        if (v < s->first || !(step > least * n && fabsf(off) < REACH * step))
            continue;
        if (v - to > GAP)
            from = v;
        to = v + 1;
        if (to - from > s->to - s->from)
            s->from = from, s->to = to;
    }
}

/* The average has blurred the ends, and rows that cut a corner aslant see beyond it: the ends are
 * where the core of single rows is no more half of what it is inside. */
static void sharpen_ends(support *s) {
    int head = s->from + SIDE, tail = s->to - 1 - SIDE, i;
    float at_head = 0, at_tail = 0;
    for (i = 0; i < 2 * SIDE; i++) {
        at_head += s->row[head + i].core / (4 * SIDE);
        at_tail += s->row[tail - i].core / (4 * SIDE);
    }
    for (i = 0; i < 4 * SIDE && head > s->first && s->row[head - 1].core > at_head; i++)
        head--;
    for (i = 0; i < 4 * SIDE && tail + 1 < s->end && s->row[tail + 1].core > at_tail; i++)
        tail++;
    s->from = head, s->to = tail + 1;
}

/* Where the stretch goes on at an end of what was looked at, looks farther. */
static void grow(support *s, const course *c, float least) {
    double lo = -GROW, hi = c->length + GROW;
    for (bool more = true; more;) {
        int first = s->first, end = s->end;
        if (s->from - s->first <= GAP)
            look_between(s, c, lo - GROW, lo), lo -= GROW;
        if (end - s->to <= GAP)
            look_between(s, c, hi, hi + GROW), hi += GROW;
        more = s->first < first || s->end > end;
        if (more)
            find_stretch(s, least);
    }
}

/* ---- the line in it ------------------------------------------------------------------------- */

/* px of the row by which the step is off in rows from .. to - 1. */
static double mean_off(const support *s, int from, int to, double *t) {
    float step = 0, off = 0, along = 0;
    for (int v = from; v < to; v++)
        step += s->row[v].step, off += s->row[v].off, along += s->row[v].t;
    *t = (double)along / (to - from);
    return step > 0 ? (double)(off / step) : 0;
}

/* What the gradient of the smoothed picture should be. */
static double gradient_of(const support *s, double across) {
    float step = 0, core = 0;
    for (int v = s->from; v < s->to; v++)
        step += s->row[v].step, core += s->row[v].core;
    float share = fmaxf(0.05f, fminf(SHARP, core / step));
    double blur = across * 1.5 * (double)(LOGISTIC / logf((1 + share) / (1 - share)));
    return (double)step / (s->to - s->from) / sqrt(2 * M_PI * (blur * blur + SMOOTHED));
}

/* The line through what its two halves are off by, as far as the stretch goes. */
static void measure_start(const support *s, const course *c, refit_start *start) {
    double across = fabs(s->columns ? c->ny : c->nx); /* px across per px of the row */
    int middle = (s->from + s->to) / 2;
    double first = (double)s->row[s->from].t, last = (double)s->row[s->to - 1].t;
    double half = (last - first) / (s->to - 1 - s->from) / 2, ta, tb, e[2][2]; /* half a row */
    double a = mean_off(s, s->from, middle, &ta), b = mean_off(s, middle, s->to, &tb);
    for (int i = 0; i < 2; i++) {
        double t = i ? last + half : first - half;
        double d = (a + (b - a) * (t - ta) / (tb - ta)) * across;
        e[i ^ c->reversed][0] = c->x + t * c->dx + d * c->nx;
        e[i ^ c->reversed][1] = c->y + t * c->dy + d * c->ny;
    }
    double dx = e[1][0] - e[0][0], dy = e[1][1] - e[0][1], length = hypot(dx, dy);
    *start = (refit_start){.line = {e[0][0], e[0][1], dx / length, dy / length, length},
                           .gradient = gradient_of(s, across),
                           .whole = true};
}

/* Chooses rows or columns, by how the line lies in the picture. False: it has no direction. */
static bool set_course(support *s, const arris_foreseen *f, course *c) {
    *c = (course){.x = f->x1, .y = f->y1, .dx = f->x2 - f->x1, .dy = f->y2 - f->y1};
    c->length = hypot(c->dx, c->dy);
    if (!(c->length > 0))
        return false;
    c->dx /= c->length, c->dy /= c->length;
    s->columns = fabs(c->dx) > fabs(c->dy);
    double rising = s->columns ? c->dx : c->dy;
    c->sign = (s->columns ? c->dx : -c->dy) > 0 ? 1 : -1;
    c->nx = -c->dy * (double)c->sign, c->ny = c->dx * (double)c->sign;
    c->reversed = rising < 0;
    if (c->reversed) {
        c->x = f->x2, c->y = f->y2;
        c->dx = -c->dx, c->dy = -c->dy;
    }
    return true;
}

bool support_find(support *s, const arris_foreseen *line, double step, double length,
                  refit_start *start) {
    course c;
    if (!set_course(s, line, &c))
        return false;
    s->first = lines_of(s), s->end = 0;
    look_between(s, &c, -GROW, c.length + GROW);
    find_stretch(s, (float)step);
    if (s->from >= s->to)
        return false;
    grow(s, &c, (float)step);
    if (s->to - s->from < FEWEST)
        return false;
    sharpen_ends(s);
    measure_start(s, &c, start);
    return start->line.length >= length;
}
