/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * plugin.c: the plugin "calibrate": the subcommand of that name, and its sink.
 */
#include "arris_plugin.h"

extern const arris_command_desc command_calibrate;
extern const arris_stage_desc stage_calibrate;

static const arris_command_desc *const commands[] = {&command_calibrate, NULL};

ARRIS_PLUGIN_COMMANDS("calibrate", "LGPL-2.1-or-later", commands, &stage_calibrate);
