/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * path.h: the slow part of the error of the reported positions, and what it does to the lines. No
 * dependency on the runtime.
 *
 * What changes from frame to frame shows against the lines (shift.h). What changes slowly does not,
 * as far as the lines move along: a shift of all, a scale, a bend. So it is estimated together with
 * all lines: piecewise linear in the frames' numbers, each line eliminated, the positions' noise as
 * the prior (VISION's step 6 in few unknowns). It is left small where the lines do not tell, and
 * its covariance is then the noise averaged, which the lines have in common and each is told with.
 */
#ifndef PATH_H
#define PATH_H

#include "line.h"
#include "shift.h"

typedef struct path path;

/* NULL when memory is short. */
path *path_new(void);
void path_free(path *p); /* NULL is allowed */

/* Forgets everything. The shifts of the `frames`, at least one, are the prior; their noise is
 * correlated as s->memories says. */
void path_begin(path *p, const shifts *t, uint32_t frames, const scene *s);

/* Adds what the kept views of a settled line say. */
void path_add(path *p, const line *l, const scene *s);

/* Concludes. False when nothing can be said. */
bool path_solve(path *p);

/* Adds the slow part to the shifts of the line's kept views. */
void path_shift(const path *p, line *l);

/* The covariance of l->x by what is not known of the slow part. */
mat4 path_covariance(const path *p, const line *l, const scene *s);

#endif
