/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * catalogue.c: what stages there are, explained from their descriptors, for people and as JSON.
 */
#include <math.h>
#include <string.h>

#include "internal.h"

/* ---- JSON ------------------------------------------------------------------------------------ */

static void json_text(FILE *out, const char *text) {
    if (!text) {
        fputs("null", out);
        return;
    }
    fputc('"', out);
    for (; *text; text++) {
        unsigned char c = (unsigned char)*text;
        if (c == '"' || c == '\\')
            fprintf(out, "\\%c", c);
        else if (c < ' ')
            fprintf(out, "\\u%04x", c);
        else
            fputc(c, out);
    }
    fputc('"', out);
}

static void json_field(FILE *out, const char *before, const char *name, const char *text) {
    fprintf(out, "%s\"%s\": ", before, name);
    json_text(out, text);
}

static void json_layers(FILE *out, const char *name, uint32_t set) {
    const char *comma = "";
    fprintf(out, ",\n   \"%s\": [", name);
    for (unsigned i = 0; i < ARRIS_MAX_LAYERS; i++)
        if (set & ARRIS_BIT(i)) {
            fprintf(out, "%s\"%s\"", comma, layer_name(i));
            comma = ", ";
        }
    fputc(']', out);
}

static const char *type_name(enum arris_type t) {
    static const char *const names[] = {"int", "double", "bool", "enum", "string", "path"};
    return t < COUNT(names) ? names[t] : "unknown";
}

static void json_prop(FILE *out, const arris_prop *p) {
    json_field(out, "     {", "name", p->name);
    json_field(out, ", ", "type", type_name(p->type));
    json_field(out, ", ", "default", p->value);
    if (isfinite(p->min) && isfinite(p->max) && (p->type == ARRIS_INT || p->type == ARRIS_DOUBLE))
        fprintf(out, ", \"min\": %.17g, \"max\": %.17g", p->min, p->max);
    json_field(out, ", ", "unit", p->unit);
    json_field(out, ", ", "words", p->words);
    json_field(out, ", ", "help", p->help);
    fputc('}', out);
}

static void json_stage(FILE *out, const arris_stage_desc *d, const char *plugin) {
    json_field(out, "  {", "name", d->name);
    json_field(out, ",\n   ", "summary", d->summary);
    json_field(out, ",\n   ", "example", d->example);
    json_field(out, ",\n   ", "plugin", plugin);
    json_field(out, ",\n   ", "kind",
               d->flags & ARRIS_SOURCE ? "source"
               : d->flags & ARRIS_SINK ? "sink"
                                       : "filter");
    json_layers(out, "needs", d->layers.needs);
    json_layers(out, "wants", d->layers.wants);
    json_layers(out, "gives", d->layers.gives);
    fputs(",\n   \"properties\": [\n", out);
    for (size_t i = 0; i < d->n_props; i++) {
        json_prop(out, &d->props[i]);
        fputs(i + 1 < d->n_props ? ",\n" : "\n", out);
    }
    fputs("   ]}", out);
}

/* ---- for people ------------------------------------------------------------------------------ */

static void text_layers(FILE *out, const char *what, uint32_t set) {
    char names[200];
    layer_names(set, names, sizeof names);
    if (set)
        fprintf(out, "%s %s\n", what, names);
}

static void text_stage(FILE *out, const arris_stage_desc *d, const char *plugin) {
    fprintf(out, "%s: %s\n\n", d->name, d->summary ? d->summary : "");
    text_layers(out, "needs ", d->layers.needs);
    text_layers(out, "uses  ", d->layers.wants);
    text_layers(out, "gives ", d->layers.gives);
    if (d->n_props)
        fputs("\nproperties:\n", out);
    for (size_t i = 0; i < d->n_props; i++) {
        char range[256];
        props_range(&d->props[i], range, sizeof range);
        fprintf(out, "  %-14s %s\n                 %s; default %s\n", d->props[i].name,
                d->props[i].help, range, d->props[i].value ? d->props[i].value : "none");
    }
    if (d->example)
        fprintf(out, "\nexample:\n  arris launch %s\n", d->example);
    if (plugin)
        fprintf(out, "\nfrom %s\n", plugin);
}

/* ---- the public functions -------------------------------------------------------------------- */

typedef struct listing {
    FILE *out;
    bool json;
    const char *only; /* one stage; NULL: all */
    size_t n;
} listing;

static void list_one(const arris_stage_desc *d, const char *plugin, void *user) {
    listing *l = user;
    if (l->only && strcmp(l->only, d->name) != 0)
        return;
    if (l->json) {
        fputs(l->n ? ",\n" : "", l->out);
        json_stage(l->out, d, plugin);
    } else if (l->only) {
        text_stage(l->out, d, plugin);
    } else {
        fprintf(l->out, "%-14s %s\n", d->name, d->summary ? d->summary : "");
    }
    l->n++;
}

void arris_print_stages(FILE *out, bool json) {
    listing l = {.out = out, .json = json};
    fputs(json ? "[\n" : "", out);
    registry_each(list_one, &l);
    fputs(json ? "\n]\n" : "", out);
}

int arris_print_stage(const char *name, FILE *out, bool json, arris_error *err) {
    arris_error ignored;
    listing l = {.out = out, .json = json, .only = name};
    if (!registry_find(name, NULL, err ? err : &ignored))
        return err ? err->code : ignored.code;
    registry_each(list_one, &l);
    fputs(json ? "\n" : "", out);
    return 0;
}

int arris_print_devices(const char *name, FILE *out, arris_error *err) {
    arris_error ignored;
    const arris_stage_desc *d = registry_find(name, NULL, err ? err : &ignored);
    if (!d)
        return err ? err->code : ignored.code;
    if (!d->devices)
        return error_set(err, ARRIS_E_USAGE, NULL, "%s deals with no devices", name);
    int rc = d->devices(out);
    return rc ? error_set(err, rc, NULL, "%s cannot list its devices", name) : 0;
}
