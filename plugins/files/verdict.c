/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * verdict.c: verdict.json, arris-verdict/1 of FORMATS.md; what isn't finite is null.
 */
#include <jansson.h>
#include <math.h>

#include "writers.h"

const char *judgement_name(enum arris_judgement j) {
    return j == ARRIS_PASS ? "PASS" : j == ARRIS_FAIL ? "FAIL" : "INDETERMINATE";
}

/* What is no UTF-8 is null. */
static void json_text(FILE *out, const char *text) {
    json_t *string = json_string(text);
    if (!string || json_dumpf(string, out, JSON_ENCODE_ANY))
        fputs("null", out);
    json_decref(string);
}

static void number(FILE *out, const char *key, double value) {
    fprintf(out, ", \"%s\": ", key);
    if (isfinite(value))
        fprintf(out, "%.9g", value);
    else
        fputs("null", out);
}

static void feature(FILE *out, const arris_feature *f) {
    fputs("{\"id\": ", out);
    json_text(out, f->id);
    fprintf(out, ", \"unit\": \"%s\"", f->is_angle ? "rad" : "mm");
    number(out, "deviation", f->deviation);
    number(out, "U", f->U);
    number(out, "worst", f->worst);
    number(out, "worst_U", f->worst_U);
    number(out, "tolerance", f->tolerance);
    number(out, "straightness", f->straightness);
    fprintf(out, ", \"verdict\": \"%s\"", judgement_name(f->verdict));
    if (f->line >= 0)
        fprintf(out, ", \"line\": %d", f->line);
    if (f->reason) {
        fputs(", \"reason\": ", out);
        json_text(out, f->reason);
    }
    fputc('}', out);
}

void verdict_write(FILE *out, const arris_verdict *v, const char *recipe) {
    fprintf(out, "{\"format\": \"arris-verdict/1\", \"verdict\": \"%s\"",
            judgement_name(v->verdict));
    number(out, "tolerance", v->tolerance);
    number(out, "coverage_factor", v->coverage_factor);
    fprintf(out, ",\n\"sha256\": {\"model\": \"%s\", \"calibration\": \"%s\"", v->model,
            v->calibration);
    if (*recipe)
        fprintf(out, ", \"recipe\": \"%s\"", recipe);
    fputs("},\n\"features\": [", out);
    for (uint32_t i = 0; i < v->n; i++) {
        fputs(i ? ",\n" : "\n", out);
        feature(out, &v->item[i]);
    }
    fputs("\n],\n\"extra_lines\": [", out);
    for (uint32_t i = 0; i < v->n_extra; i++)
        fprintf(out, "%s%d", i ? ", " : "", v->extra[i]);
    fputs("]}\n", out);
}
