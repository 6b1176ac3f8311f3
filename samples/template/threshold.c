/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * threshold.c: a stage of your own to start from. It makes every pixel from `level` on white and
 * the others black; or, with give=count, leaves the picture alone and only counts them.
 *
 *     make
 *     ARRIS_PLUGIN_PATH=. arris stages threshold
 *     ARRIS_PLUGIN_PATH=. arris launch --stats imagesrc location=PICTURES \
 *         ! threshold level=100 ! fakesink
 *
 * Read it from the top: the private struct, the property table, the callbacks in the order in which
 * they are called, and last the descriptor. What each of them may do is in arris_plugin.h.
 */
#include "arris_plugin.h"

/* What a layer of one's own holds is a matter of the stages that give and read it. */
struct white_count {
    uint64_t white;
};

enum { GIVE_PICTURE, GIVE_COUNT };

/* The host allocates and zeroes it, and stores the properties. */
struct threshold {
    int32_t level, give;
    double least;
};

static const arris_prop props[] = {
    ARRIS_P_INT(struct threshold, level, "level", "128", 0, 65535, "levels",
                "pixels from this grey level on are white"),
    ARRIS_P_ENUM(struct threshold, give, "give", "picture", "picture|count",
                 "the picture in black and white, or only how much is white, as the layer user0"),
    ARRIS_P_DOUBLE(struct threshold, least, "least", "0", 0, 1, NULL,
                   "frames with a smaller share of white are dropped"),
};

static int settle(arris_stage *s, void *self, arris_layers *l) {
    (void)s;
    l->gives = ((struct threshold *)self)->give == GIVE_COUNT ? ARRIS_BIT(ARRIS_USER0)
                                                              : ARRIS_BIT(ARRIS_IMAGE);
    return 0;
}

static int greatest(enum arris_format format) {
    return format == ARRIS_GREY8 ? 255 : 65535;
}

static int setup(arris_stage *s, void *self, arris_caps *caps) {
    const struct threshold *t = self;
    if (t->level > greatest(caps->format))
        return arris_fail(s, ARRIS_E_USAGE, "choose a lower level",
                          "level=%d is above %d, the greatest grey level of these pictures",
                          t->level, greatest(caps->format));
    return t->give == GIVE_COUNT ? arris_reserve(s, ARRIS_USER0, sizeof(struct white_count), 0)
                                 : arris_reserve(s, ARRIS_IMAGE, 0, 0);
}

static int grey(const arris_image *im, int x, int y) {
    const uint8_t *row = im->data + y * im->stride;
    return im->format == ARRIS_GREY8 ? row[x] : ((const uint16_t *)row)[x];
}

static void set_grey(const arris_image *im, int x, int y, int value) {
    uint8_t *row = im->data + y * im->stride;
    if (im->format == ARRIS_GREY8)
        row[x] = (uint8_t)value;
    else
        ((uint16_t *)row)[x] = (uint16_t)value;
}

/* The kernel. Writes black and white to `out` unless that is NULL; returns how much is white. */
static uint64_t binarise(const arris_image *in, const arris_image *out, int level) {
    uint64_t white = 0;
    for (int y = 0; y < in->height; y++)
        for (int x = 0; x < in->width; x++) {
            bool is_white = grey(in, x, y) >= level;
            white += is_white;
            if (out)
                set_grey(out, x, y, is_white ? greatest(in->format) : 0);
        }
    return white;
}

/* Allocates nothing: what it gives was reserved in setup. */
static int process(arris_stage *s, void *self, arris_frame *f) {
    const struct threshold *t = self;
    const arris_image *in = arris_layer_get(f, ARRIS_IMAGE);
    const arris_image *out = NULL;
    struct white_count *count = NULL;
    if (t->give == GIVE_COUNT)
        count = arris_layer_give(s, f, ARRIS_USER0);
    else
        out = arris_layer_give(s, f, ARRIS_IMAGE); /* `in` stays readable until we return */
    uint64_t white = binarise(in, out, t->level);
    if (count)
        count->white = white;
    arris_count(s, "white pixels", white);
    double share = (double)white / ((double)in->width * in->height);
    return share < t->least ? ARRIS_DROP : 0;
}

static const arris_stage_desc stage = {
    .size = sizeof(arris_stage_desc),
    .name = "threshold",
    .summary = "a picture in black and white",
    .example = "imagesrc location=frames.csv ! threshold level=100 ! fakesink",
    .layers = {.needs = ARRIS_BIT(ARRIS_IMAGE),
               .gives = ARRIS_BIT(ARRIS_IMAGE) | ARRIS_BIT(ARRIS_USER0)},
    .self_size = sizeof(struct threshold),
    .props = props,
    .n_props = sizeof props / sizeof *props,
    .settle = settle,
    .setup = setup,
    .process = process,
};

ARRIS_PLUGIN("threshold", "LGPL-2.1-or-later", &stage);
