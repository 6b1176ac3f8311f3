/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * frames.c: the frames of a recording, from a frames.csv or a folder of pictures.
 */
#include "frames.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

#include "arris_geometry.h"
#include "bytes.h"
#include "csv.h"

enum { MAX_CSV = 256 << 20 };

static const char csv_hint[] =
    "frames.csv has the columns index,file,utime,x,y,z,omega,theta,kappa; utime in microseconds, "
    "and the last six, in mm and rad, either all filled or all empty";

/* ---- frames.csv ----------------------------------------------------------------------------- */

enum { INDEX, FILE_NAME, UTIME, POSE, COLUMNS = POSE + 6 };
static const char *const names[COLUMNS] = {"index", "file",  "utime", "x",    "y",
                                           "z",     "omega", "theta", "kappa"};

static int read_pose(const csv *c, const int *column, frame_entry *e, fault *f) {
    int first_empty = -1, filled = 0;
    for (int k = 5; k >= 0; k--) {
        if (*c->field[column[k]])
            filled++;
        else
            first_empty = k;
    }
    e->posed = filled > 0;
    if (filled > 0 && filled < 6)
        return fault_set(f, ARRIS_E_INPUT, NULL, "%s:%d: %s: this is empty in a pose that is not",
                         c->path, c->line, names[POSE + first_empty]);
    int r = 0;
    for (int k = 0; r == 0 && k < filled; k++)
        r = csv_number(c, column[k], &e->pose[k], f);
    return r;
}

static int read_entry(const csv *c, const int *column, frame_entry *e, fault *f) {
    e->file = c->field[column[FILE_NAME]];
    if (!*e->file)
        return fault_set(f, ARRIS_E_INPUT, NULL, "%s:%d: file: this is empty", c->path, c->line);
    int r = csv_integer(c, column[INDEX], &e->index, f);
    if (r == 0)
        r = csv_integer(c, column[UTIME], &e->utime, f);
    if (r == 0)
        r = read_pose(c, column + POSE, e, f);
    return r;
}

/* The rows that a text can hold, FRAMES_MAX at most. */
static size_t count_lines(const char *text) {
    size_t n = 1;
    while (n < FRAMES_MAX && (text = strchr(text, '\n'))) {
        text++;
        n++;
    }
    return n;
}

static int reserve(frame_list *l, size_t n, fault *f) {
    l->item = calloc(n, sizeof *l->item);
    return l->item ? 0 : fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for %zu frames", n);
}

static int read_rows(frame_list *l, csv *c, fault *f) {
    int column[COLUMNS];
    int r = csv_columns(c, names, COLUMNS, column, f);
    while (r == 0 && (r = csv_next(c, f)) > 0) {
        if (l->n == FRAMES_MAX)
            return fault_set(f, ARRIS_E_INPUT, NULL, "%s:%d: there are more than %d frames",
                             c->path, c->line, FRAMES_MAX);
        frame_entry *e = &l->item[l->n++];
        r = read_entry(c, column, e, f);
        l->posed |= e->posed;
    }
    if (r == 0 && l->n == 0)
        return fault_set(f, ARRIS_E_INPUT, NULL, "%s has no frames", c->path);
    return r;
}

int frames_parse(frame_list *l, char *text, size_t n, const char *path, fault *f) {
    csv c;
    int r = reserve(l, count_lines(text), f);
    if (r == 0)
        r = csv_open(&c, path, text, n, f);
    if (r == 0)
        r = read_rows(l, &c, f);
    if (r < 0)
        f->hint = csv_hint;
    return r;
}

static int load_csv(frame_list *l, const char *location, fault *f) {
    bytes b = {0};
    const char *slash = strrchr(location, '/');
    size_t folder = slash ? (size_t)(slash - location) + 1 : 0;
    int r = bytes_read(&b, location, MAX_CSV, f);
    l->text = (char *)b.data;
    if (r < 0)
        return r;
    memcpy(l->folder, location, folder); /* it could be opened, so it is shorter than FRAMES_PATH */
    return frames_parse(l, l->text, b.n, location, f);
}

/* ---- a folder ------------------------------------------------------------------------------- */

int frames_compare_names(const char *a, const char *b) {
    static const char digits[] = "0123456789";
    const char *whole_a = a, *whole_b = b;
    while (*a && *b) {
        if (strchr(digits, *a) && strchr(digits, *b)) {
            a += strspn(a, "0");
            b += strspn(b, "0");
            size_t n = strspn(a, digits), m = strspn(b, digits);
            int d = n != m ? (n < m ? -1 : 1) : strncmp(a, b, n);
            if (d != 0)
                return d;
            a += n;
            b += m;
        } else if (*a != *b) {
            break;
        } else {
            a++;
            b++;
        }
    }
    int d = (unsigned char)*a - (unsigned char)*b;
    return d != 0 ? d : strcmp(whole_a, whole_b);
}

static int by_name(const struct dirent **a, const struct dirent **b) {
    return frames_compare_names((*a)->d_name, (*b)->d_name);
}

static int is_picture(const struct dirent *d) {
    static const char *const endings[] = {".png", ".jpg", ".jpeg", ".pgm"};
    const char *dot = strrchr(d->d_name, '.');
    if (!dot || d->d_name[0] == '.')
        return 0;
    for (size_t i = 0; i < sizeof endings / sizeof *endings; i++)
        if (strcasecmp(dot, endings[i]) == 0)
            return 1;
    return 0;
}

static int no_pictures(const frame_list *l, const char *location, fault *f) {
    char path[FRAMES_PATH];
    bool csv_there = frames_path(l, "frames.csv", path, f) == 0 && access(path, F_OK) == 0;
    return fault_set(f, ARRIS_E_INPUT,
                     csv_there ? "it has a frames.csv: give location= that file, not its folder"
                               : "location= is a folder of .png, .jpg, .jpeg or .pgm files, or a "
                                 "frames.csv",
                     "the folder %s has no pictures", location);
}

static int load_folder(frame_list *l, const char *location, double interval, fault *f) {
    size_t len = strlen(location);
    const char *slash = location[len - 1] == '/' ? "" : "/";
    if (snprintf(l->folder, sizeof l->folder, "%s%s", location, slash) >= FRAMES_PATH)
        return fault_set(f, ARRIS_E_INPUT, NULL, "the path of the folder is too long");
    int n = scandir(location, &l->names, is_picture, by_name);
    if (n < 0)
        return fault_set(f, ARRIS_E_IO, NULL, "cannot read the folder %s: %s", location,
                         strerror(errno));
    l->n = (size_t)n;
    if (n == 0)
        return no_pictures(l, location, f);
    if (n > FRAMES_MAX)
        return fault_set(f, ARRIS_E_INPUT, "split it",
                         "the folder %s has %d pictures; the limit "
                         "is %d",
                         location, n, FRAMES_MAX);
    int r = reserve(l, l->n, f);
    for (int i = 0; r == 0 && i < n; i++) {
        l->item[i].file = l->names[i]->d_name;
        l->item[i].index = i;
        l->item[i].utime = llround(i * interval);
    }
    return r;
}

/* ---- both ----------------------------------------------------------------------------------- */

int frames_load(frame_list *l, const char *location, double interval, fault *f) {
    struct stat st;
    int r;
    memset(l, 0, sizeof *l);
    if (stat(location, &st) < 0)
        r = fault_set(f, errno == ENOENT ? ARRIS_E_INPUT : ARRIS_E_IO, NULL, "cannot open %s: %s",
                      location, strerror(errno));
    else if (S_ISDIR(st.st_mode))
        r = load_folder(l, location, interval, f);
    else
        r = load_csv(l, location, f);
    if (r < 0 && !f->hint)
        f->hint = "location= is a frames.csv, or a folder of pictures";
    return r;
}

void frames_free(frame_list *l) {
    for (size_t i = 0; l->names && i < l->n; i++)
        free(l->names[i]);
    free(l->names);
    free(l->text);
    free(l->item);
    memset(l, 0, sizeof *l);
}

int frames_path(const frame_list *l, const char *file, char path[FRAMES_PATH], fault *f) {
    const char *folder = *file == '/' ? "" : l->folder;
    if (snprintf(path, FRAMES_PATH, "%s%s", folder, file) >= FRAMES_PATH)
        return fault_set(f, ARRIS_E_INPUT, NULL, "the path is too long: %.100s...", file);
    return 0;
}

void frames_pose(const frame_entry *e, arris_pose *pose) {
    memset(pose, 0, sizeof *pose);
    pose->valid = e->posed;
    memcpy(pose->C, e->pose, sizeof pose->C);
    arris_rotation(e->pose[3], e->pose[4], e->pose[5], pose->R);
}
