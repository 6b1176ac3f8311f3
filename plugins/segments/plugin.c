/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * plugin.c: what segments.so holds.
 */
#include "arris_plugin.h"

extern const arris_stage_desc stage_segments;

ARRIS_PLUGIN("segments", "LGPL-2.1-or-later", &stage_segments);
