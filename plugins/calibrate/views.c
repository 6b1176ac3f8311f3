/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * views.c: the views that a calibration is made from (views.h).
 */
#include "views.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "bytes.h"
#include "find.h"
#include "frames.h"
#include "image/picture.h"

enum { MAX_FILE = 1 << 30 };

static const char hint_picture[] = "PNG, JPEG and PGM are read; leave this file out";
static const char hint_size[] =
    "one calibration is for one camera in one mode: give it the pictures of one size only";
static const char hint_board[] =
    "count the inner corners, where four squares meet: a board of 10x7 squares is --board 9x6; the "
    "whole board must be in the picture, evenly lit, with a light margin around it";

static int no_memory(fault *f) {
    return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for the views");
}

cal_view *views_add(view_list *l, const char *name) {
    if (l->n == l->max) {
        int max = l->max ? 2 * l->max : 32;
        cal_view *item = realloc(l->item, (size_t)max * sizeof *item);
        if (!item)
            return NULL;
        l->item = item;
        l->max = max;
    }
    cal_view *v = &l->item[l->n];
    memset(v, 0, sizeof *v);
    v->name = strdup(name);
    v->corner = calloc((size_t)cal_corners(&l->board), 2 * sizeof *v->corner);
    if (!v->name || !v->corner) {
        free(v->name);
        free(v->corner);
        return NULL;
    }
    l->n++;
    return v;
}

void views_free(view_list *l) {
    for (int i = 0; i < l->n; i++) {
        free(l->item[i].name);
        free(l->item[i].corner);
    }
    free(l->item);
    *l = (view_list){0};
}

/* ---- one picture ---------------------------------------------------------------------------- */

static int decode(const bytes *file, arris_image *im, fault *f) {
    picture_info info;
    int r = picture_read_info(file->data, file->n, &info, f);
    if (r < 0)
        return r;
    *im = (arris_image){.format = info.format,
                        .width = info.width,
                        .height = info.height,
                        .stride = (ptrdiff_t)((info.width * info.format + 63) / 64 * 64)};
    im->data = aligned_alloc(64, (size_t)im->stride * (size_t)im->height + 64);
    return im->data ? picture_decode(file->data, file->n, im, f) : no_memory(f);
}

/* Decodes the picture at `path`; free(im->data) must follow in any case. */
static int load_picture(const char *path, arris_image *im, fault *f) {
    bytes file = {0};
    fault why;
    *im = (arris_image){.data = NULL};
    int r = bytes_read(&file, path, MAX_FILE, f);
    if (r == 0 && (r = decode(&file, im, &why)) < 0)
        fault_set(f, r, why.hint ? why.hint : hint_picture, "%s: %s", path, why.text);
    free(file.data);
    return r;
}

static int find_view(view_list *l, const char *path, const arris_image *im, fault *f) {
    if (l->n == CAL_MAX_VIEWS)
        return fault_set(f, ARRIS_E_INPUT, "50 good views are plenty",
                         "there are more than %d pictures", CAL_MAX_VIEWS);
    cal_view *v = views_add(l, path);
    if (!v)
        return no_memory(f);
    enum find_result found = find_board(im, &l->board, false, v->corner);
    if (found == FIND_BIGGER)
        return fault_set(f, ARRIS_E_INPUT, hint_board, "%s: the board has more than %dx%d corners",
                         path, l->board.cols, l->board.rows);
    const char *why = find_reason(found);
    snprintf(v->left_out, sizeof v->left_out, "%s", why ? why : "");
    return 0;
}

int views_load_picture(view_list *l, const char *path, fault *f) {
    arris_image im;
    int r = load_picture(path, &im, f);
    if (r == 0 && l->width == 0) {
        l->width = im.width;
        l->height = im.height;
    }
    if (r == 0 && (im.width != l->width || im.height != l->height))
        r = fault_set(f, ARRIS_E_INPUT, hint_size, "%s is %dx%d; the first picture is %dx%d", path,
                      im.width, im.height, l->width, l->height);
    if (r == 0)
        r = find_view(l, path, &im, f);
    free(im.data);
    return r;
}

/* ---- all of them ---------------------------------------------------------------------------- */

static bool is_list(const char *path) {
    struct stat st;
    const char *dot = strrchr(path, '.');
    return (dot && strcmp(dot, ".csv") == 0) || (stat(path, &st) == 0 && S_ISDIR(st.st_mode));
}

static int load_list(view_list *l, const char *location, fault *f) {
    frame_list list;
    char path[FRAMES_PATH];
    int r = frames_load(&list, location, 40000, f);
    for (size_t i = 0; r == 0 && i < list.n; i++)
        if ((r = frames_path(&list, list.item[i].file, path, f)) == 0)
            r = views_load_picture(l, path, f);
    frames_free(&list);
    return r;
}

int views_load(view_list *l, char *const *paths, int n, fault *f) {
    int r = 0;
    for (int i = 0; r == 0 && i < n; i++)
        r = is_list(paths[i]) ? load_list(l, paths[i], f) : views_load_picture(l, paths[i], f);
    return r;
}

/* ---- none found ----------------------------------------------------------------------------- */

/* Whether the first picture shows a board with `less` fewer corners each way. */
static bool shows(const view_list *l, int less) {
    arris_image im;
    fault f;
    cal_board b = {l->board.cols - less, l->board.rows - less, l->board.square};
    if (b.cols < 3 || b.rows < 3 || load_picture(l->item[0].name, &im, &f) < 0)
        return false;
    double *corner = calloc((size_t)cal_corners(&b), 2 * sizeof *corner);
    bool found = corner && find_board(&im, &b, false, corner) == FIND_OK;
    free(corner);
    free(im.data);
    return found;
}

int views_check(const view_list *l, fault *f) {
    for (int i = 0; i < l->n; i++)
        if (!*l->item[i].left_out)
            return 0;
    if (l->n == 0)
        return fault_set(f, ARRIS_E_INPUT, hint_board, "there is no picture");
    const int cols = l->board.cols, rows = l->board.rows;
    if (shows(l, 1))
        return fault_set(f, ARRIS_E_INPUT, hint_board,
                         "%s shows %dx%d inner corners, not %dx%d: those are its squares",
                         l->item[0].name, cols - 1, rows - 1, cols, rows);
    return fault_set(f, ARRIS_E_INPUT, hint_board,
                     "a board of %dx%d inner corners was found in none of %d pictures", cols, rows,
                     l->n);
}
