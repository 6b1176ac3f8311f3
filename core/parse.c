/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * parse.c: words to stages.
 *
 *     pipeline = chain { chain }
 *     chain    = [ NAME. "!" ] stage { "!" stage }      NAME is that of a tee
 *     stage    = STAGE { property=value }
 */
#include <stdlib.h>
#include <string.h>

#include "internal.h"

static int out_of_memory(arris_error *err) {
    return error_set(err, ARRIS_E_MEMORY, NULL, "out of memory");
}

static arris_stage *stage_named(const arris_pipeline *p, const char *name, size_t n) {
    for (size_t i = 0; i < p->n_stages; i++)
        if (strlen(p->stage[i]->name) == n && memcmp(p->stage[i]->name, name, n) == 0)
            return p->stage[i];
    return NULL;
}

/* The descriptor's name, numbered when it is taken. */
static void name_stage(arris_pipeline *p, arris_stage *s) {
    snprintf(s->name, sizeof s->name, "%s", s->desc->name);
    for (int k = 2; stage_named(p, s->name, strlen(s->name)); k++)
        snprintf(s->name, sizeof s->name, "%.48s%d", s->desc->name, k);
}

arris_stage *stage_new(arris_pipeline *p, const arris_stage_desc *d, const token *at,
                       arris_error *err) {
    if (p->n_stages == MAX_STAGES) {
        error_at(err, at, 0, ARRIS_E_RECIPE, NULL, "more than %d stages", MAX_STAGES);
        return NULL;
    }
    arris_stage *s = aligned_alloc(_Alignof(arris_stage), sizeof *s); /* calloc aligns to 16 */
    if (s)
        memset(s, 0, sizeof *s);
    if (!s || !(s->self = calloc(1, d->self_size + 1))) {
        free(s);
        out_of_memory(err);
        return NULL;
    }
    s->pipeline = p;
    s->desc = d;
    s->at = *at;
    s->delay = 1;
    atomic_store(&s->frame, -1);
    name_stage(p, s);
    p->stage[p->n_stages++] = s;
    return props_default(d, s->self, &s->own, err) ? NULL : s;
}

int stage_link(arris_stage *from, arris_stage *to, arris_error *err) {
    arris_stage **out = realloc(from->out, (from->n_out + 1) * sizeof *out);
    if (!out)
        return out_of_memory(err);
    from->out = out;
    from->out[from->n_out++] = to;
    to->in = from;
    return 0;
}

static int rename_stage(arris_pipeline *p, arris_stage *s, const token *t, arris_error *err) {
    const char *name = t->text + strlen("name=");
    size_t n = strlen(name);
    if (n == 0 || n >= MAX_NAME || name[strspn(name, NAME_CHARACTERS)])
        return error_at(err, t, 5, ARRIS_E_USAGE, "letters, digits, '-' and '_', at most 63",
                        "'%.64s' is not a valid name", name);
    if (stage_named(p, name, n) && stage_named(p, name, n) != s)
        return error_at(err, t, 5, ARRIS_E_RECIPE, NULL, "another stage is named '%s'", name);
    memcpy(s->name, name, n + 1);
    return 0;
}

static bool is_property(const token *t) {
    return strchr(t->text, '=') && t->text[0] != '=';
}

static int parse_stage(arris_pipeline *p, size_t *i, arris_stage **s, arris_error *err) {
    const token *t = &p->tokens.item[*i];
    if (strcmp(t->text, "!") == 0 || is_property(t))
        return error_at(err, t, 0, ARRIS_E_RECIPE, NULL, "a stage is expected here, not '%.64s'",
                        t->text);
    const arris_stage_desc *d = registry_find(t->text, t, err);
    if (!d || !(*s = stage_new(p, d, t, err)))
        return err ? err->code : ARRIS_E_RECIPE;
    for (++*i; *i < p->tokens.n && is_property(&p->tokens.item[*i]); ++*i) {
        t = &p->tokens.item[*i];
        int rc = strncmp(t->text, "name=", 5) == 0 ? rename_stage(p, *s, t, err)
                                                   : props_set(d, (*s)->self, &(*s)->own, t, err);
        if (rc)
            return rc;
    }
    return 0;
}

/* "t." as the start of a chain. */
static int parse_branch(arris_pipeline *p, size_t *i, arris_stage **tail, arris_error *err) {
    const token *t = &p->tokens.item[*i];
    *tail = stage_named(p, t->text, strlen(t->text) - 1);
    if (!*tail)
        return error_at(err, t, 0, ARRIS_E_RECIPE, "give it one: `tee name=...`",
                        "no stage before this is named '%.*s'", (int)strlen(t->text) - 1, t->text);
    if ((*tail)->desc != &stage_tee)
        return error_at(err, t, 0, ARRIS_E_RECIPE, "only a tee has several branches",
                        "'%s' is not a tee", (*tail)->name);
    if (++*i == p->tokens.n || strcmp(p->tokens.item[*i].text, "!") != 0)
        return error_at(err, t, strlen(t->text), ARRIS_E_RECIPE, NULL, "'!' is expected after '%s'",
                        t->text);
    ++*i;
    return 0;
}

static bool is_branch(const token *t) {
    size_t n = strlen(t->text);
    return n > 1 && t->text[n - 1] == '.';
}

static int check_place(arris_pipeline *p, const arris_stage *tail, const arris_stage *s,
                       arris_error *err) {
    if ((s->desc->flags & ARRIS_SOURCE) && p->n_stages > 1)
        return error_at(err, &s->at, 0, ARRIS_E_RECIPE,
                        "a pipeline has one source, at its beginning", "'%s' is a second source",
                        s->desc->name);
    if (!(s->desc->flags & ARRIS_SOURCE) && !tail)
        return p->n_stages == 1
                   ? error_at(err, &s->at, 0, ARRIS_E_RECIPE, "begin with one, as `imagesrc`",
                              "the pipeline has no source: '%s' stands first", s->desc->name)
                   : error_at(err, &s->at, 0, ARRIS_E_RECIPE, NULL, "'!' is missing before '%s'",
                              s->desc->name);
    return 0;
}

static int parse_chain(arris_pipeline *p, size_t *i, arris_error *err) {
    arris_stage *tail = NULL, *s = NULL;
    int rc = is_branch(&p->tokens.item[*i]) ? parse_branch(p, i, &tail, err) : 0;
    for (; rc == 0; ++*i) {
        if (*i == p->tokens.n)
            return error_at(err, &p->tokens.item[*i - 1], 0, ARRIS_E_RECIPE, NULL,
                            "a stage is expected after this '!'");
        rc = parse_stage(p, i, &s, err);
        if (rc == 0)
            rc = check_place(p, tail, s, err);
        if (rc == 0 && tail)
            rc = stage_link(tail, s, err);
        tail = s;
        if (rc || *i == p->tokens.n || strcmp(p->tokens.item[*i].text, "!") != 0)
            return rc;
    }
    return rc;
}

static int check_ends(const arris_pipeline *p, arris_error *err) {
    for (size_t i = 0; i < p->n_stages; i++) {
        const arris_stage *s = p->stage[i];
        if (!s->n_out && !(s->desc->flags & ARRIS_SINK))
            return error_at(err, &s->at, 0, ARRIS_E_RECIPE,
                            "end it with a sink, as `filesink` or `fakesink`",
                            "nothing takes what '%s' gives", s->name);
    }
    return 0;
}

static int parse(arris_pipeline *p, const char *line, arris_error *err) {
    int rc = lex(&p->tokens, line, err);
    if (rc == 0 && p->tokens.n == 0)
        rc = error_set(err, ARRIS_E_USAGE, "give it stages: imagesrc location=... ! edges ! ...",
                       "the pipeline is empty");
    for (size_t i = 0; rc == 0 && i < p->tokens.n;)
        rc = parse_chain(p, &i, err);
    return rc ? rc : check_ends(p, err);
}

arris_pipeline *arris_parse(const char *line, arris_error *err) {
    arris_pipeline *p = aligned_alloc(_Alignof(arris_pipeline), sizeof *p);
    if (p)
        memset(p, 0, sizeof *p);
    arris_error ignored;
    if (!err)
        err = &ignored;
    if (!p || !(p->stage = calloc(MAX_STAGES, sizeof(arris_stage *))) || bus_init(&p->bus)) {
        if (p)
            free(p->stage);
        free(p);
        out_of_memory(err);
        return NULL;
    }
    if (parse(p, line, err)) {
        arris_free(p);
        return NULL;
    }
    return p;
}

/* A word to what the lexer makes the same word of. */
static char *quote(char *to, const char *word) {
    bool plain = *word && !strpbrk(word, " \t\r\n\v\f\"'\\");
    if (!plain)
        *to++ = '"';
    for (; *word; word++) {
        if (*word == '"' || *word == '\\')
            *to++ = '\\';
        *to++ = *word;
    }
    if (!plain)
        *to++ = '"';
    return to;
}

arris_pipeline *arris_parse_words(int n, char *const *words, arris_error *err) {
    if (n == 1)
        return arris_parse(words[0], err);
    size_t size = 1;
    for (int i = 0; i < n; i++)
        size += 2 * strlen(words[i]) + 3;
    char *line = malloc(size), *to = line;
    if (!line) {
        out_of_memory(err);
        return NULL;
    }
    for (int i = 0; i < n; i++) {
        if (i > 0)
            *to++ = ' ';
        to = quote(to, words[i]);
    }
    *to = '\0';
    arris_pipeline *p = arris_parse(line, err);
    free(line);
    return p;
}

static void stage_free(arris_stage *s) {
    if (s->was_set_up && s->desc->close)
        s->desc->close(s, s->self);
    for (int i = 0; i < ARRIS_MAX_LAYERS; i++)
        pool_free(&s->pools[i].pool);
    for (strings *o = s->own, *next; o; o = next) {
        next = o->next;
        free(o);
    }
    ring_free(&s->ring);
    free(s->out);
    free(s->self);
    free(s);
}

void arris_free(arris_pipeline *p) {
    if (!p)
        return;
    run_join(p);
    for (size_t i = p->n_stages; i-- > 0;)
        stage_free(p->stage[i]);
    trace_close(p);
    loops_free(p);
    pool_free(&p->frames);
    bus_free(&p->bus);
    lex_free(&p->tokens);
    free(p->lanes);
    free(p->stage);
    free(p);
}
