/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * html.c: the report of an inspection: one page that needs nothing but itself.
 */
#include "html.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const char head[] =
    "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>Inspection: %s</title>"
    "\n<style>body{font:14px sans-serif;color:#222;margin:2em auto;max-width:1500px}"
    "h1 span{padding:.1em .5em;color:#fff}.PASS{background:#2b7a3d}.FAIL{background:#b3261e}"
    ".INDETERMINATE{background:#b07a10}table{border-collapse:collapse;margin:1em 0}"
    "td,th{padding:.25em .8em;border-bottom:1px solid #ddd;text-align:right}"
    "td:first-child,td:last-child,th:first-child,th:last-child{text-align:left}"
    "td b{padding:.1em .4em;color:#fff;font-weight:normal}code{font-size:11px;color:#666}"
    "svg{max-width:100%%;height:auto}.edge{fill:none;stroke-width:1.5}"
    ".edge.PASS{stroke:#2b7a3d}.edge.FAIL{stroke:#e0342b}.edge.INDETERMINATE{stroke:#d79a1e}"
    "</style></head><body>\n";

static void text(FILE *out, const char *s) {
    for (; *s; s++)
        if (*s == '&' || *s == '<' || *s == '>' || *s == '"')
            fprintf(out, "&#%d;", *s);
        else
            fputc(*s, out);
}

/* ---- the frame over which the part is drawn ---------------------------------------------------
 */

/* How far off the middle of the picture the features lie, px²; INFINITY when they aren't in it. */
static double off_middle(const arris_verdict *v, const arris_camera *c, const arris_pose *pose) {
    double X[3] = {0}, x, y, n = 0;
    for (uint32_t i = 0; i < v->n; i++)
        if (isfinite(v->item[i].p[0])) {
            for (int k = 0; k < 3; k++)
                X[k] += (v->item[i].p[k] + v->item[i].q[k]) / 2;
            n++;
        }
    for (int k = 0; k < 3; k++)
        X[k] /= n;
    if (!(arris_project(c, pose, X, &x, &y) > 0))
        return (double)INFINITY;
    return pow(x - c->width / 2., 2) + pow(y - c->height / 2., 2);
}

void report_frame(report *r, const arris_verdict *v, const arris_image *image,
                  const arris_pose *pose) {
    const arris_camera *c = image->camera;
    double off = c && pose->valid ? off_middle(v, c, pose) : (double)INFINITY;
    if (!(off < r->off) || image->width != r->width || image->height != r->height)
        return;
    r->off = off;
    r->camera = *c;
    r->pose = *pose;
    for (int32_t y = 0; y < r->height; y++) {
        const uint8_t *from = image->data + y * image->stride;
        uint8_t *to = r->grey + (size_t)y * (size_t)r->width;
        for (int32_t x = 0; x < r->width; x++)
            to[x] = image->format == ARRIS_GREY16
                        ? (uint8_t)(((const uint16_t *)(const void *)from)[x] >> 8)
                        : from[x];
    }
}

bool report_begin(report *r, int32_t width, int32_t height) {
    *r = (report){.width = width, .height = height, .off = (double)INFINITY};
    r->grey = malloc((size_t)width * (size_t)height + 1);
    return r->grey != NULL;
}

void report_end(report *r) {
    free(r->grey);
    r->grey = NULL;
}

static void base64(FILE *out, const uint8_t *data, size_t n) {
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t i = 0; i < n; i += 3) {
        uint32_t v = (uint32_t)data[i] << 16 | (i + 1 < n ? (uint32_t)data[i + 1] << 8 : 0) |
                     (i + 2 < n ? data[i + 2] : 0);
        fputc(digits[v >> 18], out);
        fputc(digits[v >> 12 & 63], out);
        fputc(i + 1 < n ? digits[v >> 6 & 63] : '=', out);
        fputc(i + 2 < n ? digits[v & 63] : '=', out);
    }
}

static void picture(FILE *out, const report *r) {
    const arris_image image = {ARRIS_GREY8, r->width, r->height, r->width, NULL, r->grey};
    memory_file png;
    if (png_reserve(&png, (size_t)r->width * (size_t)r->height) && png_encode(&png, &image)) {
        fprintf(out, "<image width=\"%d\" height=\"%d\" href=\"data:image/png;base64,", r->width,
                r->height);
        base64(out, png.data, png.n);
        fputs("\"/>\n", out);
    }
    free(png.data);
}

/* A nominal edge as the lens bends it. */
static void edge(FILE *out, const report *r, const arris_feature *f) {
    enum { POINTS = 24 };
    char mark = 'M';
    fprintf(out, "<path class=\"edge %s\" d=\"", judgement_name(f->verdict));
    for (int i = 0; i <= POINTS; i++) {
        double X[3], x, y, u, v;
        for (int k = 0; k < 3; k++)
            X[k] = f->p[k] + (f->q[k] - f->p[k]) * i / POINTS;
        if (!(arris_project(&r->camera, &r->pose, X, &x, &y) > 0) || fabs(x) > 1e4 || fabs(y) > 1e4)
            continue;
        arris_distort(&r->camera, x, y, &u, &v);
        fprintf(out, "%c%.2f %.2f", mark, u + 0.5, v + 0.5);
        mark = 'L';
    }
    fputs("\"><title>", out);
    text(out, f->id);
    fputs("</title></path>\n", out);
}

static void frame(FILE *out, const report *r, const arris_verdict *v) {
    if (!isfinite(r->off))
        return;
    fprintf(out, "<h2>Over a frame</h2>\n<svg width=\"%d\" viewBox=\"0 0 %d %d\">\n",
            r->width < 960 ? 960 : r->width, r->width, r->height);
    picture(out, r);
    for (uint32_t i = 0; i < v->n; i++)
        if (isfinite(v->item[i].p[0]))
            edge(out, r, &v->item[i]);
    fputs("</svg>\n", out);
}

/* ---- the tables ------------------------------------------------------------------------------ */

static void cell(FILE *out, double value, double unit, const char *format) {
    fputs("<td>", out);
    if (isfinite(value))
        fprintf(out, format, value * unit);
    else
        fputs("&ndash;", out);
    fputs("</td>", out);
}

static void row(FILE *out, const arris_feature *f) {
    double unit = f->is_angle ? 57.29577951308232 : 1;
    fputs("<tr><td>", out);
    text(out, f->id);
    fputs("</td>", out);
    cell(out, f->deviation, unit, "%+.3f");
    cell(out, f->U, unit, "%.3f");
    cell(out, f->worst, unit, "%+.3f");
    cell(out, f->worst_U, unit, "%.3f");
    cell(out, f->tolerance, unit, "%.3g");
    fprintf(out, "<td>%s</td>", f->is_angle ? "&deg;" : "mm");
    cell(out, f->straightness, 1, "%.3f");
    fprintf(out, "<td><b class=\"%s\">%s</b></td><td>", judgement_name(f->verdict),
            judgement_name(f->verdict));
    text(out, f->reason ? f->reason : "");
    fputs("</td></tr>\n", out);
}

static void table(FILE *out, const arris_verdict *v) {
    fputs("<table><tr><th>feature</th><th>deviation</th><th>U</th><th>worst point</th><th>U</th>"
          "<th>tolerance</th><th>unit</th><th>straightness</th><th>verdict</th><th>why</th></tr>\n",
          out);
    for (uint32_t i = 0; i < v->n; i++)
        row(out, &v->item[i]);
    fputs("</table>\n", out);
}

static void extra(FILE *out, const arris_verdict *v) {
    fprintf(out,
            "<p>Measured lines that no nominal edge explains (paint, shadows, scratches; they "
            "fail nothing): %u%s",
            v->n_extra + v->lost_extra, v->n_extra ? ": " : "");
    for (uint32_t i = 0; i < v->n_extra; i++)
        fprintf(out, "%s%d", i ? ", " : "", v->extra[i]);
    fputs(".</p>\n", out);
}

void report_write(FILE *out, const report *r, const arris_verdict *v, const arris_lines *lines,
                  const svg_cameras *cameras, const char *recipe) {
    const char *name = judgement_name(v->verdict);
    fprintf(out, head, name);
    fprintf(out, "<h1>Inspection: <span class=\"%s\">%s</span></h1>\n", name, name);
    fprintf(out,
            "<p>%u features, tolerance %g mm unless stated, U = k u with k = %g, "
            "ISO 14253-1.</p>\n",
            v->n, v->tolerance, v->coverage_factor);
    table(out, v);
    extra(out, v);
    fputs("<h2>On the part</h2>\n", out);
    svg_write(out, lines, cameras, v, SVG_ALL);
    frame(out, r, v);
    fprintf(out, "<p><code>sha256 of the model %s<br>of the camera model %s", v->model,
            v->calibration);
    if (*recipe)
        fprintf(out, "<br>of the recipe %s", recipe);
    fputs("</code></p>\n</body></html>\n", out);
}
