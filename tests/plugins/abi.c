/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * abi.c: a plugin as built for an ABI to come.
 */
#include "arris_plugin.h"

static const arris_stage_desc *const stages[] = {NULL};

ARRIS_EXPORT const arris_plugin_desc arris_plugin;
const arris_plugin_desc arris_plugin = {sizeof(arris_plugin_desc), ARRIS_ABI + 1, "abi",
                                        "LGPL-2.1-or-later",       stages,        NULL};
