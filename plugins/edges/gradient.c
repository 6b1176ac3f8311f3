/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * gradient.c: Gaussian and gradient (thesis, eq. 2.1 to 2.3) and non-maximum suppression along the
 * gradient's main axis (Devernay, INRIA RR-2724, 1995), in one pass over the picture.
 *
 * A few rows are kept, in 16-bit integers: grey levels of 14 bits, products cut to their upper
 * halves. The row functions are plain loops that compilers vectorise; they are inlined into one
 * pass for each instruction set, and give the same bits in all.
 */
#include "gradient.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    BITS = GRADIENT_BITS,
    CHUNK = 64, /* px that are skipped together when none of them reaches `low` */
    MARGIN = 2  /* px beyond the Gaussian that a point's neighbourhood needs */
};

/* Rows are worked on in whole vectors; their buffers have room for that. */
INLINE int whole(int n) {
    return (n + 15) & ~15;
}

/* ---- rows ----------------------------------------------------------------------------------- */

INLINE void load_row(const arris_image *im, int y, int shift, int16_t *restrict out) {
    int n = im->width;
    const uint8_t *p8 = im->data + y * im->stride;
    const uint16_t *p16 = (const uint16_t *)p8;
    if (im->format == ARRIS_GREY8)
        for (int x = 0; x < n; x++)
            out[x] = (int16_t)(p8[x] << (BITS - 8));
    else if (shift >= 0)
        for (int x = 0; x < n; x++)
            out[x] = (int16_t)(p16[x] << shift);
    else
        for (int x = 0; x < n; x++)
            out[x] = (int16_t)(p16[x] >> -shift);
}

INLINE uint16_t mulhi(uint16_t a, uint16_t b) {
    return (uint16_t)((uint32_t)a * b >> 16);
}

/* The middle row and two pairs around it, weighted: a[0] t[0] + (a[1] + b[1]) t[1] + ... */
INLINE void smooth_five(const int16_t *const *a, const int16_t *const *b, const uint16_t *t,
                        int16_t *restrict out, int n) {
    const int16_t *a0 = a[0], *a1 = a[1], *b1 = b[1], *a2 = a[2], *b2 = b[2];
    uint16_t t0 = t[0], t1 = t[1], t2 = t[2];
    for (int x = 0; x < n; x++)
        out[x] = (int16_t)(mulhi((uint16_t)a0[x], t0) + mulhi((uint16_t)(a1[x] + b1[x]), t1) +
                           mulhi((uint16_t)(a2[x] + b2[x]), t2));
}

INLINE void smooth_more(const int16_t *restrict a, const int16_t *restrict b, uint16_t t,
                        int16_t *restrict out, int n) {
    for (int x = 0; x < n; x++)
        out[x] = (int16_t)(out[x] + mulhi((uint16_t)(a[x] + b[x]), t));
}

INLINE void smooth(const int16_t *const *a, const int16_t *const *b, const uint16_t *t, int radius,
                   int16_t *restrict out, int n) {
    smooth_five(a, b, t, out, n);
    for (int k = 3; k <= radius; k++)
        smooth_more(a[k], b[k], t[k], out, n);
}

/* The rows `in` to a smoothed row, right of its first `radius` columns. */
INLINE void smooth_row(gradient *g, int width, int16_t *out) {
    const int16_t *a[GRADIENT_MAX_RADIUS + 1], *b[GRADIENT_MAX_RADIUS + 1];
    int r = g->radius;
    for (int k = 0; k <= r || k <= 2; k++)
        a[k] = g->in[k <= r ? r - k : 0], b[k] = g->in[k <= r ? r + k : 0];
    smooth(a, b, g->tap, r, g->vertical, whole(width));
    for (int k = 0; k <= r || k <= 2; k++)
        a[k] = g->vertical + (k <= r ? r - k : 0), b[k] = g->vertical + (k <= r ? r + k : 0);
    smooth(a, b, g->tap, r, out + r, whole(width - 2 * r));
}

INLINE int16_t magnitude(int16_t gx, int16_t gy) {
    int16_t x = (int16_t)abs(gx), y = (int16_t)abs(gy);
    int16_t most = x > y ? x : y, least = x > y ? y : x;
    int16_t size = (int16_t)(most + (least >> 1)), odd = y > x ? -1 : 0;
    return (int16_t)((size | 1) + odd);
}

/* |g| to within 12 %, in proportion for a given direction, from three smoothed rows; its lowest bit
 * says that x is the main axis. */
INLINE void magnitude_row(int16_t *const s[3], int16_t *restrict m, int x0, int n) {
    const int16_t *up = s[0] + x0, *mid = s[1] + x0, *down = s[2] + x0;
    for (int x = 0; x < n; x++)
        m[x] = magnitude((int16_t)(mid[x + 1] - mid[x - 1]), (int16_t)(down[x] - up[x]));
}

INLINE bool reaches(const int16_t *m, int16_t low) {
    int16_t most = 0;
    for (int x = 0; x < CHUNK; x++)
        most = m[x] > most ? m[x] : most;
    return most >= low;
}

/* Marks the maxima along the main axis among CHUNK pixels. */
INLINE void mark(const int16_t *restrict up, const int16_t *restrict m,
                 const int16_t *restrict down, int16_t low, uint8_t *restrict mask) {
    for (int x = 0; x < CHUNK; x++) {
        int16_t c = m[x], h = (int16_t) - (c & 1);
        int16_t a = (int16_t)((h & m[x - 1]) | (~h & up[x]));
        int16_t b = (int16_t)((h & m[x + 1]) | (~h & down[x]));
        mask[x] = (uint8_t)((c >= low) & (c > a) & (c >= b));
    }
}

/* ---- edgels --------------------------------------------------------------------------------- */

/* Appends pixel (x, y), the middle of three rows, unless its gradient is too small. */
INLINE void append(int16_t *const s[3], int16_t *const m[3], int x, int y, int32_t low2,
                   edgels *e) {
    int gx = s[1][x + 1] - s[1][x - 1], gy = s[2][x] - s[0][x], h = m[1][x] & 1;
    e->item[e->n] = (edgel){
        .x = (int16_t)x,
        .y = (int16_t)y,
        .gx = (int16_t)gx,
        .gy = (int16_t)gy,
        .across = (int16_t)h,
        .before = m[h][x - h],
        .here = m[1][x],
        .after = m[2 - h][x + h],
    };
    e->n += gx * gx + gy * gy >= low2;
}

INLINE uint64_t pack(const uint8_t *mask) {
    uint64_t bits = 0;
    for (int i = 0; i < CHUNK; i += 8) {
        uint64_t bytes;
        memcpy(&bytes, mask + i, sizeof bytes);
        bits |= bytes * 0x0102040810204080 >> 56 << i;
    }
    return bits;
}

INLINE void edgels_row(gradient *g, int y, int x0, int x1, int16_t least, edgels *e) {
    for (int x = x0; x < x1; x += CHUNK) {
        if (!reaches(g->m[1] + x, least))
            continue;
        mark(g->m[0] + x, g->m[1] + x, g->m[2] + x, least, g->mask);
        uint64_t bits = pack(g->mask);
        if (x1 - x < CHUNK)
            bits &= (UINT64_C(1) << (x1 - x)) - 1;
        if (e->max - e->n < CHUNK) {
            e->lost += (uint32_t)__builtin_popcountll(bits);
            continue;
        }
        for (; bits; bits &= bits - 1)
            append(g->s, g->m, x + __builtin_ctzll(bits), y, least * least, e);
    }
}

/* ---- the pass ------------------------------------------------------------------------------- */

static void turn(int16_t **row, int n) {
    int16_t *oldest = row[0];
    memmove(row, row + 1, (size_t)(n - 1) * sizeof *row);
    row[n - 1] = oldest;
}

INLINE void pass(gradient *g, const arris_image *im, int shift, int16_t low, edgels *e) {
    int r = g->radius, w = im->width, h = im->height, edge = r + MARGIN;
    for (int y = 0; y < h; y++) {
        turn(g->in, 2 * r + 1);
        load_row(im, y, shift, g->in[2 * r]);
        if (y < 2 * r)
            continue;
        turn(g->s, 4);
        smooth_row(g, w, g->s[3]);
        turn(g->m, 3);
        if (y >= 2 * r + 2)
            magnitude_row(g->s + 1, g->m[2] + r + 1, r + 1, whole(w - 2 * r - 2));
        if (y >= 2 * r + 4) {
            edgels_row(g, y - edge, edge, w - edge, low, e);
            e->row[y - edge + 1] = e->n;
        }
    }
}

SCALAR_PATH static void pass_scalar(gradient *g, const arris_image *im, int shift, int16_t low,
                                    edgels *e) {
    pass(g, im, shift, low, e);
}

static void pass_vector(gradient *g, const arris_image *im, int shift, int16_t low, edgels *e) {
    pass(g, im, shift, low, e);
}

AVX2_PATH static void pass_avx2(gradient *g, const arris_image *im, int shift, int16_t low,
                                edgels *e) {
    pass(g, im, shift, low, e);
}

void gradient_edgels(gradient *g, const arris_image *im, int shift, float low, edgels *e,
                     enum path path) {
    static void (*const passes[])(gradient *, const arris_image *, int, int16_t,
                                  edgels *) = {pass_scalar, pass_vector, pass_avx2};
    int edge = g->radius + MARGIN;
    e->n = e->lost = 0;
    memset(e->row, 0, ((size_t)im->height + 1) * sizeof *e->row);
    if (im->width <= 2 * edge || im->height <= 2 * edge)
        return;
    passes[path](g, im, shift, (int16_t)fminf(ceilf(low), INT16_MAX), e);
    for (int y = im->height - edge + 1; y <= im->height; y++)
        e->row[y] = e->n;
}

/* ---- setting up ----------------------------------------------------------------------------- */

static void set_taps(gradient *g, double sigma) {
    double t[GRADIENT_MAX_RADIUS + 1], sum = 0;
    g->radius = (int)(2.5 * sigma);
    for (int k = 0; k <= g->radius; k++) {
        t[k] = k ? exp(-0.5 * k * k / (sigma * sigma)) : 1;
        sum += k ? 2 * t[k] : 1;
    }
    for (int k = 0; k <= g->radius; k++)
        g->tap[k] = (uint16_t)fmin(round(65536 * t[k] / sum), UINT16_MAX);
}

int gradient_init(gradient *g, int width, double sigma) {
    *g = (gradient){0};
    set_taps(g, sigma);
    /* a chunk may reach beyond the row's end, and starts one pixel before */
    size_t w = ((size_t)width + 2 * CHUNK) / CHUNK * CHUNK;
    size_t rows = 2 * (size_t)g->radius + 1 + 1 + 4 + 3 + 1;
    int16_t *p = g->memory = calloc(rows * w, sizeof *p);
    if (!p)
        return ARRIS_E_MEMORY;
    for (int i = 0; i <= 2 * g->radius; i++, p += w)
        g->in[i] = p;
    for (int i = 0; i < 4; i++, p += w)
        g->s[i] = p;
    for (int i = 0; i < 3; i++, p += w)
        g->m[i] = p;
    g->vertical = p;
    g->mask = (uint8_t *)(p + w);
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
    for (int y = 0; y < im->height; y++) {
        const uint16_t *row = (const uint16_t *)(im->data + y * im->stride);
        for (int x = 0; x < im->width; x++)
            all |= row[x];
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
