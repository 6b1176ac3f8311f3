/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * noise.c: noise from masks that ramps, level edges and upright ones do not excite (the idea of
 * Immerkaer, CVIU 64, 1996), as a low quantile over blocks, so that texture in half of them and
 * more has no say.
 */
#include "noise.h"

#include <math.h>
#include <string.h>

#include "path.h"

enum { SIDE = 8, COLUMNS = 10, ROWS = 7, REACH = 4, MAX_SPREAD = 5 };

static const float BIAS = 1.1f; /* of this quantile, as blocks of pure noise scatter by some 15 % */

/* The same weights across and down. */
typedef struct mask {
    int16_t weight[2 * REACH + 1];
    int reach, squares; /* squares: the sum of the weights squared */
    int bits;           /* of a pixel, so that the mask's sum fits 16 */
} mask;

typedef struct view {
    const arris_image *im;
    int shift;     /* of pixels to the right, to the mask's bits */
    int16_t white; /* the level of a saturated pixel, shifted */
    int spread;    /* px from one weight of the mask to the next */
} view;

typedef int16_t row __attribute__((vector_size(SIDE * sizeof(int16_t))));
typedef uint8_t bytes __attribute__((vector_size(16)));
typedef int32_t wide_row __attribute__((vector_size(SIDE * sizeof(int32_t))));

INLINE row load(const view *v, int x, int y) {
    const uint8_t *p = v->im->data + y * v->im->stride + x * (int)v->im->format;
    if (v->im->format == ARRIS_GREY8) {
        uint64_t eight;
        memcpy(&eight, p, sizeof eight);
        uint64_t two __attribute__((vector_size(16))) = {eight, 0};
        /* little-endian, as all our targets are */
        return (row)__builtin_shufflevector((bytes)two, (bytes){0}, 0, 16, 1, 17, 2, 18, 3, 19, 4,
                                            20, 5, 21, 6, 22, 7, 23);
    }
    uint16_t r __attribute__((vector_size(2 * SIDE)));
    memcpy(&r, p, sizeof r);
    return (row)(r >> v->shift);
}

/* The sum of the mask's absolute values over the block at (x, y). `clipped` is set when saturation
 * hides its noise. */
INLINE int32_t block(const view *v, int x, int y, const mask *m, bool *clipped) {
    row across[SIDE + 2 * REACH * MAX_SPREAD], count = {0};
    wide_row sum = {0};
    int margin = m->reach * v->spread;
    for (int j = 0; j < SIDE + 2 * margin; j++) {
        row mid = load(v, x, y + j - margin);
        across[j] = m->weight[REACH] * mid;
        for (int k = -m->reach; k <= m->reach; k++)
            if (k != 0 && m->weight[REACH + k])
                across[j] += m->weight[REACH + k] * load(v, x + k * v->spread, y + j - margin);
        count -= (mid == 0) + (mid == v->white); /* comparisons give -1 */
    }
    for (int j = 0; j < SIDE; j++) {
        row r = {0};
        for (int k = -m->reach; k <= m->reach; k++)
            if (m->weight[REACH + k])
                r += m->weight[REACH + k] * across[j + margin + k * v->spread];
        row sign = r >> 15;
        sum += __builtin_convertvector((r ^ sign) - sign, wide_row);
    }
    int32_t total = 0, all = 0;
    for (int i = 0; i < SIDE; i++) {
        total += sum[i];
        all += count[i];
    }
    *clipped = all > SIDE * SIDE / 8;
    return total;
}

/* The value at `rank` of the ascending order. */
static int32_t at_rank(const int32_t *v, int n, int rank) {
    for (int i = 0; i < n; i++) {
        int32_t less = 0, equal = 0;
        for (int j = 0; j < n; j++) {
            less += v[j] < v[i];
            equal += v[j] == v[i];
        }
        if (less <= rank && rank < less + equal)
            return v[i];
    }
    return 0;
}

INLINE float estimate(const arris_image *im, int white, const mask *m, int spread) {
    int32_t good[COLUMNS * ROWS], bad[COLUMNS * ROWS], n_good = 0, n_bad = 0;
    int margin = m->reach * spread;
    int w = im->width - SIDE - 2 * margin, h = im->height - SIDE - 2 * margin;
    view v = {im, 0, 0, spread};
    if (w < 0 || h < 0)
        return 0;
    while (white >> v.shift >= 1 << m->bits)
        v.shift++;
    v.white = (int16_t)(white >> v.shift);
    for (int i = 0; i < COLUMNS * ROWS; i++) {
        int x = margin + w * (i % COLUMNS) / (COLUMNS - 1);
        int y = margin + h * (i / COLUMNS) / (ROWS - 1);
        bool clipped;
        int32_t sum = block(&v, x, y, m, &clipped);
        *(clipped ? &bad[n_bad++] : &good[n_good++]) = sum;
    }
    int32_t sum =
        n_good ? at_rank(good, n_good, n_good * 3 / 10) : at_rank(bad, n_bad, n_bad * 3 / 10);
    /* |x| is sqrt(2 / pi) sigma on average */
    float mean = ldexpf((float)sum, v.shift) / (SIDE * SIDE);
    return BIAS * mean * sqrtf((float)M_PI / 2) / (float)m->squares;
}

float noise_of_pixels(const arris_image *im, int white) {
    static const mask pixels = {{0, 0, 0, 1, -2, 1, 0, 0, 0}, 1, 6, 12};
    return estimate(im, white, &pixels, 1);
}

float noise_of_gradients(const arris_image *im, int white, double sigma) {
    /* passes about the wavelengths that a gradient does after a Gaussian of `spread` px */
    static const mask gradients = {{1, 1, 0, -2, 0, -2, 0, 1, 1}, 4, 12, 10};
    return estimate(im, white, &gradients, sigma > 1.5 ? (int)(sigma + 0.5) : 1);
}
