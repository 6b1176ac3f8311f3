/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * csv.c: reads CSV text whose header names the columns.
 */
#include "csv.h"

#include <locale.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const char blanks[] = " \t";

static int bad_value(const csv *c, int column, const char *what, fault *f) {
    return fault_set(f, ARRIS_E_INPUT, NULL, "%s:%d: %s: \"%s\" is no %s", c->path, c->line,
                     c->name[column], c->field[column], what);
}

/* The next line that is not blank, without its end; NULL after the last. */
static char *take_line(csv *c) {
    while (*c->next) {
        char *line = c->next;
        char *end = line + strcspn(line, "\n");
        c->next = *end ? end + 1 : end;
        c->line++;
        if (end > line && end[-1] == '\r')
            end--;
        *end = 0;
        if (line[strspn(line, blanks)])
            return line;
    }
    return NULL;
}

/* Both end the field at p, in place; they return where it stopped and, in *stop, the character that
 * stood there: a comma or zero, anything else when the quotes do not match. */
static char *quoted(char *p, char *stop) {
    char *to = p, *from = p + 1;
    *stop = '"';
    for (; *from; from++) {
        if (*from == '"' && *++from != '"') {
            from += strspn(from, blanks);
            *stop = *from;
            break;
        }
        *to++ = *from;
    }
    *to = 0;
    return from;
}

static char *plain(char *p, char *stop) {
    char *end = p + strcspn(p, ",");
    *stop = *end;
    char *last = end;
    while (last > p && strchr(blanks, last[-1]))
        last--;
    *last = 0;
    return end;
}

/* Splits a line into fields. Returns how many, or ARRIS_E_INPUT. */
static int split(const csv *c, char *p, char **field, fault *f) {
    for (int n = 0; n < CSV_FIELDS; p++) {
        char stop;
        p += strspn(p, blanks);
        field[n++] = p;
        p = *p == '"' ? quoted(p, &stop) : plain(p, &stop);
        if (stop == 0)
            return n;
        if (stop != ',')
            return fault_set(f, ARRIS_E_INPUT, NULL, "%s:%d: the quotes of field %d do not match",
                             c->path, c->line, n);
    }
    return fault_set(f, ARRIS_E_INPUT, NULL, "%s:%d: there are more than %d fields", c->path,
                     c->line, CSV_FIELDS);
}

int csv_open(csv *c, const char *path, char *text, size_t n, fault *f) {
    static const char bom[] = "\xef\xbb\xbf";
    *c = (csv){.path = path, .next = text};
    if (strlen(text) != n)
        return fault_set(f, ARRIS_E_INPUT, NULL, "%s is no CSV text: byte %zu is zero", path,
                         strlen(text));
    if (strncmp(text, bom, sizeof bom - 1) == 0)
        c->next += sizeof bom - 1;
    char *line = take_line(c);
    if (!line)
        return fault_set(f, ARRIS_E_INPUT, NULL, "%s is empty", path);
    c->n = split(c, line, c->name, f);
    return c->n < 0 ? c->n : 0;
}

static int find(const csv *c, const char *name) {
    for (int i = 0; i < c->n; i++)
        if (strcmp(c->name[i], name) == 0)
            return i;
    return -1;
}

int csv_columns(const csv *c, const char *const *names, int n, int *column, fault *f) {
    for (int k = 0; k < n; k++) {
        column[k] = find(c, names[k]);
        if (column[k] < 0)
            return fault_set(f, ARRIS_E_INPUT, NULL, "%s:%d: the header has no column \"%s\"",
                             c->path, c->line, names[k]);
    }
    return 0;
}

int csv_next(csv *c, fault *f) {
    char *line = take_line(c);
    if (!line)
        return 0;
    int n = split(c, line, c->field, f);
    if (n < 0)
        return n;
    if (n != c->n)
        return fault_set(f, ARRIS_E_INPUT, NULL, "%s:%d: there are %d fields; the header has %d",
                         c->path, c->line, n, c->n);
    return 1;
}

/* strtod as in the C locale, whatever the application's is. */
static double to_double(const char *text, char **end) {
    locale_t c = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    double v = strtod_l(text, end, c);
    freelocale(c);
    return v;
}

int csv_number(const csv *c, int column, double *value, fault *f) {
    char *end = c->field[column];
    if (end[strspn(end, "+-.0123456789eE")] == 0) /* no inf, nan or hexadecimal */
        *value = to_double(c->field[column], &end);
    if (end == c->field[column] || *end || !isfinite(*value))
        return bad_value(c, column, "finite number", f);
    return 0;
}

int csv_integer(const csv *c, int column, int64_t *value, fault *f) {
    static const int64_t limit = 100000000000000000;
    char *end;
    *value = strtoll(c->field[column], &end, 10); /* saturates, which is beyond the limit */
    if (end == c->field[column] || *end || *value > limit || *value < -limit)
        return bad_value(c, column, "whole number within 1e17", f);
    return 0;
}
