/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * memory.h: how the poses' noise hangs together over the frames. No dependency on the runtime.
 *
 * A robot's error changes slowly, and of n views that share it few count. What is slow does not
 * show in the residuals, since the lines follow it: their correlation from frame to frame comes out
 * too small, and so does their size. So the noise is taken for an autoregressive process of the
 * first order, and how likely each correlation is is found with the line as unknown as it is
 * (restricted likelihood; Patterson and Thompson 1971), by all lines together. What is told is the
 * mean over the correlations: with the few independent values that a scan has, the likeliest says
 * too little.
 */
#ifndef MEMORY_H
#define MEMORY_H

#include "line.h"

/* Forgets everything. */
void memory_begin(memories *m);

/* Adds what the kept views of a settled line say. */
void memory_add(memories *m, const line *l, const scene *s);

/* Concludes; m->known is false when nothing can be said. */
void memory_end(memories *m);

/* The variance of the line's estimate by what its views share, over C, the covariance of it by
 * their stated variances. */
double memory_shared(const memories *m, const line *l, const scene *s, const mat4 *C);

#endif
