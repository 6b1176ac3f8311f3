/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * test_pixels.c: camera pixels to grey: every format against what it is by its definition, in all
 * widths, in memory of just its size; and JPEG, whole and damaged.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <turbojpeg.h>

#include <cmocka.h>

#include "camera/pixels.h"

enum { HEIGHT = 3, MOST = 150, JPEG_WIDTH = 41, JPEG_HEIGHT = 23 };

/* The grey level of pixel x in a row, as the formats' definitions have it. */
static unsigned defined(const char *name, const uint8_t *row, int x) {
    if (strcmp(name, "GREY") == 0 || strcmp(name, "NV12") == 0)
        return row[x];
    if (strcmp(name, "YUYV") == 0)
        return row[2 * x];
    if (strcmp(name, "UYVY") == 0)
        return row[2 * x + 1];
    if (strcmp(name, "RGB3") == 0) {
        const uint8_t *p = row + 3 * x;
        return (19595u * p[0] + 38470u * p[1] + 7471u * p[2] + 32768u) >> 16;
    }
    unsigned word = (unsigned)(row[2 * x] | row[2 * x + 1] << 8);
    if (strcmp(name, "Y16") == 0)
        return word;
    if (strcmp(name, "Y10") == 0) /* the upper six bits are not the sample's */
        return (word & 1023) << 6 | (word & 1023) >> 4;
    assert_string_equal(name, "Y12");
    return (word & 4095) << 4 | (word & 4095) >> 8;
}

static uint8_t *noise(size_t n) {
    uint8_t *data = malloc(n);
    for (size_t i = 0; i < n; i++)
        data[i] = (uint8_t)(rand() >> 7);
    return data;
}

static void compare(const pixels *p, const uint8_t *data, size_t stride, const arris_image *out) {
    for (int y = 0; y < out->height; y++)
        for (int x = 0; x < out->width; x++) {
            const uint8_t *row = out->data + y * out->stride;
            unsigned got =
                out->format == ARRIS_GREY8 ? row[x] : (unsigned)(row[2 * x] | row[2 * x + 1] << 8);
            if (got != defined(p->name, data + (size_t)y * stride, x))
                fail_msg("%s, width %d, pixel %d: %u", p->name, out->width, x, got);
        }
}

static void every_format_is_as_defined(void **state) {
    (void)state;
    pixels_decoder d = {NULL};
    fault f;
    int formats = 0;
    for (const pixels *p = pixels_table; p->name; p++, formats++)
        for (int width = 1; p->bytes && width <= MOST; width++) {
            size_t stride = (size_t)(width * p->bytes + width % 3),
                   n = stride * (HEIGHT - 1) + (size_t)(width * p->bytes);
            size_t row = (size_t)width * p->format;
            uint8_t *data = noise(n);
            arris_image out = {p->format,      width, HEIGHT,
                               (ptrdiff_t)row, NULL,  malloc(row * HEIGHT)};
            assert_int_equal(pixels_convert(p, &d, data, n, stride, &out, &f), 0);
            compare(p, data, stride, &out);
            assert_int_equal(pixels_convert(p, &d, data, n - 1, stride, &out, &f), ARRIS_E_INPUT);
            free(data);
            free(out.data);
        }
    assert_int_equal(formats, 9);
}

/* Black stays black, white becomes white, and nothing is off by more than a 65535th. */
static void deep_samples_fill_the_range(void **state) {
    (void)state;
    for (int bits = 10; bits <= 12; bits += 2) {
        const pixels *p = pixels_find(bits == 10 ? 0x20303159 : 0x20323159);
        int n = 1 << bits;
        uint16_t *in = malloc(2 * (size_t)n), *out = malloc(2 * (size_t)n);
        for (int i = 0; i < n; i++)
            in[i] = (uint16_t)i;
        p->row((const uint8_t *)in, (uint8_t *)out, n);
        assert_int_equal(out[0], 0);
        assert_int_equal(out[n - 1], 65535);
        for (int i = 0; i < n; i++)
            assert_true(abs((int)out[i] - (int)((i * 65535.0) / (n - 1) + 0.5)) <= 1);
        free(in);
        free(out);
    }
}

/* The words of the property are the table's names in its order. */
static void words_are_the_table(void **state) {
    (void)state;
    char words[200] = "auto";
    for (const pixels *p = pixels_table; p->name; p++) {
        strcat(words, "|");
        strcat(words, p->name);
        assert_ptr_equal(pixels_find(p->fourcc), p);
    }
    assert_string_equal(words, PIXELS_WORDS);
    assert_null(pixels_find(0));
}

static void jpeg_is_decoded_or_refused(void **state) {
    (void)state;
    const pixels *p = pixels_find(0x47504a4d);
    uint8_t *grey = noise(JPEG_WIDTH * JPEG_HEIGHT), *data = NULL,
            expected[JPEG_WIDTH * JPEG_HEIGHT], got[JPEG_WIDTH * JPEG_HEIGHT];
    unsigned long n = 0;
    tjhandle c = tjInitCompress(), e = tjInitDecompress();
    assert_int_equal(
        tjCompress2(c, grey, JPEG_WIDTH, 0, JPEG_HEIGHT, TJPF_GRAY, &data, &n, TJSAMP_GRAY, 90, 0),
        0);
    assert_int_equal(tjDecompress2(e, data, n, expected, JPEG_WIDTH, 0, JPEG_HEIGHT, TJPF_GRAY, 0),
                     0);
    arris_image out = {ARRIS_GREY8, JPEG_WIDTH, JPEG_HEIGHT, JPEG_WIDTH, NULL, got};
    pixels_decoder d = {NULL};
    fault f;
    assert_int_equal(pixels_convert(p, &d, data, n, 0, &out, &f), 0);
    assert_memory_equal(got, expected, sizeof got);
    for (unsigned long cut = 0; cut < n - 2; cut += 7) {
        uint8_t *part = malloc(cut ? cut : 1);
        memcpy(part, data, cut);
        assert_int_equal(pixels_convert(p, &d, part, cut, 0, &out, &f), ARRIS_E_INPUT);
        free(part);
    }
    out.height--;
    assert_int_equal(pixels_convert(p, &d, data, n, 0, &out, &f), ARRIS_E_INPUT);
    pixels_decoder_free(&d);
    tjFree(data);
    free(grey);
    tjDestroy(c);
    tjDestroy(e);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_format_is_as_defined),
        cmocka_unit_test(deep_samples_fill_the_range),
        cmocka_unit_test(words_are_the_table),
        cmocka_unit_test(jpeg_is_decoded_or_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
