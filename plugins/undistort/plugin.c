/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * plugin.c: what undistort.so holds.
 */
#include "arris_plugin.h"

extern const arris_stage_desc stage_undistort;

ARRIS_PLUGIN("undistort", "LGPL-2.1-or-later", &stage_undistort);
