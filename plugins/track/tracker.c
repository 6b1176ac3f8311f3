/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * tracker.c: the tracks (tracker.h): forecasts and segments are paired, the likeliest first, so
 * that each pair is mutually best among what is left.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "tracks.h"

enum {
    RIVALS = 8,       /* segments that a track chooses from */
    ESTABLISHED = 10, /* sightings after which a track is no accident */
    PATIENCE = 5      /* times as many frames as it was seen in it is remembered */
};
static const double ASLEEP = 4;    /* the cost of waking a track */
static const double CLEARLY = 1.1; /* how much better the picture must explain than the poses */

tracker *tracker_new(const tracker_params *p) {
    tracker *t = calloc(1, sizeof *t);
    if (!t)
        return NULL;
    size_t n = (size_t)p->max_tracks;
    t->p = *p;
    t->scene = (depths){.least = 1 / p->far, .most = 1 / p->near};
    t->scene.mean = (t->scene.most + t->scene.least) / 2;
    t->scene.sigma = (t->scene.most - t->scene.least) / 2;
    t->scene_age = -1;
    t->track = calloc(n, sizeof *t->track);
    t->known = calloc(n, sizeof *t->known);
    t->taken = calloc(n, sizeof *t->taken);
    t->pair = calloc(RIVALS * n, sizeof *t->pair);
    t->index = index_new(n);
    if (t->track && t->known && t->taken && t->pair && t->index)
        return t;
    tracker_free(t);
    return NULL;
}

void tracker_free(tracker *t) {
    if (!t)
        return;
    free(t->track);
    free(t->known);
    free(t->taken);
    free(t->pair);
    index_free(t->index);
    free(t);
}

void tracker_foresee(tracker *t, int32_t line, const forecast *f, double depth) {
    if (t->n_known == t->p.max_tracks || line < 0 || line >= t->total)
        return;
    t->known[t->n_known++] = (known){.id = line, .depth = depth, .visible = f != NULL};
    if (f)
        t->known[t->n_known - 1].f = *f;
}

bool asleep(const tracker *t, const track *k) {
    return k->gap > t->p.max_gap;
}

void tracker_merge(tracker *t, int32_t line, int32_t into) {
    for (int32_t i = 0; i < t->n; i++)
        if (t->track[i].line == line)
            t->track[i].line = into;
}

double explained(tracker *t, const forecast *f) {
    uint32_t n;
    double least = 1, reach = forecast_reach(f);
    const uint32_t *near = index_near(t->index, &f->where, reach, &n);
    for (uint32_t i = 0; i < n; i++)
        if (forecast_near(f, &t->in[near[i]], reach))
            least = fmin(least, forecast_misfit(f, &t->in[near[i]]));
    return 1 - least;
}

/* ---- pairs ---------------------------------------------------------------------------------- */

/* Keeps the pair when it is one of the likeliest of its track, the pairs from `first` on. */
static void note(tracker *t, size_t first, const pair *p) {
    if (t->n_pairs < first + RIVALS) {
        t->pair[t->n_pairs++] = *p;
        return;
    }
    pair *worst = &t->pair[first];
    for (size_t k = first + 1; k < t->n_pairs; k++)
        if (t->pair[k].cost > worst->cost)
            worst = &t->pair[k];
    if (p->cost < worst->cost)
        *worst = *p;
}

/* Pairs the track with segments; returns how well one of them explains its forecast. */
static double find_pairs(tracker *t, int32_t number) {
    const forecast *f = &t->track[number].next;
    bool sleeps = asleep(t, &t->track[number]);
    double reach = forecast_reach(f), handicap = sleeps ? ASLEEP : 0, least = 1;
    if (sleeps && (f->box > 0 || reach > t->p.box))
        return 0;
    uint32_t n;
    const uint32_t *near = index_near(t->index, &f->where, reach, &n);
    size_t first = t->n_pairs;
    for (uint32_t i = 0; i < n; i++) {
        double off;
        if (!forecast_near(f, &t->in[near[i]], reach))
            continue;
        pair p = {forecast_cost(f, &t->in[near[i]], &off) + handicap, number, (int32_t)near[i]};
        if (p.cost < (double)INFINITY) {
            note(t, first, &p);
            least = fmin(least, off);
        }
    }
    return 1 - least;
}

static bool likelier(const pair *p, const pair *q) {
    if (p->cost != q->cost)
        return p->cost < q->cost;
    return p->track != q->track ? p->track < q->track : p->segment < q->segment;
}

/* The likeliest first (Shell, 1959). */
static void sort_pairs(pair *p, size_t n) {
    for (size_t gap = n / 2; gap > 0; gap = gap == 2 ? 1 : gap * 5 / 11)
        for (size_t i = gap; i < n; i++) {
            pair moved = p[i];
            size_t k = i;
            for (; k >= gap && likelier(&moved, &p[k - gap]); k -= gap)
                p[k] = p[k - gap];
            p[k] = moved;
        }
}

/* The track goes on with the segment. `v`: from where it was seen; NULL: unknown. */
static void sight(tracker *t, track *k, int32_t segment, const viewpoint *v) {
    const arris_segment *s = &t->in[segment];
    arris_segment own = segment_along(&k->next, s);
    k->turned = own.x1 != s->x1 || own.y1 != s->y1;
    k->segment = segment;
    k->gap = 0;
    if (k->sightings++ > 0)
        motion_sight(t, k, &own);
    if ((k->seen.x2 - k->seen.x1) * (own.x2 - own.x1) +
            (k->seen.y2 - k->seen.y1) * (own.y2 - own.y1) <
        0)
        k->s.length = 0; /* merged into a line that runs the other way */
    k->time = t->time;
    k->seen = own;
    if (v)
        sweep_sight(&k->s, &own, v, &t->scene);
    t->taken[segment] = 1;
}

/* Pairs all tracks; returns whether the segments explain at least half of what is foreseen of those
 * that were seen in the frame before. */
static bool find_all_pairs(tracker *t) {
    double asked = 0, sum = 0;
    t->n_pairs = 0;
    for (int32_t i = 0; i < t->n; i++) {
        double well = find_pairs(t, i);
        if (t->track[i].sightings > 1 && t->track[i].gap == 0)
            asked++, sum += well;
    }
    return 2 * sum >= asked;
}

/* Joins what is likeliest. */
static void join(tracker *t, const viewpoint *v) {
    sort_pairs(t->pair, t->n_pairs);
    for (size_t i = 0; i < t->n_pairs; i++) {
        const pair *p = &t->pair[i];
        if (!t->taken[p->segment] && t->track[p->track].segment < 0)
            sight(t, &t->track[p->track], p->segment, v);
    }
}

/* ---- which tracks there are ----------------------------------------------------------------- */

/* Whether a track that is not seen any more is remembered: for a while, or as long as it is a line.
 */
static bool worth_keeping(const tracker *t, const track *k) {
    return !asleep(t, k) || (k->line == k->id && depth_knows(t, k)) ||
           (k->sightings >= ESTABLISHED && k->gap < PATIENCE * k->sightings && k->s.length > 0);
}

/* Forgets tracks: those that are not worth keeping, and sleeping ones when their room is needed. */
static void forget(tracker *t) {
    int32_t n = 0, needed = t->n - t->p.max_tracks;
    for (int32_t j = 0; j < t->n_in; j++)
        needed += !t->taken[j];
    for (int32_t i = 0; i < t->n; i++) {
        track *k = &t->track[i];
        k->gap += k->segment < 0;
        bool keep = worth_keeping(t, k);
        if (keep && needed > 0 && asleep(t, k))
            keep = false, needed--;
        if (keep && n < i)
            t->track[n] = *k;
        n += keep;
    }
    t->n = n;
}

/* Free segments become tracks; returns how many found no room. */
static uint32_t start_tracks(tracker *t, const viewpoint *v) {
    uint32_t lost = 0;
    for (int32_t j = 0; j < t->n_in; j++) {
        if (t->taken[j])
            continue;
        if (t->n == t->p.max_tracks) {
            lost++;
            continue;
        }
        track *k = &t->track[t->n++];
        *k = (track){.id = t->total, .line = t->total, .next.where = t->in[j]};
        t->total++;
        sight(t, k, j, v);
    }
    return lost;
}

static void write_tracks(const tracker *t, arris_tracks *out) {
    out->total = (uint32_t)t->total;
    out->n = 0;
    for (int32_t i = 0; i < t->n; i++) {
        if (asleep(t, &t->track[i]))
            continue;
        if (out->n < out->max)
            out->item[out->n++] = (arris_track){t->track[i].id, t->track[i].segment};
        else
            out->lost++;
    }
}

/* Forecasts and pairs every track. Returns `v`, or NULL when it is unknown, or so far from what is
 * seen that it must be another frame's: then the picture alone tells. */
static const viewpoint *pair_up(tracker *t, const viewpoint *v) {
    double steps = 1;
    if (v) {
        depth_forecast(t, v);
        if (find_all_pairs(t) || motion_find(t, &steps) <= CLEARLY * depth_explains(t) + 1) {
            t->time += 1;
            return v;
        }
    } else {
        motion_find(t, &steps);
    }
    motion_forecast(t, steps);
    find_all_pairs(t);
    return NULL;
}

void tracker_run(tracker *t, const arris_segments *in, const viewpoint *from, arris_tracks *out) {
    t->in = in->item;
    t->n_in = in->n < (uint32_t)t->p.max_tracks ? (int32_t)in->n : t->p.max_tracks;
    index_fill(t->index, t->in, (uint32_t)t->n_in);
    memset(t->taken, 0, (size_t)t->n_in * sizeof *t->taken);
    for (int32_t i = 0; i < t->n; i++)
        t->track[i].segment = -1;
    const viewpoint *v = pair_up(t, from);
    join(t, v);
    forget(t);
    motion_end_frame(t);
    if (v)
        depth_end_frame(t, v);
    out->lost = in->n - (uint32_t)t->n_in + start_tracks(t, v);
    t->n_known = 0;
    write_tracks(t, out);
}
