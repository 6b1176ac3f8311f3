/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * output.c: a file that appears complete or not at all (output.h).
 */
#include "output.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* mkstemp makes files that only their owner may read; these get what any new file would. */
static FILE *open_temporary(char *name, const char *mode) {
    mode_t mask = umask(0);
    umask(mask);
    int fd = mkstemp(name);
    if (fd < 0)
        return NULL;
    fchmod(fd, 0666 & ~mask);
    FILE *f = fdopen(fd, mode);
    if (!f) {
        close(fd);
        unlink(name);
    }
    return f;
}

static char *temporary_name(const char *path) {
    size_t room = strlen(path) + sizeof ".XXXXXX";
    char *name = malloc(room);
    if (name)
        snprintf(name, room, "%s.XXXXXX", path);
    return name;
}

int output_open(output *o, const char *path) {
    struct stat st;
    *o = (output){.path = path};
    if (stat(path, &st) == 0 && !S_ISREG(st.st_mode))
        return S_ISDIR(st.st_mode) ? EISDIR : EINVAL;
    o->temporary = temporary_name(path);
    o->file = o->temporary ? open_temporary(o->temporary, "w") : NULL;
    if (o->file)
        return 0;
    int error = errno;
    free(o->temporary);
    o->temporary = NULL;
    return error;
}

int output_error(FILE *f) {
    return !ferror(f) ? 0 : errno ? errno : EIO;
}

int output_commit(output *o) {
    int error = output_error(o->file);
    if (!error && (fflush(o->file) || fsync(fileno(o->file))))
        error = errno;
    if (fclose(o->file) && !error)
        error = errno;
    o->file = NULL;
    if (!error && rename(o->temporary, o->path))
        error = errno;
    if (error)
        unlink(o->temporary);
    free(o->temporary);
    o->temporary = NULL;
    return error;
}

void output_abandon(output *o) {
    if (o->file)
        fclose(o->file);
    if (o->temporary)
        unlink(o->temporary);
    free(o->temporary);
    *o = (output){0};
}

FILE *output_scratch(const char *path) {
    char *name = temporary_name(path);
    FILE *f = name ? open_temporary(name, "w+") : NULL;
    if (f)
        unlink(name);
    free(name);
    return f;
}
