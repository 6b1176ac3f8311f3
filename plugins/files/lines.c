/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * lines.c: which lines are written, and as what.
 */
#include <math.h>

#include "writers.h"

bool all_finite(const double *v, int n) {
    for (int i = 0; i < n; i++)
        if (!isfinite(v[i]))
            return false;
    return true;
}

bool line_stands(const arris_line *l) {
    return l->change != ARRIS_MERGED && l->change != ARRIS_RETIRED && all_finite(l->p, 3) &&
           all_finite(l->q, 3);
}

enum arris_line_state line_state(const arris_line *l) {
    bool sound = all_finite(l->cov, 21) && isfinite(l->baseline) && isfinite(l->rms);
    return l->state == ARRIS_MEASURED && !sound ? ARRIS_WEAK : l->state;
}
