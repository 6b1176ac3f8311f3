/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * options.c: the options of a subcommand (options.h).
 */
#include "options.h"

int options_read(int argc, char **argv, const char *letters, const struct option *table,
                 option_taker *take, void *self, const char *hint, fault *f) {
    int r = 0;
    optind = 0; /* glibc: from the beginning */
    opterr = 0;
    for (int c; r == 0 && (c = getopt_long(argc, argv, letters, table, NULL)) != -1;) {
        if (c == 'h')
            return 1;
        if (c == '?')
            return fault_set(f, ARRIS_E_USAGE, hint, "'%.100s' is no option, or lacks its value",
                             argv[optind - 1]);
        r = take(c, self, f);
    }
    return r;
}
