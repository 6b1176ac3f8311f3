/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * figure.c: figures as SVG. A picture is a PNG within it (RFC 2397), so that a figure is one file.
 */
#include "figure.h"

#include <png.h>
#include <stdlib.h>

enum { GAP = 8, TITLE = 22 }; /* of the figure's own units, */
static const double zoom = 2; /* of which a picture's pixel has two */

/* Of a panel with its gap. */
static int panel_width(int width) {
    return (int)(zoom * width) + GAP;
}

static int panel_height(int height) {
    return (int)(zoom * height) + TITLE + GAP;
}

FILE *figure_open(const char *path, int columns, int rows, int width, int height) {
    FILE *f = fopen(path, "w");
    if (f)
        fprintf(f,
                "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%d\" height=\"%d\" "
                "font-family=\"sans-serif\" font-size=\"16\">\n"
                "<rect width=\"100%%\" height=\"100%%\" fill=\"white\"/>\n",
                columns * panel_width(width) + GAP, rows * panel_height(height) + GAP);
    return f;
}

static void base64(FILE *f, const uint8_t *data, size_t n) {
    static const char digit[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t i = 0; i < n; i += 3) {
        uint32_t bits = 0;
        for (size_t k = 0; k < 3; k++)
            bits = bits << 8 | (i + k < n ? data[i + k] : 0);
        for (size_t k = 0; k < 4; k++)
            fputc(i + k <= n ? digit[bits >> (18 - 6 * k) & 63] : '=', f);
    }
}

/* The picture's rows as a PNG of its own. A picture that can't be coded is left out. */
static void embed(FILE *f, const arris_image *im) {
    png_image png = {.version = PNG_IMAGE_VERSION,
                     .width = (png_uint_32)im->width,
                     .height = (png_uint_32)im->height,
                     .format = PNG_FORMAT_GRAY};
    png_alloc_size_t n = PNG_IMAGE_PNG_SIZE_MAX(png);
    uint8_t *code = malloc(n);
    if (code &&
        png_image_write_to_memory(&png, code, &n, 0, im->data, (png_int_32)im->stride, NULL))
        base64(f, code, n);
    free(code);
}

void figure_panel(FILE *f, int column, int row, const char *title, const arris_image *im,
                  double light) {
    int x = GAP + column * panel_width(im->width), y = GAP + row * panel_height(im->height);
    fprintf(f,
            "<text x=\"%d\" y=\"%d\">%s</text>\n"
            "<g transform=\"translate(%d %d) scale(%g)\" fill=\"none\" stroke-width=\"0.7\">\n"
            "<rect width=\"%d\" height=\"%d\" fill=\"black\"/>\n"
            "<image width=\"%d\" height=\"%d\" opacity=\"%g\" image-rendering=\"pixelated\" "
            "href=\"data:image/png;base64,",
            x, y + TITLE - 6, title, x, y + TITLE, zoom, im->width, im->height, im->width,
            im->height, light);
    embed(f, im);
    fprintf(f, "\"/>\n<g transform=\"translate(0.5 0.5)\">\n"); /* (0, 0) is a pixel's centre */
}

void figure_panel_end(FILE *f) {
    fprintf(f, "</g>\n</g>\n");
}

void figure_line(FILE *f, const char *colour, double x1, double y1, double x2, double y2) {
    fprintf(f, "<path stroke=\"%s\" d=\"M%.2f %.2fL%.2f %.2f\"/>\n", colour, x1, y1, x2, y2);
}

void figure_chain(FILE *f, const char *colour, const arris_edge_point *point, uint32_t n) {
    fprintf(f, "<polyline stroke=\"%s\" points=\"", colour);
    for (uint32_t i = 0; i < n; i++)
        fprintf(f, "%.2f,%.2f ", (double)point[i].x, (double)point[i].y);
    fprintf(f, "\"/>\n");
}

void figure_circle(FILE *f, const char *colour, double x, double y) {
    fprintf(f, "<circle stroke=\"%s\" cx=\"%.2f\" cy=\"%.2f\" r=\"2.5\"/>\n", colour, x, y);
}

void figure_cross(FILE *f, const char *colour, double x, double y) {
    figure_line(f, colour, x - 2, y, x + 2, y);
    figure_line(f, colour, x, y - 2, x, y + 2);
}

int figure_close(FILE *f) {
    fprintf(f, "</svg>\n");
    int bad = ferror(f);
    return fclose(f) || bad ? ARRIS_E_IO : 0;
}
