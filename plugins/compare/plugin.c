/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * plugin.c: what the plugin `compare` gives.
 */
#include "arris_plugin.h"

extern const arris_stage_desc stage_compare;
extern const arris_command_desc command_inspect;

static const arris_command_desc *const commands[] = {&command_inspect, NULL};

ARRIS_PLUGIN_COMMANDS("compare", "LGPL-2.1-or-later", commands, &stage_compare);
