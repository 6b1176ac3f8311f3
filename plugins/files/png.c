/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * png.c: a picture as PNG, grey of 8 or 16 bits, through libpng. A camera's noise repeats nothing:
 * to look for repetitions would cost time and gain no byte.
 */
#include <png.h>
#include <setjmp.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "writers.h"

static void on_error(png_structp png, png_const_charp text) {
    (void)text;
    png_longjmp(png, 1);
}

static void on_warning(png_structp png, png_const_charp text) {
    (void)png, (void)text;
}

static void on_write(png_structp png, png_bytep data, size_t n) {
    memory_file *p = png_get_io_ptr(png);
    if (n > p->max - p->n)
        png_error(png, "it is longer than its grey levels");
    memcpy(p->data + p->n, data, n);
    p->n += n;
}

static void on_flush(png_structp png) {
    (void)png;
}

static void write_rows(png_structp png, png_infop info, memory_file *out,
                       const arris_image *image) {
    const uint16_t one = 1;
    png_set_write_fn(png, out, on_write, on_flush);
    png_set_filter(png, 0, PNG_FILTER_SUB);
    png_set_compression_strategy(png, Z_HUFFMAN_ONLY);
    png_set_IHDR(png, info, (png_uint_32)image->width, (png_uint_32)image->height,
                 8 * (int)image->format, PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_write_info(png, info);
    if (image->format == ARRIS_GREY16 && *(const uint8_t *)&one == 1)
        png_set_swap(png);
    for (int32_t y = 0; y < image->height; y++)
        png_write_row(png, image->data + y * image->stride);
    png_write_end(png, NULL);
}

/* Without repetitions a byte takes 15 bits at worst. */
bool png_reserve(memory_file *out, size_t grey) {
    *out = (memory_file){.max = 2 * grey + (1 << 16)};
    out->data = malloc(out->max);
    return out->data != NULL;
}

bool png_encode(memory_file *out, const arris_image *image) {
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, on_error, on_warning);
    png_infop info = png ? png_create_info_struct(png) : NULL;
    out->n = 0;
    if (!info || setjmp(png_jmpbuf(png))) { /* nothing above changes after this */
        png_destroy_write_struct(&png, &info);
        return false;
    }
    write_rows(png, info, out, image);
    png_destroy_write_struct(&png, &info);
    return true;
}
