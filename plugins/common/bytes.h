/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * bytes.h: a whole file in a buffer that is used again for the next one.
 */
#ifndef BYTES_H
#define BYTES_H

#include "fault.h"

typedef struct bytes {
    uint8_t *data; /* n bytes and a zero byte; free() releases it */
    size_t n, max;
} bytes;

/* Makes room for files of n bytes; what the buffer held is lost. Returns 0 or ARRIS_E_MEMORY. */
int bytes_reserve(bytes *b, size_t n, fault *f);

/* Reads the file at `path`, of at most `limit` bytes. Allocates only when it is bigger than all
 * before. Returns 0, or ARRIS_E_INPUT (there is none, or it is too big), _IO (it cannot be read, or
 * is no file), _MEMORY. */
int bytes_read(bytes *b, const char *path, size_t limit, fault *f);

#endif
