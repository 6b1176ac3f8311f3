/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * picture.h: decodes PNG, JPEG and PGM files, in memory, to grey.
 *
 * Pictures of more than 8 bits a sample become ARRIS_GREY16, over the full range of 16 bits; all
 * others ARRIS_GREY8. Colour becomes Rec. 601 luma, alpha is ignored, and so is gamma: edges are
 * measured in the values that the camera wrote. Faults do not name the file.
 */
#ifndef PICTURE_H
#define PICTURE_H

#include "fault.h"

enum { PICTURE_MAX_SIDE = 8192 }; /* px */

typedef struct picture_info {
    enum arris_format format;
    int32_t width, height; /* px */
} picture_info;

/* Reads the header of the n bytes at `data`. Returns 0, or ARRIS_E_INPUT (no picture, a damaged
 * one, or a side above PICTURE_MAX_SIDE), or ARRIS_E_MEMORY. */
int picture_read_info(const uint8_t *data, size_t n, picture_info *info, fault *f);

/* Decodes into the rows of `out`, whose format and size must be what picture_read_info says.
 * Anything damaged or missing is ARRIS_E_INPUT, and then the pixels mean nothing. */
int picture_decode(const uint8_t *data, size_t n, const arris_image *out, fault *f);

/* The same for one kind of file each; picture.c tells them apart. */
int picture_png_info(const uint8_t *data, size_t n, picture_info *info, fault *f);
int picture_png_decode(const uint8_t *data, size_t n, const arris_image *out, fault *f);
int picture_jpeg_info(const uint8_t *data, size_t n, picture_info *info, fault *f);
int picture_jpeg_decode(const uint8_t *data, size_t n, const arris_image *out, fault *f);
int picture_pgm_info(const uint8_t *data, size_t n, picture_info *info, fault *f);
int picture_pgm_decode(const uint8_t *data, size_t n, const arris_image *out, fault *f);

#endif
