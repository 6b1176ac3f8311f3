/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * associate.c: which line each segment is of (record.h). A track is one line's, as a rule; where it
 * went from one edge over to another it is of several. So the lines are found that a sample of the
 * track's segments lie on, and each segment goes to the nearest of these.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "record.h"

static const double REACH = 4;     /* px, from a line to its segments */
static const double OVERLAP = 0.5; /* of a segment, that must lie within the line's ends */
static const double SHARE = 0.1;   /* of a track's sample that makes a line one of its */
enum { SAMPLE = 16, CANDIDATES = 8 };

/* How far (px) the farther end of the segment is from the picture of the line; INFINITY when they
 * are not beside each other. */
static double distance(const record *r, const sighting *o, const arris_line *l) {
    const arris_pose *pose = &r->frame[o->frame].at;
    double x[2][2], dx = o->x2 - o->x1, dy = o->y2 - o->y1, length = hypot(dx, dy);
    if (!(arris_project(&r->camera, pose, l->p, &x[0][0], &x[0][1]) > 0) ||
        !(arris_project(&r->camera, pose, l->q, &x[1][0], &x[1][1]) > 0))
        return (double)INFINITY;
    double lx = x[1][0] - x[0][0], ly = x[1][1] - x[0][1], all = hypot(lx, ly);
    double d1 = (lx * (o->y1 - x[0][1]) - ly * (o->x1 - x[0][0])) / all;
    double d2 = (lx * (o->y2 - x[0][1]) - ly * (o->x2 - x[0][0])) / all;
    double s1 = (lx * (o->x1 - x[0][0]) + ly * (o->y1 - x[0][1])) / all;
    double s2 = (lx * (o->x2 - x[0][0]) + ly * (o->y2 - x[0][1])) / all;
    double within = fmin(fmax(s1, s2), all) - fmax(fmin(s1, s2), 0);
    double off = fmax(fabs(d1), fabs(d2));
    return off < REACH && within > OVERLAP * fmin(length, all) ? off : (double)INFINITY;
}

/* The lines that a good part of the n sightings of a track lie on. */
static int candidates(const record *r, const arris_lines *lines, const uint32_t *of, uint32_t n,
                      int32_t found[CANDIDATES]) {
    uint32_t sample = n < SAMPLE ? n : SAMPLE;
    int count = 0;
    for (uint32_t l = 0; l < lines->n && count < CANDIDATES; l++) {
        double fits = 0;
        for (uint32_t k = 0; k < sample; k++)
            fits += isfinite(distance(r, &r->item[of[k * n / sample]], &lines->item[l]));
        if (fits > SHARE * sample)
            found[count++] = (int32_t)l;
    }
    return count;
}

static void associate_track(record *r, const arris_lines *lines, double apart, const uint32_t *of,
                            uint32_t n) {
    int32_t found[CANDIDATES];
    int count = candidates(r, lines, of, n, found);
    for (uint32_t k = 0; k < n; k++) {
        sighting *o = &r->item[of[k]];
        double least = (double)INFINITY, next = least;
        o->line = -1;
        for (int c = 0; c < count; c++) {
            double off = distance(r, o, &lines->item[found[c]]);
            next = fmin(next, fmax(off, least));
            if (off < least)
                least = off, o->line = found[c];
        }
        r->frame[o->frame].seen += count > 0;
        r->frame[o->frame].strays += count > 0 && o->line < 0;
        if (next - least < apart)
            o->line = -1;
    }
}

typedef struct track_key {
    int32_t track;
    uint32_t item;
} track_key;

static int by_track(const void *a, const void *b) {
    const track_key *x = a, *y = b;
    return x->track != y->track ? (x->track > y->track) - (x->track < y->track)
                                : (x->item > y->item) - (x->item < y->item);
}

int record_associate(record *r, const arris_lines *lines, double apart) {
    track_key *key = malloc((r->n + (size_t)1) * sizeof *key);
    uint32_t *of = malloc((r->n + (size_t)1) * sizeof *of), n = 0;
    for (uint32_t i = 0; key && i < r->n; i++)
        key[i] = (track_key){r->item[i].track, i};
    if (key && of)
        qsort(key, r->n, sizeof *key, by_track);
    for (uint32_t i = 0; i < r->n_frames; i++)
        r->frame[i].seen = r->frame[i].strays = 0;
    for (uint32_t i = 0; key && of && i < r->n; i++) {
        of[n++] = key[i].item;
        if (i + 1 == r->n || key[i + 1].track != key[i].track) {
            associate_track(r, lines, apart, of, n);
            n = 0;
        }
    }
    int rc = key && of ? 0 : ARRIS_E_MEMORY;
    free(key);
    free(of);
    return rc;
}
