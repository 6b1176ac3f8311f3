/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * motion.c: the thesis's box tracker in streaming form: where lines go by the picture alone.
 *
 * End points scatter along a line, and lines enter and leave the picture; so the box is asked
 * across the line only, at both ends of the stretch that forecast and segment have in common, and
 * along it that they overlap. The motion across is each line's own, from its last two sightings;
 * along a line none can be seen (the aperture problem), so there it is the motion common to all.
 *
 * Time runs in steps of the camera's motion, not of frames: a doubled frame or a stop is a step of
 * 0, a dropped frame one of 2, the way back one of -1. The step, common to all lines of a frame, is
 * the one that explains the frame best.
 */
#include <math.h>
#include <string.h>

#include "tracks.h"

static const double STEPS[] = {1, 0, -1, 2};
static const double CLEARLY = 1.1; /* how much better another step than 1 must explain a frame */

/* Where the line is after `steps` more steps of the camera. */
static forecast predict(const tracker *t, const track *k, double steps, double box) {
    double u[2], dt = t->time + steps - k->time;
    segment_direction(&k->seen, u);
    double along = t->common[0] * u[0] + t->common[1] * u[1];
    double across = k->moving ? k->across : t->common[1] * u[0] - t->common[0] * u[1];
    double dx = dt * (along * u[0] - across * u[1]), dy = dt * (along * u[1] + across * u[0]);
    arris_segment where = k->seen;
    where.x1 += dx, where.y1 += dy, where.x2 += dx, where.y2 += dy;
    forecast f = forecast_box(&where, box);
    f.turned = k->turned;
    return f;
}

/* How well a number of steps explains the segments. In half the box, so that it tells parallel
 * neighbours apart. */
static double explains(tracker *t, double steps) {
    double sum = 0;
    for (int32_t i = 0; i < t->n; i += 1 + t->n / SAMPLE) {
        if (asleep(t, &t->track[i]))
            continue;
        forecast f = predict(t, &t->track[i], steps, t->p.box / 2);
        sum += explained(t, &f);
    }
    return sum;
}

/* Where no line has been seen twice: searches the common motion, in steps of `pitch` px up to
 * `reach` steps from what it is. That wins a tie. */
static void search(tracker *t, double pitch, int reach) {
    double best[2] = {t->common[0], t->common[1]}, x = best[0], y = best[1];
    double most = explains(t, 1) * CLEARLY;
    for (int i = -reach; i <= reach; i++)
        for (int j = -reach; j <= reach; j++) {
            t->common[0] = x + i * pitch, t->common[1] = y + j * pitch;
            double sum = explains(t, 1);
            if (sum > most)
                most = sum, best[0] = t->common[0], best[1] = t->common[1];
        }
    memcpy(t->common, best, sizeof best);
}

static bool none_moves(const tracker *t) {
    for (int32_t i = 0; i < t->n; i++)
        if (t->track[i].moving && !asleep(t, &t->track[i]))
            return false;
    return t->n > 0;
}

double motion_find(tracker *t, double *steps) {
    if (none_moves(t)) {
        search(t, t->p.box / 2, 8);
        search(t, t->p.box / 10, 3);
    }
    double most = explains(t, STEPS[0]) * CLEARLY;
    *steps = STEPS[0];
    for (size_t i = 1; i < sizeof STEPS / sizeof *STEPS; i++) {
        double sum = explains(t, STEPS[i]);
        if (sum > most)
            most = sum, *steps = STEPS[i];
    }
    return *steps == STEPS[0] ? most / CLEARLY : most;
}

void motion_forecast_one(const tracker *t, track *k) {
    k->next = predict(t, k, 0, t->p.box);
}

void motion_forecast(tracker *t, double steps) {
    t->time += steps;
    for (int32_t i = 0; i < t->n; i++)
        motion_forecast_one(t, &t->track[i]);
}

void motion_sight(const tracker *t, track *k, const arris_segment *s) {
    double d[2], stretch[2], dt = t->time - k->time;
    if (dt != 0 && segment_stretch(&k->seen, s, stretch, d) > 0) {
        k->across = (d[0] + d[1]) / (2 * dt);
        k->moving = true;
    }
}

/* Least squares of n v = across over the tracks just seen. The ridge keeps v = 0 where no line
 * tells. */
void motion_end_frame(tracker *t) {
    double a = 1e-3, b = 0, c = 1e-3, x = 0, y = 0;
    for (int32_t i = 0; i < t->n; i++) {
        const track *k = &t->track[i];
        double u[2];
        if (k->segment < 0 || !k->moving)
            continue;
        segment_direction(&k->seen, u);
        a += u[1] * u[1], b -= u[0] * u[1], c += u[0] * u[0];
        x -= u[1] * k->across, y += u[0] * k->across;
    }
    t->common[0] = (c * x - b * y) / (a * c - b * b);
    t->common[1] = (a * y - b * x) / (a * c - b * b);
}
