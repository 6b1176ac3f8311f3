/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * one_error.h: that a program which failed says one thing, clearly. Include cmocka.h before.
 */
#ifndef ONE_ERROR_H
#define ONE_ERROR_H

#include "process.h"

/* The program ends with `code`, nothing on stdout, and one block on stderr: "arris: TEXT", then
 * perhaps the line with a caret at the beginning of `at`, and a hint that holds `hint`. */
static inline void assert_one_error(process *p, const char *line, int code, const char *text,
                                    const char *at, const char *hint) {
    char *first = p->err, *second = strchr(first, '\n'), *third;
    if (p->code != code || *p->out || strncmp(first, "arris", 5) || !second)
        fail_msg("'%s' ends with %d, says '%s' and '%s'", line, p->code, p->out, p->err);
    for (third = second; third[1]; third = strchr(third + 1, '\n'))
        if (strncmp(third + 1, "  ", 2))
            fail_msg("'%s' says more than one thing:\n%s", line, p->err);
    if (!strstr(p->err, text) || strstr(p->err, text) > second)
        fail_msg("'%s' does not say '%s' but:\n%s", line, text, p->err);
    if (hint && !strstr(second, hint))
        fail_msg("'%s' does not hint at '%s':\n%s", line, hint, p->err);
    third = strchr(second + 1, '\n');
    const char *caret = third ? strchr(third, '^') : NULL, *place = at ? strstr(second, at) : NULL;
    if (at && (!caret || caret[1] != '\n' || !place || caret - third != place - second))
        fail_msg("'%s': the caret is not at '%s':\n%s", line, at, p->err);
    process_free(p);
}

#endif
