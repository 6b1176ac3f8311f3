/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * figure.h: figures as SVG: panels of pictures with drawings over them.
 */
#ifndef FIGURE_H
#define FIGURE_H

#include "arris_types.h"

#include <stdio.h>

/* A new file with room for so many panels of pictures of the size given. NULL: it can't be. */
FILE *figure_open(const char *path, int columns, int rows, int width, int height);

/* Begins the panel in a column and a row: its title over a grey picture, whose levels are drawn to
 * the share `light`. Until figure_panel_end all coordinates are pixels of the picture. */
void figure_panel(FILE *f, int column, int row, const char *title, const arris_image *im,
                  double light);
void figure_panel_end(FILE *f);

void figure_line(FILE *f, const char *colour, double x1, double y1, double x2, double y2);
void figure_chain(FILE *f, const char *colour, const arris_edge_point *point, uint32_t n);
void figure_circle(FILE *f, const char *colour, double x, double y);
void figure_cross(FILE *f, const char *colour, double x, double y);

/* Returns 0 or ARRIS_E_IO: not all could be written. */
int figure_close(FILE *f);

#endif
