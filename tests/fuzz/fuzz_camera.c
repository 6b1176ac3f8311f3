/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * fuzz_camera.c: any bytes as a camera.json.
 */
#include <stdlib.h>

#include "arris_geometry.h"
#include "camera.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n) {
    arris_camera c;
    fault f;
    int r = camera_parse((const char *)data, n, "camera.json", &c, &f);
    if (r == 0 && arris_camera_check(&c))
        abort();
    return 0;
}
