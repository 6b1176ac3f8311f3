/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * plugin.c: what experiments.so holds.
 */
#include "arris_plugin.h"

extern const arris_stage_desc stage_features, stage_tuning;

ARRIS_PLUGIN("experiments", "LGPL-2.1-or-later", &stage_features, &stage_tuning);
