/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * error.c: the list of errors, and errors that point into the launch line.
 */
#include <string.h>

#include "internal.h"

#ifndef ARRIS_VERSION
#define ARRIS_VERSION "unknown"
#endif

const char *arris_version(void) {
    return ARRIS_VERSION;
}

const char *arris_strerror(int code) {
    switch (code) {
#define X(name, value, exit_code, text)                                                            \
    case ARRIS_E_##name:                                                                           \
        return text;
        ARRIS_ERRORS(X)
#undef X
    default:
        return code == 0 ? "ok" : "unknown error";
    }
}

int arris_exit_code(int code) {
    switch (code) {
#define X(name, value, exit_code, text)                                                            \
    case ARRIS_E_##name:                                                                           \
        return exit_code;
        ARRIS_ERRORS(X)
#undef X
    default:
        return code == 0 ? 0 : 5;
    }
}

static int fill(arris_error *err, int code, const char *hint, const char *format, va_list ap) {
    if (!err)
        return code;
    memset(err, 0, sizeof *err);
    err->code = code;
    err->column = -1;
    vsnprintf(err->text, sizeof err->text, format, ap);
    for (char *c = err->text; *c; c++) /* as of a name in the line, which may be anything */
        *c = (unsigned char)*c < ' ' ? ' ' : *c;
    snprintf(err->hint, sizeof err->hint, "%s", hint ? hint : "");
    return code;
}

int error_set(arris_error *err, int code, const char *hint, const char *format, ...) {
    va_list ap;
    va_start(ap, format);
    fill(err, code, hint, format, ap);
    va_end(ap);
    return code;
}

/* Copies the line around `at`, cut to what fits, control characters as spaces. */
static void quote_line(arris_error *err, const char *text, size_t at) {
    enum { BEFORE = 60, WIDTH = 100 };
    size_t begin = at, n = 0;
    while (begin > 0 && text[begin - 1] != '\n')
        begin--;
    if (at - begin > BEFORE)
        begin = at - BEFORE;
    while (begin < at && (text[begin] & 0xC0) == 0x80) /* not in the middle of a UTF-8 character */
        begin++;
    err->column = 0;
    for (size_t i = begin; text[i] && text[i] != '\n' && n < WIDTH; i++, n++) {
        err->line[n] = (unsigned char)text[i] < ' ' ? ' ' : text[i];
        err->column += i < at && (text[i] & 0xC0) != 0x80;
    }
    err->line[n] = '\0';
}

int error_at(arris_error *err, const token *t, size_t skip, int code, const char *hint,
             const char *format, ...) {
    va_list ap;
    va_start(ap, format);
    fill(err, code, hint, format, ap);
    va_end(ap);
    if (!err || !t || !t->src)
        return code;
    quote_line(err, t->src->text, t->at + skip);
    if (t->src->path) {
        snprintf(err->file, sizeof err->file, "%s", t->src->path);
        err->line_number = 1;
        for (size_t i = 0; i < t->at + skip; i++)
            err->line_number += t->src->text[i] == '\n';
    }
    return code;
}
