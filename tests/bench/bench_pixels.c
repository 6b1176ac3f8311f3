/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * bench_pixels.c: camera pixels to grey beside memcpy of the same buffer, taken in turns; the
 * medians' ratio. YUYV is to reach half of memcpy's rate.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "arris_plugin.h"
#include "camera/pixels.h"

enum { ROUNDS = 401 };

static int by_value(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(double *v) {
    qsort(v, ROUNDS, sizeof *v, by_value);
    return v[ROUNDS / 2];
}

/* How much of memcpy's rate a format reaches, its median ns beside. */
static double measure(const pixels *p, int width, int height, double *ns) {
    static double copy[ROUNDS], convert[ROUNDS];
    size_t stride = (size_t)(width * p->bytes), n = stride * (size_t)height;
    size_t row = (size_t)width * p->format;
    uint8_t *in = aligned_alloc(64, n), *twin = aligned_alloc(64, n);
    arris_image out = {p->format,      width, height,
                       (ptrdiff_t)row, NULL,  aligned_alloc(64, row * (size_t)height)};
    fault f;
    if (!in || !twin || !out.data)
        abort();
    memset(in, 0x5a, n);
    for (int i = -20; i < ROUNDS; i++) {
        int64_t t0 = arris_now();
        memcpy(twin, in, n);
        __asm__ volatile("" ::"r"(twin) : "memory");
        int64_t t1 = arris_now();
        if (pixels_convert(p, &(pixels_decoder){NULL}, in, n, stride, &out, &f))
            abort();
        int64_t t2 = arris_now();
        copy[i < 0 ? 0 : i] = (double)(t1 - t0);
        convert[i < 0 ? 0 : i] = (double)(t2 - t1);
    }
    free(in);
    free(twin);
    free(out.data);
    *ns = median(convert);
    return median(copy) / *ns;
}

int main(void) {
    static const int size[][2] = {{640, 480}, {1280, 720}, {1920, 1080}};
    int bad = 0;
    printf("%-8s %-10s %12s %24s\n", "format", "size", "us", "of memcpy's rate");
    for (const pixels *p = pixels_table; p->name; p++)
        for (int i = 0; p->bytes && i < 3; i++) {
            double ns, share = measure(p, size[i][0], size[i][1], &ns);
            bool misses = strcmp(p->name, "YUYV") == 0 && share < 0.5;
            printf("%-8s %4dx%-5d %12.1f %24.2f%s\n", p->name, size[i][0], size[i][1], ns / 1000,
                   share, misses ? "  < 0.5" : "");
            bad |= misses;
        }
    return bad;
}
