/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * plugin.c: the plugin "image", which reads recorded pictures.
 */
#include "arris_plugin.h"

extern const arris_stage_desc stage_imagesrc;

ARRIS_PLUGIN("image", "LGPL-2.1-or-later", &stage_imagesrc);
