/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * gradient.c: Gaussian and gradient (thesis, eq. 2.1 to 2.3) and non-maximum suppression along the
 * gradient's main axis (Devernay, INRIA RR-2724, 1995), in one pass over the picture.
 *
 * A few rows are kept, in 16-bit integers: grey levels of 14 bits, products cut to their upper
 * halves. The row functions are plain loops that compilers vectorise; they are inlined into one
 * pass for each instruction set, and give the same bits in all.
 */
#include "append.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

enum {
    BITS = GRADIENT_BITS,
    VECTOR = 16,
    LINE = 32,  /* px on a line of the cache */
    CHUNK = 64, /* px that are skipped together when none of them reaches `low` */
    MARGIN = 2  /* px beyond the Gaussian that a point's neighbourhood needs */
};

/* Rows are worked on in whole vectors; their buffers have room for that. */
INLINE int whole(int n) {
    return (n + VECTOR - 1) / VECTOR * VECTOR;
}

/* ---- rows ----------------------------------------------------------------------------------- */

INLINE void load_row(const arris_image *im, int y, int shift, int16_t *restrict out) {
    int n = im->width;
    const uint8_t *p = im->data + y * im->stride;
    for (int x = 0; x < n * (int)im->format; x += CHUNK) /* a large picture's rows come from far */
        __builtin_prefetch(p + im->stride + x);
    if (im->format == ARRIS_GREY8) {
        for (int x = 0; x < n; x++)
            out[x] = (int16_t)(p[x] << (BITS - 8));
        return;
    }
    memcpy(out, p, (size_t)n * sizeof *out);
    for (int x = 0; x < n; x++)
        out[x] = (int16_t)(shift >= 0 ? (uint16_t)out[x] << shift : (uint16_t)out[x] >> -shift);
}

INLINE uint16_t mulhi(uint16_t a, uint16_t b) {
    return (uint16_t)((uint32_t)a * b >> 16);
}

/* Rows weighted by the taps, which are symmetric: those around row[0], from row[-radius] on. */
INLINE void smooth(const int16_t *const *row, const uint16_t *tap, int radius,
                   int16_t *restrict out, int n) {
    const int16_t *a = row[-2], *b = row[-1], *c = row[0], *d = row[1], *e = row[2];
    uint16_t t0 = tap[0], t1 = tap[1], t2 = tap[2];
    for (int x = 0; x < n; x++)
        out[x] = (int16_t)(mulhi((uint16_t)c[x], t0) + mulhi((uint16_t)(b[x] + d[x]), t1) +
                           mulhi((uint16_t)(a[x] + e[x]), t2));
    for (int k = 3; k <= radius; k++) {
        const int16_t *f = row[-k], *g = row[k];
        for (int x = 0; x < n; x++)
            out[x] = (int16_t)(out[x] + mulhi((uint16_t)(f[x] + g[x]), tap[k]));
    }
}

/* |g| to within 12 %, in proportion for a given direction, and never less than |g| - 2; its lowest
 * bit says that x is the main axis. */
INLINE int16_t magnitude(int16_t gx, int16_t gy) {
    int16_t x = (int16_t)abs(gx), y = (int16_t)abs(gy);
    int16_t most = x > y ? x : y, least = x > y ? y : x;
    int16_t size = (int16_t)(most + (least >> 1)), odd = y > x ? -1 : 0;
    return (int16_t)((size | 1) + odd);
}

/* Of the row in the middle of three smoothed ones, columns x0 to x1 - 1; 0 after them. */
INLINE void magnitude_row(int16_t *const s[3], int16_t *restrict m, int x0, int x1) {
    const int16_t *up = s[0] + x0, *mid = s[1] + x0, *down = s[2] + x0;
    for (int x = 0; x < whole(x1 - x0); x++)
        m[x0 + x] = magnitude((int16_t)(mid[x + 1] - mid[x - 1]), (int16_t)(down[x] - up[x]));
    memset(m + x1, 0, VECTOR * sizeof *m);
}

INLINE bool any_above(const int16_t *m, int16_t least) {
    int16_t most = INT16_MIN;
    for (int x = 0; x < CHUNK; x++)
        most = m[x] > most ? m[x] : most;
    return most > least;
}

/* The set of those of CHUNK pixels, in the middle one of three rows, that are above `least` and a
 * maximum along their main axis. */
typedef uint64_t marker(const int16_t *up, const int16_t *m, const int16_t *down, int16_t least);

INLINE uint64_t mark(const int16_t *restrict up, const int16_t *restrict m,
                     const int16_t *restrict down, int16_t least) {
    uint8_t mask[CHUNK];
    uint64_t bits = 0;
    if (!any_above(m, least))
        return 0;
    for (int x = 0; x < CHUNK; x++) {
        int16_t c = m[x], h = (int16_t) - (c & 1);
        int16_t a = (int16_t)((h & m[x - 1]) | (~h & up[x]));
        int16_t b = (int16_t)((h & m[x + 1]) | (~h & down[x]));
        mask[x] = (uint8_t)((c > least) & (c > a) & (c >= b));
    }
    for (int i = 0; i < CHUNK; i += 8) {
        uint64_t bytes;
        memcpy(&bytes, mask + i, sizeof bytes);
        bits |= bytes * 0x0102040810204080 >> 56 << i;
    }
    return bits;
}

#if defined(__x86_64__)
AVX2_PATH static inline __m256i mark_sixteen(const int16_t *up, const int16_t *m,
                                             const int16_t *down, __m256i least) {
    __m256i c = _mm256_loadu_si256((const void *)m);
    __m256i across = _mm256_srai_epi16(_mm256_slli_epi16(c, 15), 15);
    __m256i a = _mm256_blendv_epi8(_mm256_loadu_si256((const void *)up),
                                   _mm256_loadu_si256((const void *)(m - 1)), across);
    __m256i b = _mm256_blendv_epi8(_mm256_loadu_si256((const void *)down),
                                   _mm256_loadu_si256((const void *)(m + 1)), across);
    __m256i above = _mm256_and_si256(_mm256_cmpgt_epi16(c, least), _mm256_cmpgt_epi16(c, a));
    return _mm256_andnot_si256(_mm256_cmpgt_epi16(b, c), above);
}

AVX2_PATH static inline uint64_t mark_avx2(const int16_t *up, const int16_t *m, const int16_t *down,
                                           int16_t least) {
    const __m256i *of = (const void *)m;
    __m256i most = _mm256_max_epi16(_mm256_loadu_si256(of), _mm256_loadu_si256(of + 1));
    most = _mm256_max_epi16(most, _mm256_loadu_si256(of + 2));
    most = _mm256_max_epi16(most, _mm256_loadu_si256(of + 3));
    __m256i low = _mm256_set1_epi16(least);
    uint64_t bits = 0;
    if (!_mm256_movemask_epi8(_mm256_cmpgt_epi16(most, low)))
        return 0;
    for (int x = 0; x < CHUNK; x += 32) {
        __m256i a = mark_sixteen(up + x, m + x, down + x, low);
        __m256i b = mark_sixteen(up + x + 16, m + x + 16, down + x + 16, low);
        __m256i both = _mm256_permute4x64_epi64(_mm256_packs_epi16(a, b), 0xD8);
        bits |= (uint64_t)(uint32_t)_mm256_movemask_epi8(both) << x;
    }
    return bits;
}
#endif

/* Finds the edgels of a row, the middle of three, in the columns x0 to x1 - 1. */
INLINE void find(gradient *g, int x0, int x1, int16_t low, uint32_t room, uint32_t *lost,
                 marker *set, collector *take) {
    int16_t least = (int16_t)(low - 2);
    uint32_t n = 0;
    int words = 0;
    for (int x = x0; x < x1; x += CHUNK, words++) {
        uint64_t bits = set(g->m[0] + x, g->m[1] + x, g->m[2] + x, least);
        if (x1 - x < CHUNK)
            bits &= (UINT64_C(1) << (x1 - x)) - 1;
        g->marked[words] = bits;
        n += (uint32_t)__builtin_popcountll(bits);
    }
    g->found.n = 0;
    if (n <= room)
        take(g, x0, words, low);
    else
        *lost += n;
}

/* ---- the pass ------------------------------------------------------------------------------- */

static void turn(int16_t **row, int n) {
    int16_t *oldest = row[0];
    memmove(row, row + 1, (size_t)(n - 1) * sizeof *row);
    row[n - 1] = oldest;
}

INLINE void pass(gradient *g, const arris_image *im, int shift, int16_t low, float dx, float dy,
                 edgels *e, marker *set, collector *take) {
    int r = g->radius, w = im->width, h = im->height, edge = r + MARGIN;
    float unit = gradient_unit(shift);
    for (int y = 0; y < h; y++) {
        turn(g->in, 2 * r + 1);
        load_row(im, y, shift, g->in[2 * r]);
        if (y < 2 * r)
            continue;
        turn(g->s, 4);
        smooth((const int16_t *const *)g->in + r, g->tap, r, g->vertical, whole(w));
        smooth(g->column + r, g->tap, r, g->s[3] + r, whole(w - 2 * r));
        turn(g->m, 3);
        if (y >= 2 * r + 2)
            magnitude_row(g->s + 1, g->m[2], r + 1, w - r - 1);
        if (y >= 2 * r + 4) {
            find(g, edge, w - edge, low, e->max - e->n, &e->lost, set, take);
            append_row(&g->found, unit, dx, (float)(y - edge) + dy, e);
            e->row[y - edge + 1] = e->n;
        }
    }
}

SCALAR_PATH static void pass_scalar(gradient *g, const arris_image *im, int shift, int16_t low,
                                    float dx, float dy, edgels *e) {
    pass(g, im, shift, low, dx, dy, e, mark, collect);
}

static void pass_vector(gradient *g, const arris_image *im, int shift, int16_t low, float dx,
                        float dy, edgels *e) {
    pass(g, im, shift, low, dx, dy, e, mark, collect);
}

AVX2_PATH static void pass_avx2(gradient *g, const arris_image *im, int shift, int16_t low,
                                float dx, float dy, edgels *e) {
#if defined(__x86_64__)
    pass(g, im, shift, low, dx, dy, e, mark_avx2, collect_avx2);
#else
    pass(g, im, shift, low, dx, dy, e, mark, collect);
#endif
}

void gradient_edgels(gradient *g, const arris_image *im, int shift, float low, float dx, float dy,
                     edgels *e, enum path path) {
    static void (*const passes[])(gradient *, const arris_image *, int, int16_t, float, float,
                                  edgels *) = {pass_scalar, pass_vector, pass_avx2};
    int edge = g->radius + MARGIN;
    e->n = e->lost = 0;
    memset(e->row, 0, ((size_t)im->height + EDGELS_AFTER) * sizeof *e->row);
    if (im->width <= 2 * edge || im->height <= 2 * edge)
        return;
    passes[path](g, im, shift, (int16_t)fminf(ceilf(low), INT16_MAX), dx, dy, e);
    for (int y = im->height - edge + 1; y < im->height + EDGELS_AFTER; y++)
        e->row[y] = e->n;
}

/* ---- setting up ----------------------------------------------------------------------------- */

static void set_taps(gradient *g, double sigma) {
    double t[GRADIENT_MAX_RADIUS + 1] = {1}, sum = 1;
    g->radius = sigma > 1 ? (int)(2.5 * sigma) : 2;
    for (int k = 1; k <= g->radius && sigma > 0; k++) {
        t[k] = exp(-0.5 * k * k / (sigma * sigma));
        sum += 2 * t[k];
    }
    for (int k = 0; k <= g->radius; k++)
        g->tap[k] = (uint16_t)fmin(round(65536 * t[k] / sum), UINT16_MAX);
}

static void set_squeeze(gradient *g) {
    for (int set = 0; set < 256; set++)
        for (int k = 0, n = 0; k < 8; k++)
            if (set >> k & 1) {
                g->squeeze[set][n++] = (uint8_t)(2 * k);
                g->squeeze[set][n++] = (uint8_t)(2 * k + 1);
            }
}

int gradient_init(gradient *g, int width, double sigma) {
    *g = (gradient){0};
    set_taps(g, sigma);
    /* A chunk may reach beyond a row. An odd number of lines: no two rows compete for a set. */
    size_t w = ((size_t)width + 2 * CHUNK) / CHUNK * CHUNK + LINE;
    int n = 2 * g->radius + 1;
    size_t size = ((size_t)(n + 8) * w + LINE) * sizeof(int16_t);
    int16_t *p = g->memory = aligned_alloc(LINE * sizeof(int16_t), size);
    if (!p)
        return ARRIS_E_MEMORY;
    memset(p, 0, size);
    p += LINE; /* what is written first of a row is at the start of a line of the cache */
    for (int i = 0; i < n; i++, p += w)
        g->in[i] = p;
    for (int i = 0; i < 4; i++, p += w)
        g->s[i] = p - g->radius;
    for (int i = 0; i < 3; i++, p += w)
        g->m[i] = p - g->radius - 1;
    for (int i = 0; i < n; i++)
        g->column[i] = p + i;
    g->vertical = p;
    set_squeeze(g);
    return 0;
}

void gradient_free(gradient *g) {
    free(g->memory);
    *g = (gradient){0};
}

int gradient_shift(const arris_image *im) {
    if (im->format == ARRIS_GREY8)
        return BITS - 8;
    unsigned all = 1;
    for (int y = 0; y < im->height; y++)
        for (int x = 0; x < im->width; x++) {
            uint16_t v;
            memcpy(&v, im->data + y * im->stride + 2 * x, sizeof v);
            all |= v;
        }
    return BITS - (32 - __builtin_clz(all));
}

float gradient_unit(int shift) {
    return ldexpf(0.5f, -shift);
}

double gradient_noise(const gradient *g) {
    double t[2 * GRADIENT_MAX_RADIUS + 5] = {0}, smooth = 0, difference = 0;
    int n = 2 * g->radius + 5;
    for (int k = -g->radius; k <= g->radius; k++)
        t[g->radius + 2 + k] = g->tap[abs(k)] / 65536.0;
    for (int k = 1; k < n - 1; k++) {
        smooth += t[k] * t[k];
        difference += 0.25 * (t[k + 1] - t[k - 1]) * (t[k + 1] - t[k - 1]);
    }
    return sqrt(smooth * difference);
}
