/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * main.c: the `arris` program: finds the subcommand.
 */
#include <errno.h>
#include <string.h>

#include "cli.h"

static const char help[] =
    "usage: arris launch [--check] [--stats] [--trace FILE] [--dot FILE] [-q] [-v] PIPELINE\n"
    "       arris stages [NAME] [--json]\n"
    "       arris stages NAME --devices\n"
    "       arris COMMAND ...\n"
    "       arris --version | --help\n"
    "\n"
    "PIPELINE is stages with '!' between them, as words or as one quoted string, or a recipe file\n"
    "whose name ends in .arris:\n"
    "\n"
    "  arris launch imagesrc location=scan/frames.csv ! edges ! undistort ! segments ! track \\\n"
    "      ! reconstruct ! filesink location=lines.json\n"
    "\n"
    "  --check       build and check the pipeline, print its graph, run nothing\n"
    "  --stats       print what every stage did when the stream has ended\n"
    "  --trace FILE  write every stage's work on every frame as Chrome trace JSON\n"
    "  --dot FILE    write the graph for Graphviz\n"
    "  -q, -v        say less: errors only; say more\n"
    "\n"
    "Ctrl-C ends the stream and writes the results; a second one aborts.\n"
    "Exit codes: 0 ok or pass, 1 fail, 2 usage or recipe, 3 indeterminate, 4 device or input,\n"
    "5 internal.\n"
    "\n"
    "COMMAND is one that a plugin gives, and has a --help of its own:\n";

int cli_error(const arris_error *err) {
    fputs("arris: ", stderr);
    if (*err->file)
        fprintf(stderr, "%s:%d: ", err->file, err->line_number);
    fprintf(stderr, "%s\n", err->text);
    if (err->column >= 0)
        fprintf(stderr, "  %s\n  %*s^\n", err->line, err->column, "");
    if (*err->hint)
        fprintf(stderr, "  %s\n", err->hint);
    return arris_exit_code(err->code);
}

static int run(int argc, char **argv) {
    const char *command = argc > 1 ? argv[1] : "";
    if (strcmp(command, "launch") == 0)
        return cli_launch(argc - 1, argv + 1);
    if (strcmp(command, "stages") == 0)
        return cli_stages(argc - 1, argv + 1);
    if (strcmp(command, "--version") == 0) {
        printf("arris %s\n", arris_version());
        return 0;
    }
    if (strcmp(command, "--help") == 0 || strcmp(command, "-h") == 0) {
        fputs(help, stdout);
        arris_print_commands(stdout);
        return 0;
    }
    if (!*command) {
        fputs(help, stderr);
        arris_print_commands(stderr);
        return 2;
    }
    arris_error err;
    arris_command c = arris_find_command(command, &err);
    return c ? c(argc - 1, argv + 1) : cli_error(&err);
}

int main(int argc, char **argv) {
    int rc = run(argc, argv);
    if (fflush(stdout) == 0 && !ferror(stdout))
        return rc;
    fprintf(stderr, "arris: cannot write to the standard output: %s\n", strerror(errno));
    return rc ? rc : arris_exit_code(ARRIS_E_IO);
}
