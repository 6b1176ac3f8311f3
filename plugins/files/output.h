/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * output.h: a file that appears complete or not at all: written under a temporary name in the same
 * folder and renamed at the end, so that a reader never sees half of it and a failure leaves an
 * older one as it was.
 */
#ifndef OUTPUT_H
#define OUTPUT_H

#include <stdio.h>

typedef struct output {
    FILE *file; /* to write to; NULL: closed */
    const char *path;
    char *temporary;
} output;

/* Opens a temporary file beside `path`, which must outlive *o. Returns 0 or an errno, EISDIR or
 * EINVAL when something other than a file is at `path`. */
int output_open(output *o, const char *path);

/* 0, or the errno of a write that has failed. To be asked right after writing, errno having been 0
 * before. */
int output_error(FILE *f);

/* Flushes to the disk, closes and renames. Returns 0 or an errno; then nothing has changed. */
int output_commit(output *o);

/* Removes what was written, unless it was committed. Safe on an output that never opened. */
void output_abandon(output *o);

/* A file without a name in the folder of `path`, to write and read back; fclose removes it. NULL
 * with errno set when it cannot be made. */
FILE *output_scratch(const char *path);

#endif
