/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * plugin.c: what edges.so holds.
 */
#include "arris_plugin.h"

extern const arris_stage_desc stage_edges;

ARRIS_PLUGIN("edges", "LGPL-2.1-or-later", &stage_edges);
