/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * cli.h: the subcommands of `arris`. Each takes its own words, argv[0] its name, and returns the
 * exit code of the process.
 */
#ifndef ARRIS_CLI_H
#define ARRIS_CLI_H

#include "arris.h"

int cli_launch(int argc, char **argv);
int cli_stages(int argc, char **argv);

/* Prints an error to stderr, with the launch line and a caret, and returns its exit code. */
int cli_error(const arris_error *err);

#endif
