/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * rows.c: measures the rows of a line (rows.h).
 */
#include "rows.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

enum { PROBES = 4, BLOCK_LINES = 16, BLOCK_PIXELS = 32 };

int rows_init(rows *r, int width, int height) {
    size_t n =
        (size_t)(width > height ? width : height) / LANES + 2; /* whole eights are appended */
    *r = (rows){.max = (uint32_t)(LANES * n)};
    r->place = malloc(r->max * sizeof *r->place);
    r->pixels = aligned_alloc(sizeof *r->pixels, r->max * sizeof *r->pixels);
    eight *p = r->t = aligned_alloc(sizeof(eight), (3 + 2 * LANES) * n * sizeof(eight));
    if (!r->place || !r->pixels || !p)
        return ARRIS_E_MEMORY;
    r->across = p += n;
    r->shift = p += n;
    r->answers = p += n;
    r->offset = p + LANES * n;
    return 0;
}

void rows_free(rows *r) {
    free(r->place);
    free(r->pixels);
    free(r->t);
}

/* ---- what is there -------------------------------------------------------------------------- */

/* The part of the sixteen pixels around the place before pixel `at` that is within `half`, in any
 * format. */
__attribute__((noinline)) static void fetch_some(const rows *r, const row_place *q, int base,
                                                 int shift, int16_t *px) {
    const arris_image *im = r->image;
    ptrdiff_t size = (ptrdiff_t)im->format, step = r->columns ? im->stride : size;
    const uint8_t *p = im->data + q->line * (r->columns ? size : im->stride);
    p += (q->at - q->half) * step;
    memset(px, 0, STEP_WIDTH * sizeof *px);
    for (int j = STEP_HALF - q->half; j < STEP_HALF + q->half; j++, p += step) {
        int level = ((size == 2 ? *(const uint16_t *)(const void *)p : *p) - base) >> shift;
        px[j] = (int16_t)(level < -STEP_MOST ? -STEP_MOST : level > STEP_MOST ? STEP_MOST : level);
    }
}

typedef uint8_t two_rows __attribute__((vector_size(BLOCK_PIXELS), aligned(16)));

/* Columns of the picture side by side, as rows: to walk down one column after another costs more.
 */
typedef struct block {
    int32_t line, at; /* the first column, and the first pixel in each */
    two_rows column[BLOCK_LINES];
} block;

/* Transposes two times 16x16 bytes: four times, the two halves are shuffled into each other. */
INLINE void transpose(two_rows *v) {
    for (int round = 0; round < 4; round++) {
        two_rows t[16];
        for (int k = 0; k < 8; k++) {
            t[2 * k] = __builtin_shufflevector(v[k], v[k + 8], 0, 32, 1, 33, 2, 34, 3, 35, 4, 36, 5,
                                               37, 6, 38, 7, 39, 16, 48, 17, 49, 18, 50, 19, 51, 20,
                                               52, 21, 53, 22, 54, 23, 55);
            t[2 * k + 1] = __builtin_shufflevector(v[k], v[k + 8], 8, 40, 9, 41, 10, 42, 11, 43, 12,
                                                   44, 13, 45, 14, 46, 15, 47, 24, 56, 25, 57, 26,
                                                   58, 27, 59, 28, 60, 29, 61, 30, 62, 31, 63);
        }
        for (int k = 0; k < 16; k++)
            v[k] = t[k];
    }
}

static bool block_has(const block *b, const row_place *q) {
    return (uint32_t)(q->line - b->line) < BLOCK_LINES &&
           (uint32_t)(q->at - STEP_HALF - b->at) <= BLOCK_PIXELS - STEP_WIDTH;
}

/* Takes in the columns from that of `q` on, and the pixels that a line needs which goes on to
 * greater places in them when `rising`. The picture is at least as large as a block. */
INLINE void block_load(block *b, const arris_image *im, const row_place *q, bool rising) {
    int at = rising ? q->at - STEP_HALF - 1 : q->at + STEP_HALF + 1 - BLOCK_PIXELS;
    int last = im->width - BLOCK_LINES, end = im->height - BLOCK_PIXELS;
    b->line = q->line < last ? q->line : last;
    b->at = at < 0 ? 0 : at < end ? at : end;
    const uint8_t *p = im->data + b->at * im->stride + b->line;
    for (int i = 0; i < BLOCK_LINES; i++, p += im->stride) {
        bytes half[2];
        memcpy(&half[0], p, sizeof half[0]);
        memcpy(&half[1], p + BLOCK_LINES * im->stride, sizeof half[1]);
        b->column[i] = __builtin_shufflevector(half[0], half[1], 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10,
                                               11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23,
                                               24, 25, 26, 27, 28, 29, 30, 31);
    }
    transpose(b->column);
}

/* How many places for a line, from STEP_HALF on, have sixteen pixels that can be read at once. */
static uint32_t whole_places(const rows *r) {
    const arris_image *im = r->image;
    int width = r->columns ? im->height : im->width, lines = r->columns ? im->width : im->height;
    bool small =
        width < (r->columns ? BLOCK_PIXELS : STEP_WIDTH) || (r->columns && lines < BLOCK_LINES);
    return im->format != ARRIS_GREY8 || small ? 0 : width - STEP_WIDTH + 1;
}

/* Sixteen levels less the base. */
INLINE void take_off(const uint8_t *p, int16_t base, sixteen *px) {
    bytes level;
    memcpy(&level, p, sizeof level);
    for (int j = 0; j < STEP_WIDTH; j++)
        (*px)[j] = (int16_t)(level[j] - base);
}

INLINE void fetch(rows *r, int base, int shift) {
    const arris_image im = *r->image;
    const row_place *q = r->place, *end = q + r->n;
    const uint32_t whole = whole_places(r);
    sixteen *px = r->pixels;
    block b;
    if (!r->columns) {
        for (; q < end; q++, px++)
            if ((uint32_t)(q->at - STEP_HALF) < whole)
                take_off(im.data + q->line * im.stride + (q->at - STEP_HALF), (int16_t)base, px);
            else
                fetch_some(r, q, base, shift, (int16_t *)px);
        return;
    }
    bool rising = end[-1].at >= q->at;
    b.line = -BLOCK_LINES; /* holds nothing */
    for (; q < end; q++, px++) {
        if ((uint32_t)(q->at - STEP_HALF) >= whole) {
            fetch_some(r, q, base, shift, (int16_t *)px);
            continue;
        }
        if (!block_has(&b, q))
            block_load(&b, &im, q, rising);
        take_off((uint8_t *)&b.column[q->line - b.line] + (q->at - STEP_HALF - b.at), (int16_t)base,
                 px);
    }
}

static void fetch_portable(rows *r, int base, int shift) {
    fetch(r, base, shift);
}

AVX2_PATH static void fetch_avx2(rows *r, int base, int shift) {
    fetch(r, base, shift);
}

void rows_fetch(rows *r, int base, int shift) {
    r->unit = (float)(1 << shift);
    (HAS_AVX2 && !r->portable ? fetch_avx2 : fetch_portable)(r, base, shift);
}

/* ---- what it tells -------------------------------------------------------------------------- */

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
        a &= f->inside[2 * i], b &= f->inside[2 * i + 1];
        (*square)[i] = a * a + b * b;
    }
    memcpy(answer, sum, sizeof sum);
}

#if defined(__x86_64__)
/* Four pairs of pixels times their weights in the eight filters, from the pair i on. */
AVX2_PATH static inline __m256i products(const step_filter *f, const int16_t *px, int i) {
    __m256i half = _mm256_broadcastsi128_si256(_mm_loadu_si128((const void *)(px + 2 * i)));
    const __m256i *w = (const void *)f->w[i];
    __m256i a = _mm256_madd_epi16(_mm256_shuffle_epi32(half, 0x00), _mm256_loadu_si256(w));
    __m256i b = _mm256_madd_epi16(_mm256_shuffle_epi32(half, 0x55), _mm256_loadu_si256(w + 1));
    __m256i c = _mm256_madd_epi16(_mm256_shuffle_epi32(half, 0xAA), _mm256_loadu_si256(w + 2));
    __m256i d = _mm256_madd_epi16(_mm256_shuffle_epi32(half, 0xFF), _mm256_loadu_si256(w + 3));
    return _mm256_add_epi32(_mm256_add_epi32(a, b), _mm256_add_epi32(c, d));
}

AVX2_PATH static inline void filter_avx2(const step_filter *f, const int16_t *px,
                                         eight_ints *answer, eight_ints *square) {
    __m256i inside = _mm256_loadu_si256((const void *)f->inside);
    inside = _mm256_and_si256(inside, _mm256_loadu_si256((const void *)px));
    __m256i sum = _mm256_add_epi32(products(f, px, 0), products(f, px, 4));
    _mm256_storeu_si256((void *)answer, sum);
    _mm256_storeu_si256((void *)square, _mm256_madd_epi16(inside, inside));
}
#endif

INLINE void add(row_sums *s, const step_filter *f, const eight *answers, float t) {
    eight answer = f->response * *answers, weight = f->response * f->response;
    s->answer += answer;
    s->answer_t += answer * t;
    s->weight += weight;
    weight *= t;
    s->weight_t += weight;
    s->weight_tt += weight * t;
    s->explained += *answers * *answers;
    float slope = (*answers)[STEP_SLOPE];
    s->total += f->part * (four){1, 1, slope, slope};
}

/* `filters` are those of one scale. */
INLINE void measure(rows *r, const step_filter *filters, filter *answer_to) {
    const float *t = (const float *)r->t;
    const row_place *place = r->place;
    const sixteen *pixels = r->pixels;
    eight *answers = r->answers, *offset = r->offset;
    float per_answer = r->unit / STEP_UNIT;
    row_sums all = {0};
    for (uint32_t i = 0, n = r->n; i < n; i++) {
        const step_filter *f = &filters[place[i].filter];
        eight_ints sum, square;
        answer_to(f, (const int16_t *)&pixels[i], &sum, &square);
        eight a = __builtin_convertvector(sum, eight) * per_answer;
        add(&all, f, &a, t[i]);
        all.squares += __builtin_convertvector(square, eight);
        answers[i] = a;
        offset[i] = f->offset;
    }
    all.squares *= r->unit * r->unit;
    r->sum = all;
}

static void measure_portable(rows *r, const step_filter *f) {
    measure(r, f, filter_portable);
}

#if defined(__x86_64__)
AVX2_PATH static void measure_avx2(rows *r, const step_filter *f) {
    measure(r, f, filter_avx2);
}
#endif

void rows_measure(rows *r, int scale) {
    const step_filter *filters = r->steps->f[scale][0];
#if defined(__x86_64__)
    if (HAS_AVX2 && !r->portable) {
        measure_avx2(r, filters);
        return;
    }
#endif
    measure_portable(r, filters);
}

/* ---- a first look --------------------------------------------------------------------------- */

INLINE int level(const uint8_t *p, bool wide) {
    return wide ? *(const uint16_t *)(const void *)p : *p;
}

INLINE void probe(const rows *r, int reach, bool wide, int sum[ROWS_PROBED]) {
    const arris_image *im = r->image;
    ptrdiff_t size = wide ? 2 : 1, along = r->columns ? im->stride : size;
    ptrdiff_t line = r->columns ? size : im->stride;
    for (uint32_t k = 0; k < PROBES; k++) {
        const row_place *q = &r->place[r->n * (2 * k + 1) / (2 * PROBES)];
        const uint8_t *p = im->data + q->line * line + q->at * along;
        ptrdiff_t far = (q->half < reach ? q->half : reach) * along;
        sum[0] += level(p - far, wide);
        for (int j = 1; j < ROWS_PROBED - 1; j++)
            sum[j] += level(p + (j - 3) * along, wide);
        sum[ROWS_PROBED - 1] += level(p + far - along, wide);
    }
}

void rows_probe(const rows *r, int reach, double mean[ROWS_PROBED]) {
    int sum[ROWS_PROBED] = {0};
    r->image->format == ARRIS_GREY16 ? probe(r, reach, true, sum) : probe(r, reach, false, sum);
    for (int j = 0; j < ROWS_PROBED; j++)
        mean[j] = (double)sum[j] / PROBES;
}
