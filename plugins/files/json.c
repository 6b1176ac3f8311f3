/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * json.c: lines.json, arris-lines/1 of FORMATS.md.
 */
#include <math.h>

#include "writers.h"

static const char *state_name(enum arris_line_state state) {
    return state == ARRIS_MEASURED ? "measured" : state == ARRIS_WEAK ? "weak" : "unobservable";
}

static void number(FILE *out, const char *key, double value) {
    if (isfinite(value))
        fprintf(out, ", \"%s\": %.9g", key, value);
    else
        fprintf(out, ", \"%s\": null", key);
}

static void numbers(FILE *out, const char *key, const char *format, const double *v, int n) {
    fprintf(out, ", \"%s\": ", key);
    if (!all_finite(v, n)) {
        fprintf(out, "null");
        return;
    }
    for (int i = 0; i < n; i++) {
        fputc(i ? ',' : '[', out);
        fprintf(out, format, v[i]);
    }
    fputc(']', out);
}

/* A covariance has variances across the line and along it that differ by many powers of ten: it
 * needs all its digits to stay positive definite. */
static void line(FILE *out, const arris_line *l) {
    fprintf(out, "{\"id\": %d", l->id);
    numbers(out, "p", "%.9g", l->p, 3);
    numbers(out, "q", "%.9g", l->q, 3);
    fprintf(out, ", \"views\": %u", l->views);
    number(out, "baseline", l->baseline);
    number(out, "rms_px", l->rms);
    fprintf(out, ", \"state\": \"%s\"", state_name(line_state(l)));
    numbers(out, "cov", "%.15g", l->cov, 21);
    fputc('}', out);
}

void json_write(FILE *out, const arris_lines *lines) {
    fprintf(out, "{\"format\": \"arris-lines/1\", \"unit\": \"mm\", \"frames\": %u", lines->frames);
    number(out, "scale_sigma", lines->scale_sigma);
    number(out, "pose_sigma", lines->pose_sigma);
    fprintf(out, ",\n\"lines\": [");
    const char *comma = "";
    for (uint32_t i = 0; i < lines->n; i++) {
        if (!line_stands(&lines->item[i]))
            continue;
        fprintf(out, "%s\n", comma);
        line(out, &lines->item[i]);
        comma = ",";
    }
    fprintf(out, "\n]}\n");
}
