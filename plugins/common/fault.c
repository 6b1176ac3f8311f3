/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * fault.c: what went wrong, in words.
 */
#include "fault.h"

#include <stdarg.h>
#include <stdio.h>

int fault_set(fault *f, int code, const char *hint, const char *format, ...) {
    va_list ap;
    va_start(ap, format);
    vsnprintf(f->text, sizeof f->text, format, ap);
    va_end(ap);
    f->hint = hint;
    return code;
}
