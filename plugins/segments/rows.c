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
    eight *p = r->t = aligned_alloc(sizeof(eight), (3 + 2 * LANES) * n * sizeof(eight));
    if (!r->place || !p)
        return ARRIS_E_MEMORY;
    r->across = p += n;
    r->shift = p += n;
    r->answers = p += n;
    r->offset = p + LANES * n;
    return 0;
}

void rows_free(rows *r) {
    free(r->place);
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
    return q->line >= b->line && q->line < b->line + BLOCK_LINES && q->at >= b->at + STEP_HALF &&
           q->at <= b->at + BLOCK_PIXELS - STEP_HALF;
}

/* Takes in the columns from that of `q` on, and the pixels that a line needs which goes on to
 * greater places in them when `rising`. The picture is at least as large as a block. */
typedef void loader(block *b, const arris_image *im, const row_place *q, bool rising);

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

__attribute__((noinline)) static void load_portable(block *b, const arris_image *im,
                                                    const row_place *q, bool rising) {
    block_load(b, im, q, rising);
}

__attribute__((noinline)) AVX2_PATH static void load_avx2(block *b, const arris_image *im,
                                                          const row_place *q, bool rising) {
    block_load(b, im, q, rising);
}

/* The last pixel whose sixteen can be read at once, the first being STEP_HALF; -1: there are none.
 */
static int last_whole(const rows *r) {
    const arris_image *im = r->image;
    bool small = r->columns && (im->width < BLOCK_LINES || im->height < BLOCK_PIXELS);
    return im->format != ARRIS_GREY8 || small ? -1
                                              : (r->columns ? im->height : im->width) - STEP_HALF;
}

/* The pixels of a row as differences from the base; those that are not within its half are 0. */
INLINE void fetch(const rows *r, const row_place *q, int last, int base, int shift, block *b,
                  loader *load, int16_t *px) {
    const arris_image *im = r->image;
    const int16_t *inside = r->steps->inside[q->half - STEP_MIN];
    const uint8_t *p;
    if (q->at < STEP_HALF || q->at > last) {
        fetch_some(r, q, base, shift, px);
        return;
    }
    if (r->columns) {
        if (!block_has(b, q))
            load(b, im, q, r->place[r->n - 1].at >= r->place[0].at);
        p = (const uint8_t *)&b->column[q->line - b->line] + (q->at - STEP_HALF - b->at);
    } else {
        p = im->data + q->line * im->stride + q->at - STEP_HALF;
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

AVX2_PATH static inline __m256i twice(const int16_t *px) {
    return _mm256_broadcastsi128_si256(_mm_loadu_si128((const void *)px));
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
    __m256i first = half_sum(twice(px), w), second = half_sum(twice(px + 8), w + 4);
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
    float slope = (*answers)[STEP_SLOPE];
    s->total += f->part * (four){1, 1, slope, slope};
}

/* `filters` are those of one scale. */
INLINE void measure(rows *r, const step_filter *filters, int base, int shift, loader *load,
                    filter *answer_to) {
    const float *t = (const float *)r->t;
    const row_place *place = r->place;
    eight *answers = r->answers, *offset = r->offset;
    uint32_t n = r->n;
    float unit = (float)(1 << shift), per_answer = unit / STEP_UNIT;
    row_sums all = {0};
    block columns;
    columns.line = -BLOCK_LINES; /* holds nothing */
    int last = last_whole(r);
    for (uint32_t i = 0; i < n; i++) {
        const step_filter *f = &filters[place[i].filter];
        int16_t px[STEP_WIDTH];
        eight_ints sum, square;
        fetch(r, &place[i], last, base, shift, &columns, load, px);
        answer_to(f, px, &sum, &square);
        eight a = __builtin_convertvector(sum, eight) * per_answer;
        add(&all, f, &a, t[i]);
        all.squares += __builtin_convertvector(square, eight);
        answers[i] = a;
        offset[i] = f->offset;
    }
    all.squares *= unit * unit;
    r->sum = all;
}

static void measure_portable(rows *r, const step_filter *f, int base, int shift) {
    measure(r, f, base, shift, load_portable, filter_portable);
}

#if defined(__x86_64__)
AVX2_PATH static void measure_avx2(rows *r, const step_filter *f, int base, int shift) {
    measure(r, f, base, shift, load_avx2, filter_avx2);
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

void rows_probe(const rows *r, int reach, double level[ROWS_PROBED]) {
    const arris_image *im = r->image;
    ptrdiff_t size = (ptrdiff_t)im->format, along = r->columns ? im->stride : size;
    ptrdiff_t line = r->columns ? size : im->stride;
    int sum[ROWS_PROBED] = {0};
    for (uint32_t k = 0; k < PROBES; k++) {
        const row_place *q = &r->place[r->n * (2 * k + 1) / (2 * PROBES)];
        const uint8_t *p = im->data + q->line * line + q->at * along;
        int d = q->half < reach ? q->half : reach, at[ROWS_PROBED] = {-d, -2, -1, 0, 1, d - 1};
        for (int j = 0; j < ROWS_PROBED; j++) {
            const uint8_t *pixel = p + at[j] * along;
            sum[j] += size == 2 ? *(const uint16_t *)(const void *)pixel : *pixel;
        }
    }
    for (int j = 0; j < ROWS_PROBED; j++)
        level[j] = (double)sum[j] / PROBES;
}
