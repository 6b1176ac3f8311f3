/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * stages.c: `arris stages [NAME] [--json]`, `arris stages NAME --devices`.
 */
#include <string.h>

#include "cli.h"

int cli_stages(int argc, char **argv) {
    const char *name = NULL;
    bool json = false, devices = false;
    for (int i = 1; i < argc; i++) {
        if (strcmp(argv[i], "--json") == 0) {
            json = true;
        } else if (strcmp(argv[i], "--devices") == 0) {
            devices = true;
        } else if (argv[i][0] == '-' || name) {
            fprintf(stderr,
                    "arris stages: '%s' is not expected; usage: arris stages [NAME] [--json | "
                    "--devices]\n",
                    argv[i]);
            return 2;
        } else {
            name = argv[i];
        }
    }
    arris_error err;
    if (devices && (!name || json)) {
        fputs("arris stages: --devices needs the name of a stage, and only that\n", stderr);
        return 2;
    }
    if (devices)
        return arris_print_devices(name, stdout, &err) ? cli_error(&err) : 0;
    if (name && arris_print_stage(name, stdout, json, &err))
        return cli_error(&err);
    if (!name)
        arris_print_stages(stdout, json);
    return 0;
}
