/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * memory.h: how the poses' noise hangs together over the frames. No dependency on the runtime.
 *
 * A robot's error changes slowly, and of n views that share it few count. What is slow does not
 * show in the residuals, since the lines follow it: their correlation from frame to frame comes out
 * too small, and so does their size. So the noise is taken for a process of some memory, and how
 * likely each memory is is found with the line as unknown as it is, but for what the angles of its
 * segments tell, which a shift leaves as they are (restricted likelihood; Patterson and Thompson
 * 1971), by all lines together. What is told is the mean over the memories:
 * with the few independent values that a scan has, the likeliest says too little.
 *
 * There are two kinds, Matern's of order 1/2 and 3/2 (Rasmussen and Williams 2006, 4.2.1), each as
 * what keeps a state from frame to frame (Hartikainen and Sarkka 2010), over gaps, too. What goes
 * along the motion, where a drive sticks and slips, is rough: an autoregressive process of the
 * first order. What goes across, and rotations, is smooth: critically damped, of the second order.
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

/* The covariance of the line by its views' own noise, which is `scale` times the stated, and by the
 * poses', which hangs together. C is that by the stated variances. *shared: the part of it that
 * views share, over C; the mean over the two ways that a shift moves a line in. */
mat4 memory_covariance(const memories *m, const line *l, const scene *s, double scale,
                       const mat4 *C, double *shared);

#endif
