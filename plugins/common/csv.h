/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * csv.h: reads CSV text whose header names the columns; a row a line, fields plain or "quoted".
 *
 * The text is parsed in place: fields point into it. CRLF, a byte-order mark, blank lines and
 * blanks around fields are allowed. Every fault names file, line and, where there is one, column.
 */
#ifndef CSV_H
#define CSV_H

#include "fault.h"

enum { CSV_FIELDS = 64 };

typedef struct csv {
    const char *path; /* for the faults */
    char *next;       /* the line after this one */
    int line;         /* this one's number, from 1 */
    int n;            /* columns */
    char *name[CSV_FIELDS], *field[CSV_FIELDS];
} csv;

/* Reads the header. `text` holds n bytes and a zero byte, and must outlive *c, as must `path`.
 * Returns 0 or ARRIS_E_INPUT. */
int csv_open(csv *c, const char *path, char *text, size_t n, fault *f);

/* Finds columns by name: column[k] becomes the number of the one that is called names[k]. Returns 0
 * or ARRIS_E_INPUT when one is missing. */
int csv_columns(const csv *c, const char *const *names, int n, int *column, fault *f);

/* Reads the next row into `field`. Returns 1, 0 after the last, or ARRIS_E_INPUT. */
int csv_next(csv *c, fault *f);

/* The field of a column as a finite number, or as a whole number within ±1e17. Returns 0 or
 * ARRIS_E_INPUT. */
int csv_number(const csv *c, int column, double *value, fault *f);
int csv_integer(const csv *c, int column, int64_t *value, fault *f);

#endif
