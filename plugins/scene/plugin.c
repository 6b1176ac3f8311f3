/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * plugin.c: the plugin "scene", which simulates a camera.
 */
#include "arris_plugin.h"

extern const arris_stage_desc stage_scenesrc;

ARRIS_PLUGIN("scene", "LGPL-2.1-or-later", &stage_scenesrc);
