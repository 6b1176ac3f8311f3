/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * outbox.c: encodes and sends (outbox.h).
 */
#include "outbox.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lcmtypes/arris_lines_t.h"
#include "lcmtypes/arris_preview_t.h"
#include "lcmtypes/arris_segments_t.h"
#include "lcmtypes/arris_status_t.h"
#include "lcmtypes/arris_verdict_t.h"
#include "messages.h"

enum {
    LINES = 200,     /* of a message: 246 bytes each */
    SEGMENTS = 2000, /* of a message: 24 bytes each */
    FEATURES = 100,  /* of a message: 420 bytes each at most */
    EXTRA = 2000,    /* lines, of a verdict */
    COUNTERS = 64,   /* of a status */
    PREVIEW = 56000, /* pixels */
    HEAD = 500,      /* bytes of an image's message that are not its data */
    REASON = 200,    /* characters */
    NAME = 64
};

enum { TO_LINES, TO_SEGMENTS, TO_VERDICT, TO_STATUS, TO_PREVIEW, TO_IMAGE, CHANNELS };
static const char *const names[CHANNELS] = {"LINES",  "SEGMENTS", "VERDICT",
                                            "STATUS", "PREVIEW",  "IMAGE"};

/* The arrays of a message of lines; of those with two dimensions lcm-gen wants pointers to the
 * rows.
 */
typedef struct line_arrays {
    int32_t id[LINES], into[LINES], views[LINES];
    int8_t change[LINES], state[LINES];
    double p[LINES][3], q[LINES][3], cov[LINES][21], baseline[LINES], rms_px[LINES];
    double *p_row[LINES], *q_row[LINES], *cov_row[LINES];
} line_arrays;

typedef struct segment_arrays {
    float ends[SEGMENTS][4], *ends_row[SEGMENTS], sigma_px[SEGMENTS];
    int32_t track[SEGMENTS];
} segment_arrays;

struct outbox {
    lcm_link *link;
    int64_t scan;
    char channel[CHANNELS][NAME];
    int32_t seq[CHANNELS], line_set, verdict_set;

    line_arrays lines;
    segment_arrays segments;
    int32_t *track_of; /* by segment */
    size_t max_segments;
    arris_verdict_feature_t features[FEATURES];
    char reasons[FEATURES][REASON];
    arris_status_counter_t counters[COUNTERS];
    uint8_t small[PREVIEW];
    uint8_t buffer[MESSAGE_MAX], status[MESSAGE_MAX]; /* the status is sent by another thread */
    uint8_t *image, *rows; /* an image's message, and its data before it is encoded */
    size_t max_image;
};

/* As in messages.c, for what is only sent. */
__attribute__((constructor)) static void compute_fingerprints(void) {
    __arris_lines_t_get_hash();
    __arris_segments_t_get_hash();
    __arris_verdict_t_get_hash();
    __arris_status_t_get_hash();
    __arris_preview_t_get_hash();
}

static void point_at_rows(outbox *o) {
    for (int i = 0; i < LINES; i++) {
        o->lines.p_row[i] = o->lines.p[i];
        o->lines.q_row[i] = o->lines.q[i];
        o->lines.cov_row[i] = o->lines.cov[i];
    }
    for (int i = 0; i < SEGMENTS; i++)
        o->segments.ends_row[i] = o->segments.ends[i];
}

outbox *outbox_new(lcm_link *link, const char *prefix, const arris_caps *caps, size_t segments,
                   fault *f) {
    outbox *o = calloc(1, sizeof *o);
    size_t data = (size_t)caps->width * (size_t)caps->height * caps->format;
    if (!o || !(o->track_of = malloc((segments + 1) * sizeof *o->track_of)) ||
        !(o->image = malloc(data + HEAD)) || !(o->rows = malloc(data + 1))) {
        fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for LCM messages");
        outbox_free(o);
        return NULL;
    }
    point_at_rows(o);
    o->link = link;
    o->scan = link_utime();
    o->max_segments = segments;
    o->max_image = data + HEAD;
    for (int i = 0; i < CHANNELS; i++) {
        int n = snprintf(o->channel[i], NAME, "%s%s", prefix, names[i]);
        if (n < NAME && link_check_channel(o->channel[i], f) == 0)
            continue;
        fault_set(f, ARRIS_E_USAGE, "some letters, digits, '_' or '-'",
                  "prefix=%s makes no names of channels", prefix);
        outbox_free(o);
        return NULL;
    }
    return o;
}

void outbox_free(outbox *o) {
    if (!o)
        return;
    free(o->track_of);
    free(o->image);
    free(o->rows);
    free(o);
}

/* Sends n bytes, the result of an encoder. */
static int post(outbox *o, int to, const uint8_t *data, int n) {
    o->seq[to]++;
    return n < 0 ? ARRIS_E_IO : link_publish(o->link, o->channel[to], data, (size_t)n);
}

/* The generated structs have no const. */
static char *text(const char *s) {
    return (char *)(uintptr_t)s;
}

/* Messages for n items; an empty set is one message too. */
static int32_t parts_for(uint32_t n, uint32_t each) {
    return n ? (int32_t)((n + each - 1) / each) : 1;
}

/* ---- lines ----------------------------------------------------------------------------------- */

static void put_line(line_arrays *a, int32_t i, const book_line *b) {
    const arris_line *l = &b->l;
    a->id[i] = l->id;
    a->change[i] = (int8_t)b->pending;
    a->into[i] = l->into;
    memcpy(a->p[i], l->p, sizeof l->p);
    memcpy(a->q[i], l->q, sizeof l->q);
    memcpy(a->cov[i], l->cov, sizeof l->cov);
    a->views[i] = (int32_t)l->views;
    a->baseline[i] = l->baseline;
    a->rms_px[i] = l->rms;
    a->state[i] = (int8_t)l->state;
}

/* The next part's lines, from *at of the book on. Returns how many. */
static int32_t put_part(line_arrays *a, const book *b, bool changes, uint32_t *at) {
    int32_t n = 0;
    for (; *at < b->n && n < LINES; ++*at) {
        const book_line *l = &b->item[*at];
        if (changes ? l->pending != ARRIS_SAME : !book_gone(l))
            put_line(a, n++, l);
    }
    return n;
}

int outbox_lines(outbox *o, const stamp *s, int8_t kind, const book *b, const arris_lines *lines) {
    line_arrays *a = &o->lines;
    bool changes = kind == ARRIS_LINES_T_CHANGES;
    uint32_t total = book_total(b), at = 0;
    arris_lines_t m = {.utime = s->utime,
                       .scan = o->scan,
                       .frame = s->frame,
                       .set = o->line_set++,
                       .parts = parts_for(changes ? book_pending(b) : total, LINES),
                       .kind = kind,
                       .total = (int32_t)total,
                       .frames = (int32_t)lines->frames,
                       .scale_sigma = lines->scale_sigma,
                       .pose_sigma = lines->pose_sigma,
                       .id = a->id,
                       .change = a->change,
                       .into = a->into,
                       .p = a->p_row,
                       .q = a->q_row,
                       .cov = a->cov_row,
                       .views = a->views,
                       .baseline = a->baseline,
                       .rms_px = a->rms_px,
                       .state = a->state};
    int rc = 0;
    for (; m.part < m.parts && rc == 0; m.part++) {
        m.seq = o->seq[TO_LINES];
        m.n = put_part(a, b, changes, &at);
        rc = post(o, TO_LINES, o->buffer, arris_lines_t_encode(o->buffer, 0, sizeof o->buffer, &m));
    }
    return rc;
}

/* ---- segments -------------------------------------------------------------------------------- */

static void find_tracks(outbox *o, const arris_tracks *tracks, uint32_t n) {
    for (uint32_t i = 0; i < n; i++)
        o->track_of[i] = -1;
    for (uint32_t i = 0; tracks && i < tracks->n; i++)
        if (tracks->item[i].segment >= 0 && (uint32_t)tracks->item[i].segment < n)
            o->track_of[tracks->item[i].segment] = tracks->item[i].id;
}

int outbox_segments(outbox *o, const stamp *s, const arris_segments *segments,
                    const arris_tracks *tracks) {
    segment_arrays *a = &o->segments;
    uint32_t all = segments->n < o->max_segments ? segments->n : (uint32_t)o->max_segments;
    arris_segments_t m = {.utime = s->utime,
                          .scan = o->scan,
                          .frame = s->frame,
                          .parts = parts_for(all, SEGMENTS),
                          .ends = a->ends_row,
                          .sigma_px = a->sigma_px,
                          .track = a->track};
    int rc = 0;
    find_tracks(o, tracks, all);
    for (uint32_t i = 0; m.part < m.parts && rc == 0; m.part++) {
        m.seq = o->seq[TO_SEGMENTS];
        for (m.n = 0; i < all && m.n < SEGMENTS; i++, m.n++) {
            const arris_segment *g = &segments->item[i];
            const float ends[4] = {(float)g->x1, (float)g->y1, (float)g->x2, (float)g->y2};
            memcpy(a->ends[m.n], ends, sizeof ends);
            a->sigma_px[m.n] = (float)sqrt(g->cov[0]);
            a->track[m.n] = o->track_of[i];
        }
        rc = post(o, TO_SEGMENTS, o->buffer,
                  arris_segments_t_encode(o->buffer, 0, sizeof o->buffer, &m));
    }
    return rc;
}

/* ---- the verdict ----------------------------------------------------------------------------- */

static void put_feature(arris_verdict_feature_t *m, char reason[REASON], const arris_feature *f) {
    snprintf(reason, REASON, "%s", f->reason ? f->reason : "");
    *m = (arris_verdict_feature_t){.id = text(f->id),
                                   .is_angle = f->is_angle,
                                   .verdict = (int8_t)f->verdict,
                                   .deviation = f->deviation,
                                   .U = f->U,
                                   .worst = f->worst,
                                   .worst_U = f->worst_U,
                                   .straightness = f->straightness,
                                   .tolerance = f->tolerance,
                                   .line = f->line,
                                   .reason = reason};
    memcpy(m->p, f->p, sizeof m->p);
    memcpy(m->q, f->q, sizeof m->q);
    memcpy(m->at, f->at, sizeof m->at);
}

int outbox_verdict(outbox *o, const stamp *s, const arris_verdict *v, bool final) {
    arris_verdict_t m = {.utime = s->utime,
                         .scan = o->scan,
                         .frame = s->frame,
                         .set = o->verdict_set++,
                         .parts = parts_for(v->n, FEATURES),
                         .final = final,
                         .verdict = (int8_t)v->verdict,
                         .tolerance = v->tolerance,
                         .coverage_factor = v->coverage_factor,
                         .model = text(v->model),
                         .calibration = text(v->calibration),
                         .recipe = text(""),
                         .total = (int32_t)v->n,
                         .feature = o->features,
                         .n_extra = (int32_t)(v->n_extra < EXTRA ? v->n_extra : EXTRA),
                         .extra = v->extra};
    int rc = 0;
    for (uint32_t i = 0; m.part < m.parts && rc == 0; m.part++, m.n_extra = 0) {
        m.seq = o->seq[TO_VERDICT];
        for (m.n = 0; i < v->n && m.n < FEATURES; i++, m.n++)
            put_feature(&o->features[m.n], o->reasons[m.n], &v->item[i]);
        rc = post(o, TO_VERDICT, o->buffer,
                  arris_verdict_t_encode(o->buffer, 0, sizeof o->buffer, &m));
    }
    return rc;
}

/* ---- pictures -------------------------------------------------------------------------------- */

int outbox_image(outbox *o, const stamp *s, const arris_image *image) {
    size_t row = (size_t)image->width * image->format;
    uint8_t number[8];
    for (int i = 0; i < 8; i++)
        number[i] = (uint8_t)((uint64_t)s->frame >> (56 - 8 * i));
    for (int32_t y = 0; y < image->height; y++)
        memcpy(o->rows + (size_t)y * row, image->data + y * image->stride, row);
    arris_image_metadata_t seq = {.key = (char[]){"seq"}, .n = 8, .value = number};
    arris_image_t m = {.utime = s->utime,
                       .width = image->width,
                       .height = image->height,
                       .row_stride = (int32_t)row,
                       .pixelformat = image->format == ARRIS_GREY8
                                          ? ARRIS_IMAGE_T_PIXEL_FORMAT_GRAY
                                          : ARRIS_IMAGE_T_PIXEL_FORMAT_LE_GRAY16,
                       .size = (int32_t)(row * (size_t)image->height),
                       .data = o->rows,
                       .nmetadata = 1,
                       .metadata = &seq};
    return post(o, TO_IMAGE, o->image, arris_image_t_encode(o->image, 0, (int)o->max_image, &m));
}

/* The mean of k x k pixels, its upper 8 bits when they have 16. */
static uint8_t mean_of(const arris_image *image, int32_t x, int32_t y, int32_t k) {
    uint64_t sum = 0;
    for (int32_t j = y * k; j < (y + 1) * k; j++)
        for (int32_t i = x * k; i < (x + 1) * k; i++) {
            const uint8_t *at = image->data + j * image->stride + i * (int)image->format;
            uint16_t wide = 0;
            memcpy(&wide, at, image->format);
            sum += image->format == ARRIS_GREY8 ? *at : wide >> 8;
        }
    return (uint8_t)(sum / (uint64_t)(k * k));
}

int outbox_preview(outbox *o, const stamp *s, const arris_image *image) {
    int32_t k = 1;
    while ((int64_t)(image->width / k) * (image->height / k) > PREVIEW)
        k++;
    int32_t w = image->width / k, h = image->height / k;
    for (int32_t y = 0; y < h; y++)
        for (int32_t x = 0; x < w; x++)
            o->small[y * w + x] = mean_of(image, x, y, k);
    arris_preview_t m = {.utime = s->utime,
                         .width = w,
                         .height = h,
                         .row_stride = w,
                         .pixelformat = ARRIS_IMAGE_T_PIXEL_FORMAT_GRAY,
                         .size = w * h,
                         .data = o->small};
    return post(o, TO_PREVIEW, o->buffer,
                arris_preview_t_encode(o->buffer, 0, sizeof o->buffer, &m));
}

/* ---- status ---------------------------------------------------------------------------------- */

typedef struct counters {
    arris_status_counter_t *item;
    int32_t n;
} counters;

static void add_counter(void *user, const char *stage, const char *name, uint64_t n) {
    counters *c = user;
    if (c->n < COUNTERS)
        c->item[c->n++] = (arris_status_counter_t){text(stage), text(name), (int64_t)n};
}

int outbox_status(outbox *o, const arris_stage *stage, const char *pipeline, double fps,
                  bool ended) {
    arris_progress p = arris_stage_progress(stage);
    counters c = {.item = o->counters};
    char trouble[200] = "";
    arris_each_counter(stage, add_counter, &c);
    if (p.trouble)
        snprintf(trouble, sizeof trouble, "%s: %s", p.troubled, p.trouble);
    arris_status_t m = {.utime = link_utime(),
                        .seq = o->seq[TO_STATUS],
                        .scan = o->scan,
                        .pipeline = text(pipeline),
                        .state = ended       ? ARRIS_STATUS_T_ENDED
                                 : p.trouble ? ARRIS_STATUS_T_TROUBLED
                                             : ARRIS_STATUS_T_RUNNING,
                        .trouble = trouble,
                        .seconds = p.seconds,
                        .fps = fps,
                        .frames = (int64_t)p.frames,
                        .dropped = (int64_t)p.dropped,
                        .lines = (int32_t)p.lines,
                        .latency_p50 = p.p50,
                        .latency_p99 = p.p99,
                        .n = c.n,
                        .counter = c.item};
    return post(o, TO_STATUS, o->status, arris_status_t_encode(o->status, 0, sizeof o->status, &m));
}
