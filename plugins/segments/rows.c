/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * rows.c: traces a line through the picture's rows or columns and measures each (rows.h).
 */
#include "rows.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#define CLEAR 2.2     /* a neighbour's step is over at this many of its blurs */
#define PULL 0.03     /* px by which a neighbour 3 px away moves an edge, about */
#define PULL_FALL 2.2 /* px⁻¹ by which that falls */
#define END 2.0       /* px along the line that a row keeps from the line's end */
#define BLOCK 32.0    /* px over which a bent line is a parabola, to 0.001 px */

enum { PROBES = 4, BLOCK_LINES = 16, BLOCK_PIXELS = 32 };

int rows_init(rows *r, int width, int height) {
    size_t n = (size_t)(width > height ? width : height) / LANES + 1;
    *r = (rows){.max = (uint32_t)(LANES * n)};
    r->place = malloc(r->max * sizeof *r->place);
    eight *p = r->t = aligned_alloc(sizeof(eight), 10 * n * sizeof(eight));
    if (!r->place || !p)
        return ARRIS_E_MEMORY;
    r->across = p += n;
    r->shift = p += n;
    r->answer = p += n;
    r->response = p += n;
    r->gain = p += n;
    r->slopes = p += n;
    r->unsure = p += n;
    r->by_kink = p += n;
    r->by_slope = p + n;
    for (int i = 0; i < ROWS_PULLS; i++)
        r->pulls[i] = (float)(PULL * exp(-PULL_FALL * (i / 2. - 3)));
    return 0;
}

void rows_free(rows *r) {
    free(r->place);
    free(r->t);
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

/* The half-width that another edge `d` px away leaves to a row, px. */
INLINE int room_between(const stretch *s, int d) {
    int middle = (d + 1) / 2;
    return d - s->clear > middle ? d - s->clear : middle;
}

/* The one that the border and the line's end leave. `at` is the first pixel behind the line. */
INLINE int room_inside(const stretch *s, int at, int width, float to_end) {
    float before_end = (to_end - (float)END) * s->per_along;
    int half = (int)(before_end < STEP_HALF ? before_end : STEP_HALF);
    half = half < at ? half : at;
    return half < width - at ? half : width - at;
}

/* Appends the rows of a stretch that have room. */
INLINE void place(rows *r, const stretch *s) {
    int width = r->columns ? r->image->height : r->image->width;
    float *along = (float *)r->t, *across = (float *)r->across, *shift = (float *)r->shift;
    course u = s->u, t = s->t, c = s->across;
    float per_slant = 2 / r->slant, pull = 0;
    uint32_t n = r->n, space = 0;
    for (int i = s->first; i < s->end && n < r->max; i++) {
        double x = u.value;
        float to_end = s->to_end - fabsf(along[n] = (float)t.value);
        across[n] = (float)c.value;
        u.value += u.step, u.step += u.bend;
        t.value += t.step, t.step += t.bend;
        c.value += c.step;
        if (!(x > 0 && x < width - 1))
            continue;
        int before = (int)x;
        float part = (float)(x - before);
        int half = room_inside(s, before + 1, width, to_end);
        int near = crowd_nearest(r->crowd, r->columns, i, before + (part > 0.5f), s->own);
        int between = room_between(s, near);
        int cell = (int)(part * STEP_PHASES); /* a filter's phase counts from the pixel behind */
        cell -= cell == STEP_PHASES;          /* rounded up */
        half = half < between ? half : between;
        shift[n] = part - ((float)cell + 0.5f) / STEP_PHASES;
        r->place[n] =
            (row_place){i, before + 1, (uint8_t)half,
                        (uint8_t)((half - STEP_MIN) * STEP_PHASES + STEP_PHASES - 1 - cell)};
        bool kept = half >= STEP_MIN;
        pull += r->pulls[(int)((float)near * per_slant)] * (float)kept;
        space += kept ? (uint32_t)half : 0;
        n += kept;
    }
    r->n = n;
    r->pull += pull;
    r->room += space;
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

/* ---- what is there -------------------------------------------------------------------------- */

/* The part of the sixteen pixels around the place before pixel `at` that is within `half`, in any
 * format. */
static void fetch_some(const uint8_t *p, ptrdiff_t step, bool wide, int half, int base, int shift,
                       int16_t *px) {
    memset(px, 0, STEP_WIDTH * sizeof *px);
    for (int j = STEP_HALF - half; j < STEP_HALF + half; j++, p += step) {
        int level = ((wide ? *(const uint16_t *)(const void *)p : *p) - base) >> shift;
        px[j] = (int16_t)(level < -STEP_MOST ? -STEP_MOST : level > STEP_MOST ? STEP_MOST : level);
    }
}

/* Columns of the picture side by side, as rows: to walk down one column after another costs more.
 */
typedef struct block {
    int32_t line, at; /* the first column, and the first pixel in each */
    uint8_t column[BLOCK_LINES][BLOCK_PIXELS];
} block;

/* Transposes 16x16 bytes: four times, the two halves are shuffled into each other. */
INLINE void transpose(bytes *v) {
    for (int round = 0; round < 4; round++) {
        bytes t[16];
        for (int k = 0; k < 8; k++) {
            t[2 * k] = __builtin_shufflevector(v[k], v[k + 8], 0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5,
                                               21, 6, 22, 7, 23);
            t[2 * k + 1] = __builtin_shufflevector(v[k], v[k + 8], 8, 24, 9, 25, 10, 26, 11, 27, 12,
                                                   28, 13, 29, 14, 30, 15, 31);
        }
        memcpy(v, t, sizeof t);
    }
}

static bool block_has(const block *b, const row_place *q) {
    return q->line >= b->line && q->line < b->line + BLOCK_LINES && q->at >= b->at + STEP_HALF &&
           q->at <= b->at + BLOCK_PIXELS - STEP_HALF;
}

/* Takes in the columns from that of `q` on, and the pixels that a line needs which goes on to
 * greater places in them when `rising`. The picture is at least as large as a block. */
__attribute__((noinline)) static void block_load(block *b, const arris_image *im,
                                                 const row_place *q, bool rising) {
    int at = rising ? q->at - STEP_HALF - 1 : q->at + STEP_HALF + 1 - BLOCK_PIXELS;
    int last = im->width - BLOCK_LINES, end = im->height - BLOCK_PIXELS;
    b->line = q->line < last ? q->line : last;
    b->at = at < 0 ? 0 : at < end ? at : end;
    for (int k = 0; k < BLOCK_PIXELS; k += 16) {
        const uint8_t *p = im->data + (b->at + k) * im->stride + b->line;
        bytes v[16];
        for (int i = 0; i < 16; i++)
            memcpy(&v[i], p + i * im->stride, sizeof v[i]);
        transpose(v);
        for (int i = 0; i < BLOCK_LINES; i++)
            memcpy(b->column[i] + k, &v[i], sizeof v[i]);
    }
}

/* The pixels of the i-th row as differences from the base; those that are not within its half are
 * 0. */
INLINE void fetch(const rows *r, uint32_t i, int base, int shift, block *b, int16_t *px) {
    const arris_image *im = r->image;
    const row_place *q = &r->place[i];
    const int16_t *inside = r->steps->inside[q->half - STEP_MIN];
    ptrdiff_t size = (ptrdiff_t)im->format, step = r->columns ? im->stride : size;
    int width = r->columns ? im->height : im->width, at = q->at, half = q->half;
    const uint8_t *p = im->data + q->line * (r->columns ? size : im->stride);
    if (at < STEP_HALF || at > width - STEP_HALF || size == 2 ||
        (r->columns && (im->width < BLOCK_LINES || im->height < BLOCK_PIXELS))) {
        fetch_some(p + (at - half) * step, step, size == 2, half, base, shift, px);
        return;
    }
    p += at - STEP_HALF;
    if (r->columns) {
        if (!block_has(b, q))
            block_load(b, im, q, r->place[r->n - 1].at >= r->place[0].at);
        p = b->column[q->line - b->line] + (at - STEP_HALF - b->at);
    }
    bytes level;
    memcpy(&level, p, sizeof level);
    for (int j = 0; j < STEP_WIDTH; j++)
        px[j] = (int16_t)((level[j] - base) & inside[j]);
}

/* The filters' answers to sixteen pixels, and the squares of these, in pairs. */
typedef void filter(const step_filter *f, const int16_t *px, eight_ints *answer,
                    eight_ints *square);

static inline void filter_portable(const step_filter *f, const int16_t *px, eight_ints *answer,
                                   eight_ints *square) {
    int32_t sum[8] = {0};
    for (int i = 0; i < STEP_WIDTH / 2; i++) {
        int32_t a = px[2 * i], b = px[2 * i + 1];
        for (int k = 0; k < 8; k++)
            sum[k] += a * f->w[i][k][0] + b * f->w[i][k][1];
        (*square)[i] = a * a + b * b;
    }
    memcpy(answer, sum, sizeof sum);
}

#if defined(__x86_64__)
/* Pairs of pixels times their weights in the eight filters. */
AVX2_PATH static inline __m256i products(__m256i pixels, const __m256i *w) {
    return _mm256_madd_epi16(pixels, _mm256_loadu_si256(w));
}

AVX2_PATH static inline __m256i half_sum(__m256i half, const __m256i *w) {
    __m256i a = products(_mm256_shuffle_epi32(half, 0x00), w);
    __m256i b = products(_mm256_shuffle_epi32(half, 0x55), w + 1);
    __m256i c = products(_mm256_shuffle_epi32(half, 0xAA), w + 2);
    __m256i d = products(_mm256_shuffle_epi32(half, 0xFF), w + 3);
    return _mm256_add_epi32(_mm256_add_epi32(a, b), _mm256_add_epi32(c, d));
}

AVX2_PATH static inline void filter_avx2(const step_filter *f, const int16_t *px,
                                         eight_ints *answer, eight_ints *square) {
    const __m256i *w = (const void *)f->w;
    __m256i all = _mm256_loadu_si256((const void *)px);
    __m256i first = half_sum(_mm256_permute2x128_si256(all, all, 0x00), w);
    __m256i second = half_sum(_mm256_permute2x128_si256(all, all, 0x11), w + 4);
    _mm256_storeu_si256((void *)answer, _mm256_add_epi32(first, second));
    _mm256_storeu_si256((void *)square, _mm256_madd_epi16(all, all));
}
#endif

INLINE void add(row_sums *s, const step_filter *f, const eight *answers, float t) {
    eight answer = f->response * *answers, weight = f->response * f->response;
    s->answer += answer;
    s->answer_t += answer * t;
    s->weight += weight;
    s->weight_t += weight * t;
    s->weight_tt += weight * (t * t);
    s->explained += *answers * *answers;
    s->step += f->sum;
    s->tilt += f->tilt * (*answers)[STEP_SLOPE];
    s->flare += f->flare * (*answers)[STEP_SLOPE];
    s->dof += f->dof;
}

/* `filters` are those of one scale. */
INLINE void measure(rows *r, const step_filter *filters, int base, int shift, filter *answer_to) {
    const float *t = (const float *)r->t;
    float *answer = (float *)r->answer, *response = (float *)r->response;
    float *gain = (float *)r->gain, *slopes = (float *)r->slopes, *unsure = (float *)r->unsure;
    float *by_kink = (float *)r->by_kink, *by_slope = (float *)r->by_slope;
    float unit = (float)(1 << shift), per_answer = unit / STEP_UNIT;
    row_sums all = {0};
    block columns;
    columns.line = -BLOCK_LINES; /* holds nothing */
    for (uint32_t i = 0; i < r->n; i++) {
        const row_place *q = &r->place[i];
        const step_filter *f = &filters[q->filter];
        int16_t px[STEP_WIDTH];
        eight_ints sum, square;
        fetch(r, i, base, shift, &columns, px);
        answer_to(f, px, &sum, &square);
        eight a = __builtin_convertvector(sum, eight) * per_answer;
        add(&all, f, &a, t[i]);
        all.squares += __builtin_convertvector(square, eight) * (unit * unit);
        answer[i] = a[STEP_OFFSET];
        response[i] = f->response[STEP_OFFSET];
        gain[i] = f->gain;
        slopes[i] = f->kink * a[STEP_KINK] + f->slope * a[STEP_SLOPE];
        unsure[i] = f->unsure;
        by_kink[i] = f->by_kink, by_slope[i] = f->by_slope;
    }
    r->sum = all;
}

static void measure_portable(rows *r, const step_filter *f, int base, int shift) {
    measure(r, f, base, shift, filter_portable);
}

#if defined(__x86_64__)
AVX2_PATH static void measure_avx2(rows *r, const step_filter *f, int base, int shift) {
    measure(r, f, base, shift, filter_avx2);
}
#endif

void rows_measure(rows *r, int scale, int base, int shift) {
    const step_filter *filters = r->steps->f[scale][0];
#if defined(__x86_64__)
    if (HAS_AVX2 && !r->portable) {
        measure_avx2(r, filters, base, shift);
        return;
    }
#endif
    measure_portable(r, filters, base, shift);
}

/* ---- a first look --------------------------------------------------------------------------- */

static double level_at(const rows *r, const row_place *q, int d) {
    const arris_image *im = r->image;
    int u = q->at + d, x = r->columns ? q->line : u, y = r->columns ? u : q->line;
    const uint8_t *p = im->data + y * im->stride;
    return im->format == ARRIS_GREY16 ? ((const uint16_t *)(const void *)p)[x] : p[x];
}

void rows_probe(const rows *r, int reach, double *before, double *behind) {
    *before = *behind = 0;
    for (uint32_t k = 0; k < PROBES; k++) {
        const row_place *q = &r->place[r->n * (2 * k + 1) / (2 * PROBES)];
        int d = q->half < reach ? q->half : reach;
        *before += level_at(r, q, -d) / PROBES;
        *behind += level_at(r, q, d - 1) / PROBES;
    }
}
