/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * tracker.c: the thesis's box tracker in streaming form.
 *
 * A track goes on with the segment whose end points lie in a box around the predicted ones. End
 * points scatter along a line, and lines enter and leave the picture; so the box is asked across
 * the line only, at both ends of the stretch that prediction and segment have in common, and along
 * it that they overlap. The motion across is each line's own, from its last two sightings; along a
 * line none can be seen (the aperture problem), so there it is the motion common to all.
 *
 * A track whose 3D line is known is looked for where that projects to, instead.
 *
 * Time runs in steps of the camera's motion, not of frames: a doubled frame or a stop is a step of
 * 0, a dropped frame one of 2, the way back one of -1. The step, common to all lines of a frame, is
 * the one that explains the frame best.
 */
#include "tracker.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct track {
    int32_t id, segment, gap; /* gap: frames since it was seen */
    bool moving;              /* `across` is known */
    double time;              /* of the last sighting */
    double across;            /* px per step, to the right of the line */
    arris_segment seen;       /* then */
    arris_segment predicted;  /* only the ends mean anything */
    arris_segment foreseen;   /* likewise; from outside, for the next frame only */
    double box;               /* px, around the prediction */
    int32_t best;             /* the segment nearest to the prediction, and its cost */
    double cost;
} track;

struct tracker {
    tracker_params p;
    track *track; /* by ascending id */
    int32_t n, total;
    double time, common[2]; /* px per step: the motion that suits all lines */
    int32_t *taken;         /* by segment: it continues a track */
    int32_t *best;          /* by segment: the nearest track, and its cost */
    double *cost;
};

enum { SAMPLE = 32 }; /* tracks that decide which step the camera made */
static const double STEPS[] = {1, 0, -1, 2};
static const double COS_TURN = 0.9; /* a line turns by less than 25° between two sightings */
static const double OVERLAP = 0.5;  /* of the shorter one, that must be in common */
static const double STRETCH = 0.25; /* cost of having nothing in common, in squared boxes */
static const double CLEARLY = 1.1;  /* how much better another step than 1 must explain a frame */

tracker *tracker_new(const tracker_params *p) {
    tracker *t = calloc(1, sizeof *t);
    if (!t)
        return NULL;
    size_t n = (size_t)p->max_tracks;
    t->p = *p;
    t->track = calloc(n, sizeof *t->track);
    t->taken = calloc(n, sizeof *t->taken);
    t->best = calloc(n, sizeof *t->best);
    t->cost = calloc(n, sizeof *t->cost);
    if (t->track && t->taken && t->best && t->cost)
        return t;
    tracker_free(t);
    return NULL;
}

void tracker_free(tracker *t) {
    if (!t)
        return;
    free(t->track);
    free(t->taken);
    free(t->best);
    free(t->cost);
    free(t);
}

/* The unit vector along s, and its length in px; 0 when the ends coincide. */
static double direction(const arris_segment *s, double u[2]) {
    double dx = s->x2 - s->x1, dy = s->y2 - s->y1, length = hypot(dx, dy);
    u[0] = length > 0 ? dx / length : 0;
    u[1] = length > 0 ? dy / length : 0;
    return length;
}

/* Whether the intervals ab and cd are more than `margin` apart. */
static bool apart(double a, double b, double c, double d, double margin) {
    return (a > b ? a : b) + margin < (c < d ? c : d) || (c > d ? c : d) + margin < (a < b ? a : b);
}

/* The stretch that s has in common with p, as distances d[0], d[1] of s to the right of p at its
 * two ends; returns its share of the longer one, 0 when it is less than OVERLAP of the shorter one
 * or the directions differ. */
static double common_stretch(const arris_segment *p, const arris_segment *s, double d[2]) {
    double u[2], v[2], lp = direction(p, u), ls = direction(s, v);
    double turn = u[0] * v[0] + u[1] * v[1];
    if (turn < COS_TURN)
        return 0;
    double x = s->x1 - p->x1, y = s->y1 - p->y1;
    double along = x * u[0] + y * u[1], right = y * u[0] - x * u[1];
    double t0 = fmax(0, along), t1 = fmin(lp, along + ls * turn);
    if (t1 - t0 < OVERLAP * fmin(lp, ls))
        return 0;
    double slope = (u[0] * v[1] - u[1] * v[0]) / turn;
    d[0] = right + (t0 - along) * slope;
    d[1] = right + (t1 - along) * slope;
    return (t1 - t0) / fmax(lp, ls);
}

/* How badly the segment s continues the prediction p: the mean squared distance across in units,
 * px, and what they do not share; INFINITY when it is out of the box. */
static double mismatch(const arris_segment *p, const arris_segment *s, double box, double unit) {
    double d[2], share;
    if (apart(p->x1, p->x2, s->x1, s->x2, box) || apart(p->y1, p->y2, s->y1, s->y2, box) ||
        (share = common_stretch(p, s, d)) <= 0 || fabs(d[0]) > box || fabs(d[1]) > box)
        return (double)INFINITY;
    return (d[0] * d[0] + d[1] * d[1]) / (2 * unit * unit) + STRETCH * (1 - share);
}

/* Where the line is after `step` more steps of the camera. */
static void predict(const tracker *t, track *k, double step) {
    double u[2], dt = t->time + step - k->time;
    direction(&k->seen, u);
    double along = t->common[0] * u[0] + t->common[1] * u[1];
    double across = k->moving ? k->across : t->common[1] * u[0] - t->common[0] * u[1];
    double dx = dt * (along * u[0] - across * u[1]), dy = dt * (along * u[1] + across * u[0]);
    k->predicted = (arris_segment){
        .x1 = k->seen.x1 + dx, .y1 = k->seen.y1 + dy, .x2 = k->seen.x2 + dx, .y2 = k->seen.y2 + dy};
}

/* How well a step of the camera explains the segments, over a sample of the tracks. In half the
 * box, so that it tells parallel neighbours apart. */
static double explains(tracker *t, const arris_segment *s, int32_t n, double step) {
    double sum = 0, half = t->p.box / 2;
    for (int32_t i = 0; i < t->n; i += 1 + t->n / SAMPLE) {
        double least = 1;
        predict(t, &t->track[i], step);
        for (int32_t j = 0; j < n; j++)
            least = fmin(least, mismatch(&t->track[i].predicted, &s[j], half, half));
        sum += 1 - least;
    }
    return sum;
}

static double find_step(tracker *t, const arris_segment *s, int32_t n) {
    double step = STEPS[0], most = explains(t, s, n, step) * CLEARLY;
    for (size_t i = 1; i < sizeof STEPS / sizeof *STEPS; i++) {
        double sum = explains(t, s, n, STEPS[i]);
        if (sum > most)
            most = sum, step = STEPS[i];
    }
    return step;
}

/* Where no line has been seen twice: searches the common motion, in steps of `pitch` px up to
 * `reach` steps from (x, y). The motion that is there wins a tie. */
static void search(tracker *t, const arris_segment *s, int32_t n, double pitch, int reach) {
    double best[2] = {t->common[0], t->common[1]}, x = best[0], y = best[1];
    double most = explains(t, s, n, 1) * CLEARLY;
    for (int i = -reach; i <= reach; i++)
        for (int j = -reach; j <= reach; j++) {
            t->common[0] = x + i * pitch, t->common[1] = y + j * pitch;
            double sum = explains(t, s, n, 1);
            if (sum > most)
                most = sum, best[0] = t->common[0], best[1] = t->common[1];
        }
    memcpy(t->common, best, sizeof best);
}

static bool none_moves(const tracker *t) {
    for (int32_t i = 0; i < t->n; i++)
        if (t->track[i].moving)
            return false;
    return t->n > 0;
}

/* The nearest track of each free segment and the nearest segment of each free track. */
static void find_nearest(tracker *t, const arris_segment *s, int32_t n) {
    for (int32_t j = 0; j < n; j++)
        t->best[j] = -1, t->cost[j] = (double)INFINITY;
    for (int32_t i = 0; i < t->n; i++) {
        track *k = &t->track[i];
        k->best = -1, k->cost = (double)INFINITY;
        for (int32_t j = 0; k->segment < 0 && j < n; j++) {
            double c =
                t->taken[j] ? (double)INFINITY : mismatch(&k->predicted, &s[j], k->box, t->p.box);
            if (c < k->cost)
                k->cost = c, k->best = j;
            if (c < t->cost[j])
                t->cost[j] = c, t->best[j] = i;
        }
    }
}

/* The track goes on with the segment s; its motion across is that of the two sightings. */
static void sight(track *k, const arris_segment *s, double time) {
    double d[2], dt = time - k->time;
    if (dt != 0 && common_stretch(&k->seen, s, d) > 0) {
        k->across = (d[0] + d[1]) / (2 * dt);
        k->moving = true;
    }
    k->seen = *s;
    k->time = time;
    k->gap = 0;
}

/* Joins tracks and segments that are each other's nearest; returns how many. */
static int32_t join(tracker *t, const arris_segment *s, int32_t n) {
    int32_t joined = 0;
    find_nearest(t, s, n);
    for (int32_t j = 0; j < n; j++) {
        track *k = t->best[j] < 0 ? NULL : &t->track[t->best[j]];
        if (!k || k->best != j)
            continue;
        k->segment = j;
        t->taken[j] = 1;
        sight(k, &s[j], t->time);
        joined++;
    }
    return joined;
}

/* The motion that suits all lines best: least squares of n v = across over the tracks just seen.
 * The ridge keeps v = 0 where no line tells. */
static void find_common_motion(tracker *t) {
    double a = 1e-3, b = 0, c = 1e-3, x = 0, y = 0;
    for (int32_t i = 0; i < t->n; i++) {
        const track *k = &t->track[i];
        double u[2];
        if (k->segment < 0 || !k->moving)
            continue;
        direction(&k->seen, u);
        a += u[1] * u[1], b -= u[0] * u[1], c += u[0] * u[0];
        x -= u[1] * k->across, y += u[0] * k->across;
    }
    t->common[0] = (c * x - b * y) / (a * c - b * b);
    t->common[1] = (a * y - b * x) / (a * c - b * b);
}

static void drop_lost(tracker *t) {
    int32_t n = 0;
    for (int32_t i = 0; i < t->n; i++)
        if (t->track[i].segment >= 0 || ++t->track[i].gap <= t->p.max_gap) {
            t->track[n] = t->track[i];
            t->track[n++].box = 0;
        }
    t->n = n;
}

/* Free segments become tracks; returns how many found no room. */
static uint32_t start_tracks(tracker *t, const arris_segment *s, int32_t n) {
    uint32_t lost = 0;
    for (int32_t j = 0; j < n; j++) {
        if (t->taken[j])
            continue;
        if (t->n == t->p.max_tracks) {
            lost++;
            continue;
        }
        t->track[t->n++] = (track){.id = t->total++, .segment = j, .time = t->time, .seen = s[j]};
    }
    return lost;
}

static void write_tracks(const tracker *t, arris_tracks *out) {
    uint32_t n = (uint32_t)t->n;
    out->n = n < out->max ? n : out->max;
    out->lost += n - out->n;
    out->total = (uint32_t)t->total;
    for (uint32_t i = 0; i < out->n; i++)
        out->item[i] = (arris_track){t->track[i].id, t->track[i].segment};
}

/* Where the track should go on in this frame. */
static void expect(const tracker *t, track *k) {
    k->segment = -1;
    if (k->box > 0) {
        k->predicted = k->foreseen;
    } else {
        predict(t, k, 0);
        k->box = t->p.box;
    }
}

void tracker_foresee(tracker *t, int32_t id, const arris_segment *where, double box) {
    int32_t low = 0, high = t->n;
    while (low < high) {
        int32_t middle = (low + high) / 2;
        if (t->track[middle].id < id)
            low = middle + 1;
        else
            high = middle;
    }
    if (low < t->n && t->track[low].id == id) {
        t->track[low].foreseen = *where;
        t->track[low].box = box;
    }
}

void tracker_run(tracker *t, const arris_segments *in, arris_tracks *out) {
    int32_t n = in->n < (uint32_t)t->p.max_tracks ? (int32_t)in->n : t->p.max_tracks;
    if (none_moves(t)) {
        search(t, in->item, n, t->p.box / 2, 8);
        search(t, in->item, n, t->p.box / 10, 3);
    }
    t->time += find_step(t, in->item, n);
    for (int32_t i = 0; i < t->n; i++)
        expect(t, &t->track[i]);
    memset(t->taken, 0, (size_t)n * sizeof *t->taken);
    for (int round = 0; round < 3 && join(t, in->item, n) > 0; round++)
        ;
    drop_lost(t);
    find_common_motion(t);
    out->lost = in->n - (uint32_t)n + start_tracks(t, in->item, n);
    write_tracks(t, out);
}
