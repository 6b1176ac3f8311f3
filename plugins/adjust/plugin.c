/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * plugin.c: the plugin "adjust": the stage and the subcommand of that name.
 */
#include "arris_plugin.h"

extern const arris_command_desc command_adjust;
extern const arris_stage_desc stage_adjust;

static const arris_command_desc *const commands[] = {&command_adjust, NULL};

ARRIS_PLUGIN_COMMANDS("adjust", "LGPL-2.1-or-later", commands, &stage_adjust);
