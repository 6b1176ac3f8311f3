/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * scratch.h: a folder of the test program's own for files, removed when the program ends.
 */
#ifndef SCRATCH_H
#define SCRATCH_H

#include <ftw.h>
#include <limits.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static char scratch_template[] = "/tmp/arris-test-XXXXXX";
static char *scratch_folder; /* NULL: there is none yet */

static inline int scratch_remove_one(const char *path, const struct stat *st, int flag,
                                     struct FTW *ftw) {
    (void)st, (void)flag, (void)ftw;
    return remove(path);
}

static inline void scratch_remove(const char *path) {
    nftw(path, scratch_remove_one, 16, FTW_DEPTH | FTW_PHYS);
}

static inline void scratch_end(void) {
    scratch_remove(scratch_folder);
}

/* The path of `name` in the folder; valid until eight more were asked for. */
static inline const char *scratch(const char *name) {
    static char path[8][PATH_MAX];
    static unsigned turn;
    if (!scratch_folder) {
        scratch_folder = mkdtemp(scratch_template);
        if (!scratch_folder || atexit(scratch_end))
            abort();
    }
    char *p = path[turn++ % 8];
    snprintf(p, PATH_MAX, "%s/%s", scratch_folder, name);
    return p;
}

static inline const char *scratch_mkdir(const char *name) {
    const char *path = scratch(name);
    scratch_remove(path);
    if (mkdir(path, 0700))
        abort();
    return path;
}

static inline const char *scratch_write(const char *name, const char *format, ...)
    __attribute__((format(printf, 2, 3)));
static inline const char *scratch_write(const char *name, const char *format, ...) {
    const char *path = scratch(name);
    FILE *f = fopen(path, "w");
    va_list ap;
    va_start(ap, format);
    if (!f || vfprintf(f, format, ap) < 0 || fclose(f))
        abort();
    va_end(ap);
    return path;
}

/* A whole file as a text for free; empty when there is none. */
static inline char *file_text(const char *path) {
    FILE *f = fopen(path, "r");
    size_t n = 0, size = 4096;
    char *text = malloc(size);
    while (f && text && (n += fread(text + n, 1, size - 1 - n, f)) == size - 1)
        text = realloc(text, size *= 2);
    if (!text)
        abort();
    text[n] = '\0';
    if (f)
        fclose(f);
    return text;
}

/* A link `name` in the folder to what the build made, `$B/made`. */
static inline const char *scratch_link(const char *name, const char *made) {
    char to[PATH_MAX], whole[PATH_MAX];
    const char *b = getenv("B"), *path = scratch(name);
    snprintf(to, sizeof to, "%s/%s", b ? b : "build", made);
    unlink(path);
    if (!realpath(to, whole) || symlink(whole, path)) {
        fprintf(stderr, "%s is not there: run `make`, and say B= where it built\n", to);
        abort();
    }
    return path;
}

#endif
