/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * props.c: properties from text into a stage's struct, by its offset table.
 */
#include <errno.h>
#include <locale.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "internal.h"

void props_range(const arris_prop *p, char *text, size_t size) {
    const char *unit = p->unit ? p->unit : "", *space = p->unit ? " " : "";
    switch (p->type) {
    case ARRIS_INT:
    case ARRIS_DOUBLE:
        snprintf(text, size, "%.10g to %.10g%s%s%s%s", p->min, p->max, space, unit,
                 p->words ? " or " : "", p->words ? p->words : "");
        break;
    case ARRIS_BOOL:
        snprintf(text, size, "true or false");
        break;
    case ARRIS_ENUM:
        snprintf(text, size, "%s", p->words);
        break;
    case ARRIS_STRING:
        snprintf(text, size, "a text");
        break;
    case ARRIS_INFILE:
        snprintf(text, size, "a path");
        break;
    }
}

/* The index of `word` in "a|b|c", or -1. */
static int word_index(const char *words, const char *word) {
    size_t n = strlen(word);
    for (int i = 0; words; i++) {
        const char *end = strchrnul(words, '|');
        if ((size_t)(end - words) == n && memcmp(words, word, n) == 0)
            return i;
        words = *end ? end + 1 : NULL;
    }
    return -1;
}

static int own_string(strings **own, const char *dir, int dir_size, const char *text,
                      const char **to) {
    size_t n = (size_t)dir_size + strlen(text) + 1;
    strings *s = malloc(sizeof *s + n);
    if (!s)
        return ARRIS_E_MEMORY;
    snprintf(s->text, n, "%.*s%s", dir_size, dir, text);
    s->next = *own;
    *own = s;
    *to = s->text;
    return 0;
}

/* As in the C locale, whatever the application's is. */
static double to_double(const char *text, char **end) {
    locale_t c = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    double v = c ? strtod_l(text, end, c) : strtod(text, end);
    if (c)
        freelocale(c);
    return v;
}

static int store_number(const arris_prop *p, const char *text, void *to) {
    char *end;
    errno = 0;
    double v = to_double(text, &end);
    if (p->words && strcmp(text, p->words) == 0)
        v = -1;
    else if (end == text || *end || errno || !isfinite(v) || v < p->min || v > p->max ||
             strpbrk(text, "xXpP"))
        return ARRIS_E_USAGE;
    if (p->type == ARRIS_DOUBLE)
        memcpy(to, &v, sizeof v);
    else if (v == trunc(v))
        memcpy(to, &(int32_t){(int32_t)v}, sizeof(int32_t));
    else
        return ARRIS_E_USAGE;
    return 0;
}

static int store_word(const char *words, const char *text, int32_t *to) {
    *to = word_index(words, text);
    return *to < 0 ? ARRIS_E_USAGE : 0;
}

static int store(const arris_prop *p, void *self, strings **own, const source *src,
                 const char *text) {
    char *to = (char *)self + p->offset;
    int32_t index;
    switch (p->type) {
    case ARRIS_INT:
    case ARRIS_DOUBLE:
        return store_number(p, text, to);
    case ARRIS_BOOL:
        if (store_word("false|true|0|1|no|yes", text, &index))
            return ARRIS_E_USAGE;
        *(bool *)to = index & 1;
        return 0;
    case ARRIS_ENUM:
        return store_word(p->words, text, (int32_t *)to);
    case ARRIS_STRING:
        return own_string(own, "", 0, text, (const char **)to);
    case ARRIS_INFILE:
        return own_string(own, src && src->path ? src->path : "", source_dir(src, text), text,
                          (const char **)to);
    }
    return ARRIS_E_USAGE;
}

int props_default(const arris_stage_desc *d, void *self, strings **own, arris_error *err) {
    for (size_t i = 0; i < d->n_props; i++) {
        const arris_prop *p = &d->props[i];
        if (p->value && store(p, self, own, NULL, p->value))
            return error_set(err, ARRIS_E_PLUGIN, NULL, "%s: the default of '%s' is not valid: %s",
                             d->name, p->name, p->value);
    }
    return 0;
}

/* Adds a word to what a row "*" has taken. */
static int store_rest(const arris_prop *p, void *self, strings **own, const char *word) {
    const char **to = (void *)((char *)self + p->offset), *before = *to ? *to : "";
    int rc = own_string(own, before, (int)strlen(before), word, to);
    return rc ? rc : own_string(own, *to, (int)strlen(*to), "\n", to);
}

static int unknown(const arris_stage_desc *d, const token *t, const char *key, arris_error *err) {
    char hint[400] = "it has no properties";
    nearest n = {.word = key};
    for (size_t i = 0, at = 0; i < d->n_props && at < sizeof hint; i++) {
        at += (size_t)snprintf(hint + at, sizeof hint - at, "%s%s", i ? ", " : "it has ",
                               d->props[i].name);
        nearest_offer(&n, d->props[i].name);
    }
    const char *best = nearest_result(&n);
    return error_at(err, t, 0, ARRIS_E_USAGE, hint, "%s has no property '%s'%s%s%s", d->name, key,
                    best ? "; did you mean '" : "", best ? best : "", best ? "'?" : "");
}

int props_set(const arris_stage_desc *d, void *self, strings **own, const token *t,
              arris_error *err) {
    const char *value = strchr(t->text, '=') + 1;
    size_t n = (size_t)(value - t->text) - 1;
    const arris_prop *rest = NULL;
    for (size_t i = 0; i < d->n_props; i++) {
        const arris_prop *p = &d->props[i];
        if (strcmp(p->name, "*") == 0)
            rest = p;
        if (strlen(p->name) != n || memcmp(p->name, t->text, n) != 0)
            continue;
        int rc = store(p, self, own, t->src, value);
        if (rc != ARRIS_E_USAGE)
            return rc ? error_set(err, rc, NULL, "out of memory") : 0;
        char range[256];
        props_range(p, range, sizeof range);
        return error_at(err, t, n + 1, ARRIS_E_USAGE, p->help, "%s: %s cannot be '%s': it is %s%s",
                        d->name, p->name, value, p->type == ARRIS_INT ? "a whole number from " : "",
                        range);
    }
    if (rest)
        return store_rest(rest, self, own, t->text)
                   ? error_set(err, ARRIS_E_MEMORY, NULL, "out of memory")
                   : 0;
    char key[64];
    snprintf(key, sizeof key, "%.*s", n < sizeof key ? (int)n : (int)sizeof key - 1, t->text);
    return unknown(d, t, key, err);
}
