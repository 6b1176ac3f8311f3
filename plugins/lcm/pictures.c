/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * pictures.c: the pictures that come in over LCM (pictures.h).
 */
#include "pictures.h"

#include <stdlib.h>
#include <string.h>

void pictures_begin(pictures *p) {
    *p = (pictures){.last = -1};
}

void pictures_free(pictures *p) {
    for (int i = 0; i < PICTURES_ROOM; i++)
        free(p->slot[i].data);
    pictures_begin(p);
}

static enum arris_format format_of(const arris_image_t *m) {
    return m->pixelformat == ARRIS_IMAGE_T_PIXEL_FORMAT_GRAY ? ARRIS_GREY8 : ARRIS_GREY16;
}

bool pictures_settle(pictures *p, int32_t width, int32_t height, enum arris_format format) {
    size_t bytes = (size_t)width * (size_t)height * format;
    for (int i = 0; i < PICTURES_ROOM; i++)
        if (!p->slot[i].data && !(p->slot[i].data = malloc(bytes)))
            return false;
    p->width = width;
    p->height = height;
    p->format = format;
    return true;
}

static bool is_alike(const pictures *p, const arris_image_t *m) {
    return m->width == p->width && m->height == p->height && format_of(m) == p->format;
}

static void keep(pictures *p, const arris_image_t *m, int64_t index, int64_t now) {
    if (p->n == PICTURES_ROOM) {
        p->next = (p->next + 1) % PICTURES_ROOM;
        p->n--;
        p->overrun++;
    }
    picture_slot *s = &p->slot[(p->next + p->n++) % PICTURES_ROOM];
    for (int32_t y = 0; y < p->height; y++)
        memcpy(s->data + (size_t)y * pictures_row(p), m->data + (size_t)y * (size_t)m->row_stride,
               pictures_row(p));
    if (p->last >= 0 && index > p->last)
        p->missing += (uint64_t)(index - p->last - 1);
    p->last = index;
    s->index = index >= 0 ? index : p->count;
    s->utime = m->utime;
    s->arrival = now;
    p->count++;
    p->heard = now;
}

void pictures_receive(pictures *p, const void *data, size_t n, int64_t now) {
    arris_image_t m;
    int64_t index;
    if (image_read(data, n, &m, &index))
        p->malformed++;
    else if (p->format ? !is_alike(p, &m) : !pictures_settle(p, m.width, m.height, format_of(&m)))
        p->other++;
    else
        keep(p, &m, index, now);
}

bool pictures_settle_by(pictures *p, const void *data, size_t n) {
    arris_image_t m;
    int64_t index;
    return image_read(data, n, &m, &index) == 0 &&
           pictures_settle(p, m.width, m.height, format_of(&m));
}

const picture_slot *pictures_take(pictures *p) {
    if (!p->n)
        return NULL;
    const picture_slot *s = &p->slot[p->next];
    p->next = (p->next + 1) % PICTURES_ROOM;
    p->n--;
    return s;
}
