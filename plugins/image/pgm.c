/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * pgm.c: PGM, binary (P5) and text (P2), as Netpbm defines it: white is maxval, whatever that is.
 */
#include <string.h>

#include "picture.h"

typedef struct cursor {
    const uint8_t *at, *end;
} cursor;

typedef struct header {
    bool text;
    uint32_t width, height, maxval;
    cursor pixels;
} header;

static bool is_blank(uint8_t c) {
    return c == ' ' || (c >= '\t' && c <= '\r');
}

static void skip_blanks(cursor *c) {
    while (c->at < c->end && (is_blank(*c->at) || *c->at == '#')) {
        if (*c->at == '#')
            while (c->at < c->end && *c->at != '\n')
                c->at++;
        else
            c->at++;
    }
}

/* Reads a number of at most `max`; false when there is none. */
static bool number(cursor *c, uint32_t max, uint32_t *v) {
    skip_blanks(c);
    const uint8_t *start = c->at;
    *v = 0;
    for (; c->at < c->end && *c->at >= '0' && *c->at <= '9'; c->at++) {
        *v = *v * 10 + (uint32_t)(*c->at - '0');
        if (*v > max)
            return false;
    }
    return c->at > start;
}

static int read_header(const uint8_t *data, size_t n, header *h, fault *f) {
    cursor c = {data + 2, data + n};
    h->text = data[1] == '2';
    if (!number(&c, 1000000, &h->width) || !number(&c, 1000000, &h->height) ||
        !number(&c, 65535, &h->maxval) || h->maxval == 0 || c.at == c.end || !is_blank(*c.at))
        return fault_set(f, ARRIS_E_INPUT, NULL, "the PGM's header is damaged");
    c.at++;
    h->pixels = c;
    return 0;
}

int picture_pgm_info(const uint8_t *data, size_t n, picture_info *info, fault *f) {
    header h;
    int r = read_header(data, n, &h, f);
    if (r == 0)
        *info = (picture_info){.format = h.maxval > 255 ? ARRIS_GREY16 : ARRIS_GREY8,
                               .width = (int32_t)h.width,
                               .height = (int32_t)h.height};
    return r;
}

static uint32_t full_range(const arris_image *out) {
    return out->format == ARRIS_GREY8 ? 255 : 65535;
}

static uint32_t get(const arris_image *out, const uint8_t *row, int32_t x) {
    return out->format == ARRIS_GREY8 ? row[x] : ((const uint16_t *)(const void *)row)[x];
}

static void put(const arris_image *out, uint8_t *row, int32_t x, uint32_t v) {
    if (out->format == ARRIS_GREY8)
        row[x] = (uint8_t)v;
    else
        ((uint16_t *)(void *)row)[x] = (uint16_t)v;
}

static bool text_row(cursor *c, const arris_image *out, uint8_t *row) {
    uint32_t v;
    for (int32_t x = 0; x < out->width; x++) {
        if (!number(c, full_range(out), &v))
            return false;
        put(out, row, x, v);
    }
    return true;
}

/* Samples of 16 bits have their high byte first. */
static bool binary_row(cursor *c, const arris_image *out, uint8_t *row) {
    size_t n = (size_t)out->width * out->format;
    if ((size_t)(c->end - c->at) < n)
        return false;
    if (out->format == ARRIS_GREY8)
        memcpy(row, c->at, n);
    else
        for (int32_t x = 0; x < out->width; x++)
            put(out, row, x, (uint32_t)(c->at[2 * x] << 8 | c->at[2 * x + 1]));
    c->at += n;
    return true;
}

/* Scales a row to the full range; false when a sample is above maxval. */
static bool scale_row(uint32_t maxval, const arris_image *out, uint8_t *row) {
    uint32_t full = full_range(out);
    for (int32_t x = 0; x < out->width && maxval != full; x++) {
        uint32_t v = get(out, row, x);
        if (v > maxval)
            return false;
        put(out, row, x, (v * full + maxval / 2) / maxval);
    }
    return true;
}

int picture_pgm_decode(const uint8_t *data, size_t n, const arris_image *out, fault *f) {
    header h;
    int r = read_header(data, n, &h, f);
    for (int32_t y = 0; r == 0 && y < out->height; y++) {
        uint8_t *row = out->data + y * out->stride;
        if (!(h.text ? text_row : binary_row)(&h.pixels, out, row))
            r = fault_set(f, ARRIS_E_INPUT, NULL, "the PGM is truncated or damaged in row %d", y);
        else if (!scale_row(h.maxval, out, row))
            r = fault_set(f, ARRIS_E_INPUT, NULL, "the PGM has a pixel above its maxval in row %d",
                          y);
    }
    return r;
}
