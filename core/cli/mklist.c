/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * mklist.c: used by the build: prints the list of a plugin's stages and subcommands that stands
 * beside it.
 */
#include <dlfcn.h>
#include <stdio.h>

#include "arris_plugin.h"

int main(int argc, char **argv) {
    void *so = argc == 2 ? dlopen(argv[1], RTLD_NOW) : NULL;
    const arris_plugin_desc *d = so ? dlsym(so, "arris_plugin") : NULL;
    if (!d) {
        fprintf(stderr, "mklist: %s\n", argc == 2 ? dlerror() : "usage: mklist PLUGIN.so");
        return 1;
    }
    for (size_t i = 0; d->stages[i]; i++)
        printf("stage %s\n", d->stages[i]->name);
    for (size_t i = 0; d->commands && d->commands[i]; i++)
        printf("command %s\n", d->commands[i]->name);
    return 0;
}
