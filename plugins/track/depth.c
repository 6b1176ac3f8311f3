/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * depth.c: where lines go by the poses. A line that is known is looked for where it projects to;
 * another is swept over the depths that its sightings leave (sweep.h), in the beginning those that
 * the scene has. How deep the scene is shows in the lines that are known; before there are any, a
 * plane is swept from near to far (Collins 1996), and the depth at which it takes most segments to
 * others is it.
 */
#include <math.h>
#include <stdlib.h>

#include "tracks.h"

static const double SPREAD = 0.5;  /* of the scene's mean inverse depth: its sigma */
enum { ENOUGH = 3, PLANES = 128 }; /* sightings of a track that tells; planes at most */

static int by_id(const void *a, const void *b) {
    int32_t x = ((const known *)a)->id, y = ((const known *)b)->id;
    return (x > y) - (x < y);
}

static void sort_known(tracker *t) {
    for (int32_t i = 1; i < t->n_known; i++)
        if (t->known[i].id < t->known[i - 1].id) {
            qsort(t->known, (size_t)t->n_known, sizeof *t->known, by_id);
            return;
        }
}

/* Of a track that was seen once. */
static bool fresh(const track *k) {
    return k->sightings == 1 && k->s.length > 0;
}

/* How well the plane at inverse depth w, known to within sigma, explains the fresh tracks. */
static double plane_explains(tracker *t, const viewpoint *v, double w, double sigma, int32_t step) {
    double sum = 0;
    for (int32_t i = 0; i < t->n; i += step) {
        sweep s = t->track[i].s;
        forecast f;
        s.w[0] = s.w[1] = w;
        s.var[0] = s.var[1] = sigma * sigma;
        if (fresh(&t->track[i]) && sweep_forecast(&s, v, &f))
            sum += explained(t, &f);
    }
    return sum;
}

/* The baseline of the first fresh track, mm, and how many there are. */
static double fresh_baseline(const tracker *t, const viewpoint *v, int32_t *n) {
    double baseline = 0;
    *n = 0;
    for (int32_t i = 0; i < t->n; i++) {
        const double *C = t->track[i].s.C;
        if (fresh(&t->track[i]) && (*n)++ == 0)
            baseline = sqrt(pow(C[0] - v->pose->C[0], 2) + pow(C[1] - v->pose->C[1], 2) +
                            pow(C[2] - v->pose->C[2], 2));
    }
    return baseline;
}

static void set_scene(tracker *t, double w) {
    t->scene.mean = w;
    t->scene.sigma = SPREAD * w;
    t->scene_age = 0;
}

static void forget_scene(tracker *t) {
    t->scene.mean = (t->scene.most + t->scene.least) / 2;
    t->scene.sigma = (t->scene.most - t->scene.least) / 2;
    t->scene_age = -1;
}

static void sweep_planes(tracker *t, const viewpoint *v) {
    int32_t fresh_tracks;
    double range = t->scene.most - t->scene.least, best = 0, most = 0;
    double px = v->camera->fx * fresh_baseline(t, v, &fresh_tracks) * range;
    int n = (int)ceil(fmin(px, PLANES));
    for (int i = 0; i <= n && n > 1; i++) {
        double w = t->scene.least + range * i / n;
        double sum = plane_explains(t, v, w, range / n / 4, 1 + fresh_tracks / SAMPLE);
        if (sum > most)
            most = sum, best = w;
    }
    if (most <= 0)
        return;
    set_scene(t, best);
    for (int32_t i = 0; i < t->n; i++)
        for (int k = 0; k < 2 && fresh(&t->track[i]); k++) {
            t->track[i].s.w[k] = t->scene.mean;
            t->track[i].s.var[k] = t->scene.sigma * t->scene.sigma;
        }
}

static const known *find_known(const tracker *t, int32_t id) {
    return bsearch(&(known){.id = id}, t->known, (size_t)t->n_known, sizeof(known), by_id);
}

bool depth_knows(const tracker *t, const track *k) {
    return find_known(t, k->line) != NULL;
}

/* Whether a line is nowhere near where the track's last sightings have it, as one along the motion
 * may be, the distance of which was mistaken. */
static bool contradicts(const forecast *line, const track *k, const viewpoint *v) {
    const forecast *swept = &k->next;
    double w;
    if (!sweep_depth(&k->s, v, &w))
        return false;
    arris_segment s = swept->where;
    const double *c = swept->cov;
    double u[2], length = segment_direction(&s, u);
    s.cov[0] = (c[0] + 2 * c[1] + c[2]) / 4;
    s.cov[1] = (c[2] - c[0]) / (2 * length);
    s.cov[2] = (c[0] - 2 * c[1] + c[2]) / (length * length);
    return !forecast_near(line, &s, forecast_reach(line)) || forecast_misfit(line, &s) >= 1;
}

static void forecast_one(tracker *t, track *k, const viewpoint *v) {
    const known *l = find_known(t, k->line);
    bool good = l && l->visible && forecast_reach(&l->f) < t->p.box, sure = good && asleep(t, k);
    bool posed = k->s.length > 0, swept = posed && !sure && sweep_forecast(&k->s, v, &k->next);
    bool trusted = l && l->visible && (!swept || (good && !contradicts(&l->f, k, v)));
    if (trusted)
        k->next = l->f;
    else if (!posed && !l)
        motion_forecast_one(t, k);
    else if (!swept)
        k->next = (forecast){.cov = {0}}; /* nowhere */
    k->next.turned = k->turned;
    k->next.where.lo = k->seen.lo, k->next.where.hi = k->seen.hi;
}

void depth_forecast(tracker *t, const viewpoint *v) {
    sort_known(t);
    if (t->scene_age < 0)
        sweep_planes(t, v);
    for (int32_t i = 0; i < t->n; i++)
        forecast_one(t, &t->track[i], v);
}

double depth_explains(tracker *t) {
    double sum = 0;
    for (int32_t i = 0; i < t->n; i += 1 + t->n / SAMPLE)
        if (!asleep(t, &t->track[i]))
            sum += explained(t, &t->track[i].next);
    return sum;
}

/* Lines that are known tell, or else, since in noise some track is always narrow, those that were
 * seen often enough. */
void depth_end_frame(tracker *t, const viewpoint *v) {
    double sum = 0, w;
    int32_t n = 0;
    for (int32_t i = 0; i < t->n_known; i++)
        if (t->known[i].visible)
            sum += 1 / t->known[i].depth, n++;
    for (int32_t i = 0; t->n_known == 0 && i < t->n; i++) {
        const track *k = &t->track[i];
        if (k->segment >= 0 && k->sightings >= ENOUGH && sweep_depth(&k->s, v, &w))
            sum += w, n++;
    }
    if (n > 0)
        set_scene(t, fmin(fmax(sum / n, t->scene.least), t->scene.most));
    else if (t->scene_age >= 0 && ++t->scene_age > t->p.max_gap)
        forget_scene(t);
}
