/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * noise.c: noise from masks that ramps, level edges and upright ones do not excite (the idea of
 * Immerkaer, CVIU 64, 1996), as a low quantile over blocks, so that texture in up to half of them
 * has no say.
 */
#include "noise.h"

#include <math.h>
#include <string.h>

#include "path.h"

enum { WIDTH = 8, HEIGHT = 8, COLUMNS = 8, ROWS = 8, BITS = 11, REACH = 4, MAX_SPREAD = 5 };

static const float BIAS = 1.1f; /* of this quantile, as blocks of pure noise scatter by some 15 % */

/* The product of weights across and down. */
typedef struct mask {
    int16_t across[2 * REACH + 1], down[2 * REACH + 1];
    int reach_across, reach_down, squares; /* squares: the sum of all weights squared */
} mask;

typedef struct view {
    const arris_image *im;
    int shift;     /* to the right, so that a pixel has at most BITS */
    int16_t white; /* the level of a saturated pixel, shifted */
} view;

typedef int16_t row __attribute__((vector_size(WIDTH * sizeof(int16_t))));
typedef int32_t wide_row __attribute__((vector_size(WIDTH * sizeof(int32_t))));

INLINE row load(const view *v, int x, int y) {
    const uint8_t *p = v->im->data + y * v->im->stride + x * (int)v->im->format;
    if (v->im->format == ARRIS_GREY8) {
        uint8_t r __attribute__((vector_size(WIDTH)));
        memcpy(&r, p, sizeof r);
        return __builtin_convertvector(r, row);
    }
    uint16_t r __attribute__((vector_size(WIDTH * sizeof(uint16_t))));
    memcpy(&r, p, sizeof r);
    return (row)(r >> v->shift);
}

/* The sum of the mask's absolute values over the block at (x, y). `clipped` is set when saturation
 * hides its noise. */
INLINE int32_t block(const view *v, int x, int y, const mask *m, int spread, bool *clipped) {
    row across[HEIGHT + 2 * REACH * MAX_SPREAD], count = {0};
    int margin = m->reach_down * spread;
    for (int j = 0; j < HEIGHT + 2 * margin; j++) {
        across[j] = (row){0};
        for (int k = -m->reach_across; k <= m->reach_across; k++)
            if (m->across[REACH + k])
                across[j] += m->across[REACH + k] * load(v, x + k * spread, y + j - margin);
        row mid = load(v, x, y + j - margin);
        count -= (mid == 0) + (mid == v->white); /* comparisons give -1 */
    }
    wide_row sum = {0};
    for (int j = 0; j < HEIGHT; j++) {
        row r = {0};
        for (int k = -m->reach_down; k <= m->reach_down; k++)
            if (m->down[REACH + k])
                r += m->down[REACH + k] * across[j + margin + k * spread];
        row sign = r >> 15;
        sum += __builtin_convertvector((r ^ sign) - sign, wide_row);
    }
    int32_t total = 0, all = 0;
    for (int i = 0; i < WIDTH; i++) {
        total += sum[i];
        all += count[i];
    }
    *clipped = all > WIDTH * HEIGHT / 8;
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

/* The mask's weights are `spread` pixels apart. */
INLINE float estimate(const arris_image *im, int white, const mask *m, int spread) {
    int32_t good[COLUMNS * ROWS], bad[COLUMNS * ROWS];
    int n_good = 0, n_bad = 0, mx = m->reach_across * spread, my = m->reach_down * spread;
    int w = im->width - WIDTH - 2 * mx, h = im->height - HEIGHT - 2 * my;
    view v = {im, 0, 0};
    if (w < 0 || h < 0)
        return 0;
    while (white >> v.shift >= 1 << BITS)
        v.shift++;
    v.white = (int16_t)(white >> v.shift);
    for (int i = 0; i < COLUMNS * ROWS; i++) {
        int x = mx + w * (i % COLUMNS) / (COLUMNS - 1), y = my + h * (i / COLUMNS) / (ROWS - 1);
        bool clipped;
        int32_t sum = block(&v, x, y, m, spread, &clipped);
        *(clipped ? &bad[n_bad++] : &good[n_good++]) = sum;
    }
    int32_t sum =
        n_good ? at_rank(good, n_good, n_good * 3 / 10) : at_rank(bad, n_bad, n_bad * 3 / 10);
    /* |x| is sqrt(2 / pi) sigma on average */
    float mean = ldexpf((float)sum, v.shift) / (WIDTH * HEIGHT);
    return BIAS * mean * sqrtf((float)M_PI / 2 / (float)m->squares);
}

float noise_of_pixels(const arris_image *im, int white) {
    static const mask second_differences = {
        {0, 0, 0, 1, -2, 1, 0, 0, 0}, {0, 0, 0, 1, -2, 1, 0, 0, 0}, 1, 1, 36};
    return estimate(im, white, &second_differences, 1);
}

float noise_of_gradients(const arris_image *im, int white, double sigma) {
    /* the gradient across of the mean of 3x3 samples, and its difference six samples down */
    static const mask gradients = {
        {0, 0, -1, -1, 0, 1, 1, 0, 0}, {1, 1, 1, 0, 0, 0, -1, -1, -1}, 2, 4, 24};
    return estimate(im, white, &gradients, sigma > 1.5 ? (int)(sigma + 0.5) : 1);
}
