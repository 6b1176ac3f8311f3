/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * fault.h: what went wrong, as functions that know no stage hand it to one that does:
 *     return arris_fail(s, code, why.hint, "%s", why.text);
 */
#ifndef FAULT_H
#define FAULT_H

#include "arris_types.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct fault {
    char text[400];
    const char *hint; /* what to do: a string literal, or NULL */
} fault;

/* Fills *f and returns `code`, one of ARRIS_E_... */
int fault_set(fault *f, int code, const char *hint, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

#ifdef __cplusplus
}
#endif
#endif
