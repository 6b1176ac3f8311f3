/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * views.h: the views that a calibration is made from, as they are collected from pictures.
 */
#ifndef CALIBRATE_VIEWS_H
#define CALIBRATE_VIEWS_H

#include "fit.h"

typedef struct view_list {
    cal_board board;
    int32_t width, height; /* px, of the first picture, and so of all; 0: there is none yet */
    int n, max;
    cal_view *item;
} view_list;

/* Adds a view with room for its corners, which are the caller's to fill; `name` is copied. Returns
 * it, valid until the next one is added, or NULL: no memory. */
cal_view *views_add(view_list *l, const char *name);

void views_free(view_list *l);

/* Adds the views of `paths`: picture files, folders of them, or CSV files with a column `file`.
 * Where the board is not found the view is left out with the reason. Returns 0, or ARRIS_E_INPUT
 * (no picture, one of another size, a board that has more corners, no board anywhere), _IO,
 * _MEMORY, _INTERNAL. */
int views_load(view_list *l, char *const *paths, int n, fault *f);

/* Adds the view of one picture. */
int views_load_picture(view_list *l, const char *path, fault *f);

/* After the last picture: ARRIS_E_INPUT when the board was found in none, with a guess at why. */
int views_check(const view_list *l, fault *f);

#endif
