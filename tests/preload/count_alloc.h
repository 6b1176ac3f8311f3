/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * count_alloc.h: what a process allocates, and who asks for it: to be preloaded.
 */
#ifndef COUNT_ALLOC_H
#define COUNT_ALLOC_H

#include <stdbool.h>

/* Starts or stops counting; all threads. */
void count_alloc(bool on);

/* Writes a line "COUNT OBJECT SYMBOL+OFFSET" for every place that allocated while it was counted.
 * OBJECT is the file that asked: the first on the stack that is not the C or C++ library. Returns 0
 * or -1. */
int count_alloc_report(const char *path);

#endif
