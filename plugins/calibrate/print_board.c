/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * print_board.c: a chessboard to print, true to scale, with a ruler to check the print by. Page
 * coordinates are mm from the upper left.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "command.h"
#include "files/output.h"

static const double MAX_PAGE = 5000;       /* mm; PDF allows 14400 pt */
static const double POINTS = 72 / 25.4;    /* a mm in PDF's unit */
static const double FOOT = 26, TEXT = 3.5; /* mm */

typedef struct page {
    bool pdf;
    double width, height; /* mm */
    FILE *body;
} page;

static void rectangle(const page *p, double x, double y, double w, double h) {
    if (p->pdf)
        fprintf(p->body, "%.4f %.4f %.4f %.4f re f\n", x * POINTS, (p->height - y - h) * POINTS,
                w * POINTS, h * POINTS);
    else
        fprintf(p->body, "<rect x=\"%.4f\" y=\"%.4f\" width=\"%.4f\" height=\"%.4f\"/>\n", x, y, w,
                h);
}

static void text(const page *p, double x, double y, const char *words) {
    if (p->pdf)
        fprintf(p->body, "BT /F %.2f Tf %.4f %.4f Td (%s) Tj ET\n", TEXT * POINTS, x * POINTS,
                (p->height - y) * POINTS, words);
    else
        fprintf(p->body, "<text x=\"%.4f\" y=\"%.4f\">%s</text>\n", x, y, words);
}

/* A mark every 10 mm, longer ones at 0, 50, 100, ... */
static void ruler(const page *p, double x, double y, int mm) {
    char words[32];
    rectangle(p, x, y, mm, 0.2);
    for (int at = 0; at <= mm; at += 10) {
        rectangle(p, x + at - 0.1, y, 0.2, at % 50 ? 2 : 4);
        snprintf(words, sizeof words, "%d", at);
        if (at % 50 == 0)
            text(p, x + at - 1, y + 8, words);
    }
}

static void draw(const page *p, const cal_board *b, double margin) {
    char words[200];
    const double s = b->square, bottom = margin + (b->rows + 1) * s;
    for (int row = 0; row <= b->rows; row++)
        for (int col = row % 2; col <= b->cols; col += 2) /* a dark one in the corner */
            rectangle(p, margin + col * s, margin + row * s, s, s);
    const int length = (int)fmin(200, fmax(10, floor((p->width - 2 * margin) / 50) * 50));
    ruler(p, margin, bottom + margin, length);
    snprintf(words, sizeof words,
             "%dx%d inner corners, squares of %g mm. Print at 100 %%: the ruler", b->cols, b->rows,
             s);
    text(p, margin, bottom + margin + 14, words);
    snprintf(words, sizeof words,
             "is %d mm. Glue it on something flat: --square is what you measure.", length);
    text(p, margin, bottom + margin + 19, words);
}

/* ---- files ---------------------------------------------------------------------------------- */

static void write_svg(FILE *out, const page *p, const char *body) {
    fprintf(out,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%.4fmm\" height=\"%.4fmm\" "
            "viewBox=\"0 0 %.4f %.4f\">\n<style>text{font:%gpx sans-serif}</style>\n"
            "<rect width=\"100%%\" height=\"100%%\" fill=\"#fff\"/>\n%s</svg>\n",
            p->width, p->height, p->width, p->height, TEXT, body);
}

static void write_pdf(FILE *out, const page *p, const char *body) {
    long at[6];
    fputs("%PDF-1.4\n", out);
    at[1] = ftell(out);
    fputs("1 0 obj\n<</Type/Catalog/Pages 2 0 R/ViewerPreferences<</PrintScaling/None>>>>\n"
          "endobj\n",
          out);
    at[2] = ftell(out);
    fputs("2 0 obj\n<</Type/Pages/Kids[3 0 R]/Count 1>>\nendobj\n", out);
    at[3] = ftell(out);
    fprintf(out,
            "3 0 obj\n<</Type/Page/Parent 2 0 R/MediaBox[0 0 %.4f %.4f]/Contents 4 0 R"
            "/Resources<</Font<</F 5 0 R>>>>>>\nendobj\n",
            p->width * POINTS, p->height * POINTS);
    at[4] = ftell(out);
    fprintf(out, "4 0 obj\n<</Length %zu>>\nstream\n%sendstream\nendobj\n", strlen(body), body);
    at[5] = ftell(out);
    fputs("5 0 obj\n<</Type/Font/Subtype/Type1/BaseFont/Helvetica>>\nendobj\n", out);
    long xref = ftell(out);
    fputs("xref\n0 6\n0000000000 65535 f \n", out);
    for (int i = 1; i < 6; i++)
        fprintf(out, "%010ld 00000 n \n", at[i]);
    fprintf(out, "trailer\n<</Size 6/Root 1 0 R>>\nstartxref\n%ld\n%%%%EOF\n", xref);
}

static int write_page(const page *p, const char *path, const char *body, fault *f) {
    output out;
    int error = output_open(&out, path);
    if (!error) {
        (p->pdf ? write_pdf : write_svg)(out.file, p, body);
        error = output_commit(&out);
    }
    if (!error)
        return 0;
    output_abandon(&out);
    return fault_set(f, ARRIS_E_IO, NULL, "cannot write %s: %s", path, strerror(error));
}

int print_board(const cal_board *b, const char *path, fault *f) {
    const double margin = fmax(b->square, 10);
    const char *dot = strrchr(path, '.');
    char *body = NULL;
    size_t size;
    page p = {.pdf = dot && strcmp(dot, ".pdf") == 0,
              .width = fmax((b->cols + 1) * b->square + 2 * margin, 120 + 2 * margin),
              .height = (b->rows + 1) * b->square + 2 * margin + FOOT};
    if (!dot || (!p.pdf && strcmp(dot, ".svg")))
        return fault_set(f, ARRIS_E_USAGE, NULL, "-o %s: a board ends in .svg or .pdf", path);
    if (p.width > MAX_PAGE || p.height > MAX_PAGE)
        return fault_set(f, ARRIS_E_USAGE, "take smaller or fewer squares",
                         "the page would be %.0f x %.0f mm; the limit is %.0f", p.width, p.height,
                         MAX_PAGE);
    p.body = open_memstream(&body, &size);
    if (!p.body)
        return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for the board");
    draw(&p, b, margin);
    int r = fclose(p.body) ? fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for the board")
                           : write_page(&p, path, body, f);
    free(body);
    return r;
}
