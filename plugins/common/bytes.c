/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * bytes.c: a whole file in a buffer that is used again for the next one.
 */
#include "bytes.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

int bytes_reserve(bytes *b, size_t n, fault *f) {
    if (n < b->max)
        return 0;
    free(b->data);
    b->n = 0;
    b->max = n + 1;
    b->data = malloc(b->max);
    if (b->data)
        return 0;
    b->max = 0;
    return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for a file of %zu bytes", n);
}

/* Fills the buffer with at most n bytes: fewer when the file became shorter. */
static int fill(bytes *b, int fd, size_t n) {
    b->n = 0;
    while (b->n < n) {
        ssize_t got = read(fd, b->data + b->n, n - b->n);
        if (got < 0 && errno != EINTR)
            return -1;
        if (got == 0)
            break;
        if (got > 0)
            b->n += (size_t)got;
    }
    b->data[b->n] = 0;
    return 0;
}

static int read_open(bytes *b, int fd, const char *path, size_t limit, fault *f) {
    struct stat st;
    if (fstat(fd, &st) < 0)
        return fault_set(f, ARRIS_E_IO, NULL, "cannot read %s: %s", path, strerror(errno));
    if (!S_ISREG(st.st_mode))
        return fault_set(f, ARRIS_E_IO, NULL, "%s is no regular file", path);
    if ((uint64_t)st.st_size > limit)
        return fault_set(f, ARRIS_E_INPUT, NULL, "%s has %lld bytes; the limit is %zu", path,
                         (long long)st.st_size, limit);
    int r = bytes_reserve(b, (size_t)st.st_size, f);
    if (r < 0)
        return r;
    if (fill(b, fd, (size_t)st.st_size) < 0)
        return fault_set(f, ARRIS_E_IO, NULL, "cannot read %s: %s", path, strerror(errno));
    return 0;
}

int bytes_read(bytes *b, const char *path, size_t limit, fault *f) {
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK); /* a FIFO must not make us wait */
    if (fd < 0)
        return fault_set(f, errno == ENOENT ? ARRIS_E_INPUT : ARRIS_E_IO, NULL,
                         "cannot open %s: %s", path, strerror(errno));
    int r = read_open(b, fd, path, limit, f);
    close(fd);
    return r;
}
