/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * fuzz_picture.c: any bytes as an image_t, to what `lcmsrc` makes of them.
 */
#include "lcm/pictures.h"
#include "message.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n) {
    pictures p;
    uint8_t *m = message_of(__arris_image_t_get_hash(), data, n);
    pictures_begin(&p);
    pictures_receive(&p, m, n + 8, 1);
    const picture_slot *s = pictures_take(&p);
    volatile uint8_t last = s ? s->data[pictures_row(&p) * (size_t)p.height - 1] : 0;
    (void)last;
    pictures_free(&p);
    free(m);
    return 0;
}
