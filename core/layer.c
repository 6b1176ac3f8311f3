/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * layer.c: the layers' names, and how each lies in one buffer: its struct first, then its arrays.
 */
#include <string.h>

#include "internal.h"

const char *layer_name(enum arris_layer layer) {
    static const char *const names[] = {
#define X(NAME, name, type, what) [ARRIS_##NAME] = name,
        ARRIS_LAYERS(X)
#undef X
            [ARRIS_USER0] = "user0",
        "user1",
        "user2",
        "user3",
        "user4",
        "user5",
        "user6",
        "user7"};
    return layer < COUNT(names) && names[layer] ? names[layer] : "unknown";
}

void layer_names(uint32_t set, char *text, size_t size) {
    size_t at = 0;
    snprintf(text, size, "nothing");
    for (unsigned i = 0; i < ARRIS_MAX_LAYERS && at < size; i++)
        if (set & ARRIS_BIT(i))
            at += (size_t)snprintf(text + at, size - at, "%s%s", at ? ", " : "", layer_name(i));
}

static size_t up64(size_t n) {
    return (n + 63) / 64 * 64;
}

static size_t stride_of(const arris_caps *c) {
    return up64((size_t)c->width * c->format);
}

static size_t flow_plane(const arris_caps *c, size_t item) {
    return up64((size_t)c->width * (size_t)c->height * item);
}

static void init_flow(arris_flow *f, char *planes, const arris_caps *c) {
    *f = (arris_flow){.width = c->width, .height = c->height};
    f->u = (float *)(void *)planes;
    f->v = (float *)(void *)(planes + flow_plane(c, sizeof(float)));
    f->grey_u = (uint8_t *)planes + 2 * flow_plane(c, sizeof(float));
    f->grey_v = f->grey_u + flow_plane(c, 1);
}

/* The two arrays of a layer: bytes per item of each. */
static void items(enum arris_layer layer, size_t *a, size_t *b) {
    *a = layer == ARRIS_EDGES      ? sizeof(arris_edge_point)
         : layer == ARRIS_SEGMENTS ? sizeof(arris_segment)
         : layer == ARRIS_TRACKS   ? sizeof(arris_track)
         : layer == ARRIS_LINES    ? sizeof(arris_line)
         : layer == ARRIS_CORNERS  ? sizeof(arris_corner)
         : layer == ARRIS_VERDICT  ? sizeof(arris_feature)
         : layer == ARRIS_GUIDE    ? sizeof(arris_foreseen)
         : layer >= ARRIS_USER0    ? 1
                                   : 0;
    *b = layer == ARRIS_EDGES ? sizeof(arris_chain) : layer == ARRIS_VERDICT ? sizeof(int32_t) : 0;
}

static size_t head_size(enum arris_layer layer) {
    switch (layer) {
#define X(NAME, name, type, what)                                                                  \
    case ARRIS_##NAME:                                                                             \
        return up64(sizeof(type));
        ARRIS_LAYERS(X)
#undef X
    default:
        return 0;
    }
}

size_t layer_size(enum arris_layer layer, const arris_caps *caps, size_t n, size_t m) {
    enum { MOST = 1 << 30 };
    size_t a, b;
    items(layer, &a, &b);
    if (layer == ARRIS_IMAGE)
        return head_size(layer) + stride_of(caps) * (size_t)caps->height + 64;
    if (layer == ARRIS_FLOW)
        return head_size(layer) + 2 * flow_plane(caps, sizeof(float)) + 2 * flow_plane(caps, 1);
    if (n > MOST || m > MOST)
        return 0;
    return head_size(layer) + up64(a * n) + up64(b * m) + 64;
}

void layer_init(enum arris_layer layer, void *data, const arris_caps *caps, size_t n, size_t m) {
    size_t a, b;
    items(layer, &a, &b);
    char *array = (char *)data + head_size(layer);
    switch (layer) {
    case ARRIS_IMAGE:
        *(arris_image *)data =
            (arris_image){caps->format, caps->width,     caps->height, (ptrdiff_t)stride_of(caps),
                          caps->camera, (uint8_t *)array};
        break;
    case ARRIS_EDGES:
        *(arris_edges *)data = (arris_edges){.max = (uint32_t)n,
                                             .max_chains = (uint32_t)m,
                                             .point = (void *)array,
                                             .chain = (void *)(array + up64(a * n))};
        break;
    case ARRIS_SEGMENTS:
        *(arris_segments *)data = (arris_segments){.max = (uint32_t)n, .item = (void *)array};
        break;
    case ARRIS_TRACKS:
        *(arris_tracks *)data = (arris_tracks){.max = (uint32_t)n, .item = (void *)array};
        break;
    case ARRIS_LINES:
        *(arris_lines *)data = (arris_lines){.max = (uint32_t)n, .item = (void *)array};
        break;
    case ARRIS_CORNERS:
        *(arris_corners *)data = (arris_corners){.max = (uint32_t)n, .item = (void *)array};
        break;
    case ARRIS_GUIDE:
        *(arris_guide *)data = (arris_guide){.max = (uint32_t)n, .item = (void *)array};
        break;
    case ARRIS_FLOW:
        init_flow(data, array, caps);
        break;
    case ARRIS_VERDICT:
        *(arris_verdict *)data = (arris_verdict){.max = (uint32_t)n,
                                                 .max_extra = (uint32_t)m,
                                                 .item = (void *)array,
                                                 .extra = (void *)(array + up64(a * n))};
        break;
    default:
        break;
    }
}

void layer_reset(enum arris_layer layer, void *data) {
    switch (layer) {
    case ARRIS_IMAGE: { /* its giver may have let it point elsewhere */
        arris_image *i = data;
        i->stride = (ptrdiff_t)up64((size_t)i->width * i->format);
        i->data = (uint8_t *)data + head_size(layer);
        break;
    }
    case ARRIS_POSE:
        *(arris_pose *)data = (arris_pose){0};
        break;
    case ARRIS_EDGES: {
        arris_edges *e = data;
        e->n = e->lost = e->n_chains = e->lost_chains = 0;
        e->camera = NULL;
        e->noise = 0;
        break;
    }
    case ARRIS_SEGMENTS: {
        arris_segments *s = data;
        *s = (arris_segments){.max = s->max, .item = s->item};
        break;
    }
    case ARRIS_TRACKS: {
        arris_tracks *t = data;
        *t = (arris_tracks){.max = t->max, .item = t->item};
        break;
    }
    case ARRIS_LINES: {
        arris_lines *l = data;
        *l = (arris_lines){.max = l->max, .item = l->item};
        break;
    }
    case ARRIS_CORNERS: {
        arris_corners *c = data;
        *c = (arris_corners){.max = c->max, .item = c->item};
        break;
    }
    case ARRIS_GUIDE: {
        arris_guide *g = data;
        *g = (arris_guide){.max = g->max, .item = g->item};
        break;
    }
    case ARRIS_FLOW:
        ((arris_flow *)data)->valid = false;
        break;
    case ARRIS_VERDICT: {
        arris_verdict *v = data;
        *v = (arris_verdict){
            .max = v->max, .max_extra = v->max_extra, .item = v->item, .extra = v->extra};
        break;
    }
    default:
        break;
    }
}
