/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * report.c: the page about a calibration: one HTML file with its drawings in it (result.h).
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "files/output.h"
#include "result.h"

enum { WIDE = 640, SMALL = 300, WORST = 3 }; /* px of the page */

static const char head[] =
    "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>Camera "
    "calibration</title>\n<style>body{font:15px/1.5 sans-serif;max-width:1000px;margin:2em auto;"
    "padding:0 1em;color:#222}table{border-collapse:collapse}td,th{padding:2px 12px;text-align:"
    "right;border-bottom:1px solid #ddd}td:first-child,th:first-child{text-align:left}svg{border:"
    "1px solid #aaa;background:#fff;margin:0 8px 8px 0}svg text{font:11px sans-serif}.next{"
    "background:#fff6dd;border-left:4px solid #e0a800;padding:.5em 1em}.note{color:#555}"
    ".r{stroke:#c0392b;stroke-width:1;fill:none}.c{fill:#2b6cb0}.b{fill:none;stroke:#2b6cb0;"
    "stroke-opacity:.5}</style></head><body>\n";

/* Text that may hold anything, as file names do. */
static void escape(FILE *out, const char *s) {
    for (; *s; s++) {
        const char *as = *s == '<' ? "&lt;" : *s == '>' ? "&gt;" : *s == '&' ? "&amp;" : NULL;
        if (as)
            fputs(as, out);
        else
            fputc(*s, out);
    }
}

static void open_svg(FILE *out, const view_list *l, int width) {
    fprintf(out, "<svg width=\"%d\" height=\"%d\" viewBox=\"-0.5 -0.5 %d %d\">\n", width,
            (int)lround((double)width * l->height / l->width), l->width, l->height);
}

/* ---- the drawings --------------------------------------------------------------------------- */

/* Measured minus projected, px; false where the corner was not seen. */
static bool residual(const view_list *l, const cal_result *r, const cal_view *v, int i,
                     double d[2]) {
    double X[3], p[2];
    cal_corner(&l->board, r->shape, i, X, NULL);
    if (isnan(v->corner[2 * i]) || !cal_project(r->k, &v->pose, X, p, NULL, NULL, NULL))
        return false;
    d[0] = v->corner[2 * i] - p[0];
    d[1] = v->corner[2 * i + 1] - p[1];
    return true;
}

static void draw_residuals(FILE *out, const view_list *l, const cal_result *r, const cal_view *v,
                           double scale) {
    double d[2];
    for (int i = 0; i < cal_corners(&l->board); i++)
        if (residual(l, r, v, i, d))
            fprintf(out, "<path class=\"r\" d=\"M%.1f %.1fl%.1f %.1f\"/>\n", v->corner[2 * i],
                    v->corner[2 * i + 1], scale * d[0], scale * d[1]);
}

/* A scale at which a residual of 3 sigma is a twentieth of the picture. */
static double residual_scale(const view_list *l, const cal_result *r) {
    double power = l->width / 20. / (3 * fmax(r->noise, 1e-6));
    return pow(10, floor(log10(power)));
}

static void all_residuals(FILE *out, const view_list *l, const cal_result *r) {
    const double scale = residual_scale(l, r);
    fprintf(out,
            "<h2>Residuals</h2><p>How far each corner lies from where the camera model puts it, "
            "%g times enlarged. They should point anywhere; a pattern is something that the model "
            "does not know.</p>\n",
            scale);
    open_svg(out, l, WIDE);
    for (int i = 0; i < l->n; i++)
        if (!*l->item[i].left_out)
            draw_residuals(out, l, r, &l->item[i], scale);
    fputs("</svg>\n", out);
}

static void coverage(FILE *out, const view_list *l) {
    fputs("<h2>Coverage</h2><p>Every corner that was used. Where none is, the lens is guessed."
          "</p>\n",
          out);
    open_svg(out, l, WIDE);
    for (int i = 0; i < l->n; i++)
        for (int k = 0; !*l->item[i].left_out && k < cal_corners(&l->board); k++)
            if (!isnan(l->item[i].corner[2 * k]))
                fprintf(out, "<circle class=\"c\" cx=\"%.1f\" cy=\"%.1f\" r=\"%.1f\"/>\n",
                        l->item[i].corner[2 * k], l->item[i].corner[2 * k + 1], l->width / 400.);
    fputs("</svg>\n", out);
}

static int by_rms(const void *a, const void *b) {
    const cal_view *v = *(const cal_view *const *)a, *w = *(const cal_view *const *)b;
    return (v->rms < w->rms) - (v->rms > w->rms);
}

static void worst_views(FILE *out, const view_list *l, const cal_result *r) {
    const cal_view **order = calloc((size_t)l->n, sizeof *order);
    int n = 0;
    for (int i = 0; order && i < l->n; i++)
        if (!*l->item[i].left_out)
            order[n++] = &l->item[i];
    if (order)
        qsort(order, (size_t)n, sizeof *order, by_rms);
    fputs("<h2>The views that fit worst</h2><div>\n", out);
    for (int i = 0; i < n && i < WORST; i++) {
        open_svg(out, l, SMALL);
        draw_residuals(out, l, r, order[i], residual_scale(l, r));
        fprintf(out, "<text x=\"%d\" y=\"%d\" style=\"font-size:%dpx\">%.3f px: ", l->width / 40,
                l->height / 12, l->width / 24, order[i]->rms);
        escape(out, order[i]->name);
        fputs("</text></svg>\n", out);
    }
    fputs("</div>\n", out);
    free(order);
}

static void draw_map(FILE *out, const view_list *l, const cal_map *m, double full) {
    const double w = (double)l->width / MAP_COLS, h = (double)l->height / MAP_ROWS;
    open_svg(out, l, WIDE);
    for (int i = 0; i < MAP_ROWS * MAP_COLS; i++) {
        const double v = m->at[i / MAP_COLS][i % MAP_COLS], x = i % MAP_COLS * w - 0.5,
                     y = i / MAP_COLS * h - 0.5;
        fprintf(out,
                "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" "
                "fill=\"hsl(%.0f,80%%,75%%)\"/><text x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\" "
                "style=\"font-size:%.1fpx\">%.3g</text>\n",
                x, y, w, h, 120 * (1 - fmin(1, full > 0 ? v / full : 0)), x + w / 2, y + 0.6 * h,
                0.3 * w, v);
    }
    fputs("</svg>\n", out);
}

static void maps(FILE *out, const view_list *l, const cal_quality *q) {
    fprintf(out,
            "<h2>On the part</h2><p>The uncertainty that the calibration leaves on a plane at %.0f "
            "mm, in µm (1 sigma), after the hand-eye calibration has taken out what a motion of "
            "the camera can. Along the depth the focal length leaves %.1f µm.</p>\n",
            q->distance, q->depth_sigma);
    draw_map(out, l, &q->sigma, 2 * q->sigma.middle);
    if (!q->halved) {
        fputs("<h2>Calibrated twice</h2><p>The views are too few for two halves.</p>\n", out);
        return;
    }
    fprintf(out,
            "<h2>Calibrated twice</h2><p>From every other view, and from the rest: the difference "
            "on the same plane in µm. The parameters differ by %.1f times their uncertainty; about "
            "1 is as it should be.</p>\n",
            q->apart);
    draw_map(out, l, &q->difference, fmax(2 * q->sigma.middle, q->difference.worst));
}

/* ---- the tables ----------------------------------------------------------------------------- */

static void parameters(FILE *out, const cal_options *o, const cal_result *r, const cal_quality *q) {
    fputs("<h2>Parameters</h2><table><tr><th></th><th>value</th><th>1 sigma</th><th>95 %</th>",
          out);
    fputs(q->halved ? "<th>first half</th><th>second half</th></tr>\n" : "</tr>\n", out);
    for (int i = 0; i < CAL_N; i++) {
        const int digits = i < CAL_K1 ? 4 : 6;
        const double s = sqrt(r->cov[i * CAL_N + i]);
        fprintf(out, "<tr><td>%s %s</td><td>%.*f</td>", cal_names[i], cal_units[i], digits,
                r->k[i]);
        if (o->fixed[i])
            fputs("<td>fixed</td><td></td>", out);
        else
            fprintf(out, "<td>±%.*f</td><td>±%.*f</td>", digits, s, digits,
                    cal_coverage(r->dof[i]) * s);
        for (int k = 0; q->halved && k < 2; k++)
            fprintf(out, "<td>%.*f</td>", digits, q->half[k].k[i]);
        fputs("</tr>\n", out);
    }
    fprintf(out,
            "</table><p class=\"note\">The residuals have an rms of %.4f px (x %.4f, y %.4f). That "
            "says how well the model fits these corners and is no measure of quality: it falls "
            "when views are thrown away.</p>\n",
            r->rms, r->rms_x, r->rms_y);
}

static void views(FILE *out, const view_list *l) {
    fputs(
        "<h2>Views</h2><table><tr><th>file</th><th>corners</th><th>rms px</th><th>tilt</th></tr>\n",
        out);
    for (int i = 0; i < l->n; i++) {
        const cal_view *v = &l->item[i];
        fputs("<tr><td>", out);
        escape(out, v->name);
        if (*v->left_out) {
            fputs("</td><td colspan=\"3\">left out: ", out);
            escape(out, v->left_out);
            fputs("</td></tr>\n", out);
        } else {
            fprintf(out, "</td><td>%d</td><td>%.3f</td><td>%.0f°</td></tr>\n", v->used, v->rms,
                    cal_tilt(v));
        }
    }
    fputs("</table>\n", out);
}

static void write_page(FILE *out, const view_list *l, const cal_options *o, const cal_result *r,
                       const cal_quality *q) {
    fputs(head, out);
    fprintf(out,
            "<h1>Camera calibration</h1><p>%d of %d views of a board of %dx%d inner corners, %g mm"
            ", in pictures of %dx%d.</p>\n<div class=\"next\"><b>What to do next</b><ul>\n",
            r->views, l->n, l->board.cols, l->board.rows, l->board.square, l->width, l->height);
    for (int i = 0; i < q->n_advice; i++) {
        fputs("<li>", out);
        escape(out, q->advice[i]);
        fputs("</li>\n", out);
    }
    fputs("</ul></div>\n", out);
    parameters(out, o, r, q);
    if (o->flat)
        fprintf(out, "<p>The board bulges by %.3f ± %.3f mm.</p>\n", r->bulge, r->bulge_sigma);
    maps(out, l, q);
    all_residuals(out, l, r);
    coverage(out, l);
    worst_views(out, l, r);
    views(out, l);
    fputs("</body></html>\n", out);
}

int result_write_report(const char *path, const view_list *l, const cal_options *o,
                        const cal_result *r, const cal_quality *q, fault *f) {
    output out;
    int error = output_open(&out, path);
    if (!error) {
        write_page(out.file, l, o, r, q);
        error = output_commit(&out);
    }
    if (!error)
        return 0;
    output_abandon(&out);
    return fault_set(f, ARRIS_E_IO, NULL, "cannot write %s: %s", path, strerror(error));
}
