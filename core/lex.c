/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * lex.c: a launch line to words. White space separates them, quotes ('...' or "...") keep it, a
 * backslash outside '...' takes the next character as it is, and in a recipe # starts a comment. A
 * word that ends in .arris and is no property is a recipe: its words stand in its place.
 */
#include <ctype.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "internal.h"

static int lex_source(token_list *out, source *src, arris_error *err);

static source *source_new(token_list *out, const source *up, const char *path, char *text) {
    source *s = calloc(1, sizeof *s);
    if (!s || !text || (path && !(s->path = strdup(path)))) {
        free(s);
        free(text);
        return NULL;
    }
    s->text = text;
    s->up = up;
    s->next = out->sources;
    out->sources = s;
    return s;
}

/* Copies the word that starts at text[*i] without its quotes, and moves *i behind it. NULL: a quote
 * is not closed, and *i is where it was opened. *joined is set behind a '!' that touches others. */
static char *word(const char *text, size_t *i, char *to, size_t *joined) {
    char quote = 0, *start = to;
    size_t opened = *i, first = *i;
    for (; text[*i] && (quote || !isspace((unsigned char)text[*i])); ++*i) {
        char c = text[*i];
        if (quote && c == quote)
            quote = 0;
        else if (!quote && (c == '"' || c == '\''))
            quote = c, opened = *i;
        else if (!quote && c == '!' &&
                 (*i > first || (text[*i + 1] && !isspace((unsigned char)text[*i + 1]))))
            *joined = *i + 1, *to++ = c;
        else if (c == '\\' && quote != '\'' && text[*i + 1])
            *to++ = text[++*i];
        else
            *to++ = c;
    }
    *to = '\0';
    if (quote)
        *i = opened;
    return quote ? NULL : start;
}

static bool is_recipe(const char *w) {
    size_t n = strlen(w);
    return n > 6 && strcmp(w + n - 6, ".arris") == 0 && !strchr(w, '=');
}

int source_dir(const source *src, const char *path) {
    const char *slash = src && src->path && path[0] != '/' ? strrchr(src->path, '/') : NULL;
    return slash ? (int)(slash - src->path) + 1 : 0;
}

static char *read_recipe(const token *t, const char *path, arris_error *err) {
    FILE *f = fopen(path, "r");
    char *text = f ? malloc(MAX_RECIPE + 1) : NULL;
    size_t n = text ? fread(text, 1, MAX_RECIPE + 1, f) : 0;
    const char *why = !f || ferror(f)      ? strerror(errno)
                      : !text              ? "out of memory"
                      : n > MAX_RECIPE     ? "it is longer than 1 MiB"
                      : memchr(text, 0, n) ? "it is no text file"
                                           : NULL;
    if (f)
        fclose(f);
    if (!why) {
        text[n] = '\0';
        return text;
    }
    free(text);
    error_at(err, t, 0, ARRIS_E_RECIPE, NULL, "cannot read the recipe '%s': %s", path, why);
    return NULL;
}

static int include(token_list *out, const token *t, arris_error *err) {
    char path[4096], real[2][4096];
    int depth = 0;
    if (snprintf(path, sizeof path, "%.*s%s", source_dir(t->src, t->text),
                 t->src->path ? t->src->path : "", t->text) >= (int)sizeof path)
        return error_at(err, t, 0, ARRIS_E_RECIPE, NULL, "the path of this recipe is too long");
    for (const source *s = t->src; s && s->path; s = s->up, depth++)
        if (realpath(path, real[0]) && realpath(s->path, real[1]) && !strcmp(real[0], real[1]))
            return error_at(err, t, 0, ARRIS_E_RECIPE, "take this line out of it",
                            "the recipe '%s' includes itself", t->text);
    if (depth == MAX_DEPTH)
        return error_at(err, t, 0, ARRIS_E_RECIPE, NULL, "recipes are nested more than %d deep",
                        MAX_DEPTH);
    char *text = read_recipe(t, path, err);
    if (!text)
        return ARRIS_E_RECIPE;
    source *src = source_new(out, t->src, path, text);
    if (!src)
        return error_set(err, ARRIS_E_MEMORY, NULL, "out of memory");
    size_t before = out->n;
    int rc = lex_source(out, src, err);
    if (rc == 0 && out->n == before)
        return error_at(err, t, 0, ARRIS_E_RECIPE, NULL, "the recipe '%s' is empty", t->text);
    return rc;
}

static int append(token_list *out, const token *t, arris_error *err) {
    if (out->n == MAX_TOKENS)
        return error_at(err, t, 0, ARRIS_E_RECIPE, NULL, "more than %d words", MAX_TOKENS);
    if (out->n == out->max) {
        size_t max = out->max ? 2 * out->max : 64;
        token *item = realloc(out->item, max * sizeof *item);
        if (!item)
            return error_set(err, ARRIS_E_MEMORY, NULL, "out of memory");
        out->item = item;
        out->max = max;
    }
    out->item[out->n] = *t;
    out->item[out->n].text = strdup(t->text);
    if (!out->item[out->n].text)
        return error_set(err, ARRIS_E_MEMORY, NULL, "out of memory");
    out->n++;
    return 0;
}

static int lex_source(token_list *out, source *src, arris_error *err) {
    char *buffer = malloc(strlen(src->text) + 1);
    int rc = buffer ? 0 : error_set(err, ARRIS_E_MEMORY, NULL, "out of memory");
    for (size_t i = 0; rc == 0;) {
        while (isspace((unsigned char)src->text[i]))
            i++;
        if (src->path && src->text[i] == '#') {
            i += strcspn(src->text + i, "\n");
            continue;
        }
        if (!src->text[i])
            break;
        token t = {src, buffer, i};
        size_t joined = 0;
        if (!word(src->text, &i, buffer, &joined))
            rc = error_at(err, &t, i - t.at, ARRIS_E_RECIPE, NULL,
                          "a quote is opened here and not closed");
        else if (joined)
            rc = error_at(err, &t, joined - 1 - t.at, ARRIS_E_RECIPE,
                          "put white space on both sides of it, or quote it within a value",
                          "this '!' touches other words");
        else
            rc = is_recipe(buffer) ? include(out, &t, err) : append(out, &t, err);
    }
    free(buffer);
    return rc;
}

int lex(token_list *out, const char *line, arris_error *err) {
    source *src = source_new(out, NULL, NULL, strdup(line));
    return src ? lex_source(out, src, err) : error_set(err, ARRIS_E_MEMORY, NULL, "out of memory");
}

void lex_free(token_list *t) {
    for (size_t i = 0; i < t->n; i++)
        free((char *)t->item[i].text);
    free(t->item);
    for (source *s = t->sources, *next; s; s = next) {
        next = s->next;
        free(s->path);
        free(s->text);
        free(s);
    }
    *t = (token_list){0};
}
