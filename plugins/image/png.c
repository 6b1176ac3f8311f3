/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * png.c: PNG of every kind through libpng, converted row by row inside its own row buffer.
 */
#include <png.h>
#include <string.h>

#include "picture.h"

enum { IHDR_END = 8 + 8 + 13, MAX_CHUNKS = 128, MAX_CHUNK = 1 << 20 };

static int32_t big_endian(const uint8_t *p) {
    return (int32_t)((uint32_t)p[0] << 24 | (uint32_t)p[1] << 16 | (uint32_t)p[2] << 8 | p[3]);
}

int picture_png_info(const uint8_t *data, size_t n, picture_info *info, fault *f) {
    if (n < IHDR_END || memcmp(data + 12, "IHDR", 4) != 0)
        return fault_set(f, ARRIS_E_INPUT, NULL, "the PNG has no complete header");
    *info = (picture_info){.format = data[24] == 16 ? ARRIS_GREY16 : ARRIS_GREY8,
                           .width = big_endian(data + 16),
                           .height = big_endian(data + 20)};
    return 0;
}

struct source {
    const uint8_t *at;
    size_t left;
    fault *f;
};

static void on_read(png_structp png, png_bytep to, size_t n) {
    struct source *s = png_get_io_ptr(png);
    if (n > s->left)
        png_error(png, "the file is truncated");
    memcpy(to, s->at, n);
    s->at += n;
    s->left -= n;
}

static void on_error(png_structp png, png_const_charp text) {
    struct source *s = png_get_error_ptr(png);
    fault_set(s->f, ARRIS_E_INPUT, NULL, "the PNG is damaged: %s", text);
    png_longjmp(png, 1);
}

static void on_warning(png_structp png, png_const_charp text) {
    (void)png;
    (void)text;
}

/* Rec. 601 luma, 0.299 R + 0.587 G + 0.114 B in 16 bits of fraction, as libjpeg has it. */
static uint32_t luma(uint32_t r, uint32_t g, uint32_t b) {
    return (19595 * r + 38470 * g + 7471 * b + 32768) >> 16;
}

/* A row of RGB to grey, in place. */
static void to_grey(png_structp png, png_row_infop row, png_bytep data) {
    (void)png;
    for (uint32_t x = 0; x < row->width; x++) {
        if (row->bit_depth == 16) {
            uint16_t p[3];
            memcpy(p, data + 6 * x, 6);
            uint16_t y = (uint16_t)luma(p[0], p[1], p[2]);
            memcpy(data + 2 * x, &y, 2);
        } else {
            data[x] = (uint8_t)luma(data[3 * x], data[3 * x + 1], data[3 * x + 2]);
        }
    }
}

/* Asks libpng for grey of 8 bits, or of 16 in the machine's order. */
static void set_transforms(png_structp png, png_infop info) {
    int type = png_get_color_type(png, info), depth = png_get_bit_depth(png, info);
    const uint16_t one = 1;
    if (type == PNG_COLOR_TYPE_PALETTE)
        png_set_palette_to_rgb(png);
    if (type == PNG_COLOR_TYPE_GRAY && depth < 8)
        png_set_expand_gray_1_2_4_to_8(png);
    png_set_strip_alpha(png);
    if (depth == 16 && *(const uint8_t *)&one == 1)
        png_set_swap(png);
    if (type & PNG_COLOR_MASK_COLOR) {
        png_set_read_user_transform_fn(png, to_grey);
        png_set_user_transform_info(png, NULL, depth == 16 ? 16 : 8, 1);
    }
}

/* Leaves by png_longjmp when something is wrong. An interlaced picture comes in several passes over
 * the same rows. */
static void read_rows(png_structp png, png_infop info, struct source *source,
                      const arris_image *out) {
    png_set_user_limits(png, PICTURE_MAX_SIDE, PICTURE_MAX_SIDE);
    png_set_chunk_cache_max(png, MAX_CHUNKS);
    png_set_chunk_malloc_max(png, MAX_CHUNK);
    png_set_read_fn(png, source, on_read);
    png_read_info(png, info);
    set_transforms(png, info);
    int passes = png_set_interlace_handling(png);
    png_read_update_info(png, info);
    if (png_get_rowbytes(png, info) != (size_t)out->width * out->format)
        png_error(png, "its header contradicts itself");
    while (passes--)
        for (int32_t y = 0; y < out->height; y++)
            png_read_row(png, out->data + y * out->stride, NULL);
    png_read_end(png, NULL);
}

int picture_png_decode(const uint8_t *data, size_t n, const arris_image *out, fault *f) {
    struct source source = {data, n, f};
    png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &source, on_error, on_warning);
    png_infop info = png ? png_create_info_struct(png) : NULL;
    if (!info) {
        png_destroy_read_struct(&png, NULL, NULL);
        return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for the PNG decoder");
    }
    if (setjmp(png_jmpbuf(png))) { /* nothing above changes after this, so it needs no volatile */
        png_destroy_read_struct(&png, &info, NULL);
        return ARRIS_E_INPUT;
    }
    read_rows(png, info, &source, out);
    png_destroy_read_struct(&png, &info, NULL);
    return 0;
}
