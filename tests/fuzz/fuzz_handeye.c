/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * fuzz_handeye.c: any bytes as a handeye.json.
 */
#include <math.h>
#include <stdlib.h>

#include "handeye.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n) {
    handeye h;
    fault f;
    if (handeye_parse((const char *)data, n, "handeye.json", &h, &f) == 0 &&
        !(fabs(h.q[0]) <= 1 && isfinite(h.t[0])))
        abort();
    return 0;
}
