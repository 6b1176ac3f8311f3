/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * result.c: the table and the file of a calibration (result.h).
 */
#include "result.h"

#include <math.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "files/output.h"

static double sigma_of(const cal_result *r, int i) {
    return sqrt(r->cov[i * CAL_N + i]);
}

/* ---- the table ------------------------------------------------------------------------------ */

static void print_parameters(FILE *out, const cal_options *o, const cal_result *r) {
    fprintf(out, "%-6s %13s  %12s  %12s\n", "", "", "± 1 sigma", "± 95 %");
    for (int i = 0; i < CAL_N; i++) {
        int digits = i < CAL_K1 ? 4 : 6;
        fprintf(out, "%-6s %13.*f", cal_names[i], digits, r->k[i]);
        if (o->fixed[i])
            fprintf(out, "  %12s  %12s\n", "fixed", "");
        else
            fprintf(out, "  %12.*f  %12.*f %s\n", digits, sigma_of(r, i), digits,
                    cal_coverage(r->dof[i]) * sigma_of(r, i), cal_units[i]);
    }
}

static void print_views(FILE *out, const view_list *l) {
    for (int i = 0; i < l->n; i++)
        if (*l->item[i].left_out)
            fprintf(out, "left out  %s: %s\n", l->item[i].name, l->item[i].left_out);
}

void result_print(FILE *out, const view_list *l, const cal_options *o, const cal_result *r,
                  const cal_quality *q) {
    fprintf(out, "%d of %d views, %d corners, %d rejected\n\n", r->views, l->n, r->corners,
            r->rejected);
    print_parameters(out, o, r);
    fprintf(out,
            "\nrms of the residuals %.4f px (x %.4f, y %.4f); it says how well the model fits, "
            "not how good the calibration is\n",
            r->rms, r->rms_x, r->rms_y);
    if (o->flat)
        fprintf(out, "the board bulges by %.3f ± %.3f mm\n", r->bulge, r->bulge_sigma);
    fprintf(out,
            "on the part at %.0f mm: %.1f µm at the worst place of the picture, %.1f in the "
            "middle one; %.1f µm in depth (1 sigma)\n",
            q->distance, q->sigma.worst, q->sigma.middle, q->depth_sigma);
    if (q->halved)
        fprintf(out,
                "twice, on halves of the views: %.1f µm apart at the worst place, %.1f times "
                "what is expected\n",
                q->difference.worst, q->apart);
    print_views(out, l);
    for (int i = 0; i < q->n_advice; i++)
        fprintf(out, "next: %s\n", q->advice[i]);
}

/* ---- camera.json ---------------------------------------------------------------------------- */

json_t *result_read_old(const char *path, fault *f) {
    json_error_t e;
    if (access(path, F_OK) != 0)
        return json_object();
    json_t *o = json_load_file(path, JSON_REJECT_DUPLICATES, &e);
    if (json_is_object(o))
        return o;
    json_decref(o);
    fault_set(f, ARRIS_E_INPUT, "give -o another name, or remove that file",
              "%s is there and is no JSON object: it would be lost", path);
    return NULL;
}

int result_write_json(const char *path, const json_t *o, fault *f) {
    static const char hint[] = "see that the folder exists, can be written to and is not full";
    output out;
    int error = output_open(&out, path);
    if (!error && (json_dumpf(o, out.file, JSON_INDENT(1)) < 0 || fputc('\n', out.file) == EOF))
        error = output_error(out.file);
    if (!error)
        error = output_commit(&out);
    if (error) {
        output_abandon(&out);
        return fault_set(f, ARRIS_E_IO, hint, "cannot write %s: %s", path, strerror(error));
    }
    return 0;
}

static json_t *calibration(const view_list *l, const cal_options *o, const cal_result *r) {
    char utc[32];
    time_t now = time(NULL);
    struct tm tm;
    strftime(utc, sizeof utc, "%Y-%m-%dT%H:%M:%SZ", gmtime_r(&now, &tm));
    json_t *sigma = json_object(), *shape = json_array();
    for (int i = 0; i < CAL_N; i++)
        json_object_set_new(sigma, cal_names[i], json_real(sigma_of(r, i)));
    for (int i = 0; o->flat && i < CAL_SHAPE; i++)
        json_array_append_new(shape, json_real(r->shape[i]));
    json_t *board = json_pack("{s:i, s:i, s:f}", "cols", l->board.cols, "rows", l->board.rows,
                              "square", l->board.square);
    if (o->flat)
        json_object_set(board, "shape", shape);
    json_decref(shape);
    return json_pack("{s:f, s:i, s:o, s:o, s:s}", "rms_px", r->rms, "views", r->views, "sigma",
                     sigma, "board", board, "utc", utc);
}

int result_write_camera(const char *path, json_t *old, const view_list *l, const cal_options *o,
                        const cal_result *r, fault *f) {
    json_object_set_new(old, "width", json_integer(l->width));
    json_object_set_new(old, "height", json_integer(l->height));
    for (int i = 0; i < CAL_N; i++)
        json_object_set_new(old, cal_names[i], json_real(r->k[i]));
    if (json_object_set_new(old, "calibration", calibration(l, o, r)))
        return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for %s", path);
    return result_write_json(path, old, f);
}
