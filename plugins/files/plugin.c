/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * plugin.c: what files.so holds.
 */
#include "arris_plugin.h"

extern const arris_stage_desc stage_filesink;

ARRIS_PLUGIN("files", "LGPL-2.1-or-later", &stage_filesink);
