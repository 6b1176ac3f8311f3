/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * plugin.c: the plugin "lcm": the pipeline's side of the messages to and from LCM.
 */
#include "arris_plugin.h"

extern const arris_stage_desc stage_lcmsink, stage_lcmsrc, stage_pose;

ARRIS_PLUGIN("lcm", "LGPL-2.1-or-later", &stage_lcmsink, &stage_lcmsrc, &stage_pose);
