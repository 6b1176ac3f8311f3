/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "arris_plugin.h"
ARRIS_PLUGIN("calibrate", "LGPL-2.1-or-later", NULL);
