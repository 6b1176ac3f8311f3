/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * options.h: the options of a subcommand.
 */
#ifndef OPTIONS_H
#define OPTIONS_H

#include <getopt.h>

#include "fault.h"

/* Takes an option, `c` as getopt_long returns it, its value in optarg. 0 or an error. */
typedef int option_taker(int c, void *self, fault *f);

/* Reads the options of `letters` (-h among them) and `table`, as getopt_long has them, up to the
 * first error. `hint` says where help is. Returns 0, then optind is the first operand; 1, the help
 * was asked for; or an error. One thread at a time. */
int options_read(int argc, char **argv, const char *letters, const struct option *table,
                 option_taker *take, void *self, const char *hint, fault *f);

#endif
