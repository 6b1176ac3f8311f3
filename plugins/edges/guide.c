/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * guide.c: which lines are foreseen (guide.h).
 */
#include "guide.h"

#include <math.h>
#include <stdlib.h>

#define SURE 0.4     /* px: a sigma above this is no good forecast */
#define FASTEST 32.0 /* px a frame: when lines move faster, too much comes into the picture */
#define STEEP 0.2 /* of its depth, by which that of a line's ends may differ: where one that is */
                  /* foreshortened more ends, nobody can tell in the picture */
#define NEAR 4.0  /* px between lines, besides their sigmas, that may be taken for each other, */
#define COS_TURN 0.95 /* if they differ in direction by no more: 18 degrees */

enum { RECENT = 4 }; /* frames for which a line that was not seen may still come back */

struct guide {
    arris_camera lens, ideal;
    double border[4]; /* x0, y0, x1, y1 around the picture, ideal px */
    arris_pose pose;  /* of the frame before */
    int searched;     /* pictures in a row, up to that one */
    uint32_t n;       /* known lines, as they should be in this one */
    arris_foreseen known[GUIDE_LINES];
};

guide *guide_new(const arris_camera *lens) {
    guide *g = calloc(1, sizeof *g);
    if (!g)
        return NULL;
    double w = lens->width - 1, h = lens->height - 1;
    g->lens = *lens;
    g->ideal = arris_camera_ideal(lens);
    g->border[0] = g->border[1] = (double)INFINITY;
    g->border[2] = g->border[3] = -(double)INFINITY;
    for (int i = 0; i < 16; i++) {
        double along = i % 4 / 4., u[4] = {along, 1, 1 - along, 0}, x, y;
        arris_undistort(lens, u[i / 4] * w, u[(i / 4 + 3) % 4] * h, &x, &y);
        g->border[0] = fmin(g->border[0], x), g->border[2] = fmax(g->border[2], x);
        g->border[1] = fmin(g->border[1], y), g->border[3] = fmax(g->border[3], y);
    }
    return g;
}

void guide_free(guide *g) {
    free(g);
}

/* Variance of the end P (0: p, 1: q) of a line along the unit vector n, mm². */
static double variance_along(const double cov[21], int end, const double n[3]) {
    double sum = 0;
    for (int i = 0, k = 0; i < 6; i++)
        for (int j = i; j < 6; j++, k++)
            if (i / 3 == end && j / 3 == end)
                sum += (i == j ? 1 : 2) * cov[k] * n[i % 3] * n[j % 3];
    return sum;
}

/* Cuts off what is beyond the border (Liang and Barsky, 1984). False: nothing is left. */
static bool clip(const double border[4], double e[4]) {
    double d[2] = {e[2] - e[0], e[3] - e[1]}, from = 0, to = 1;
    for (int i = 0; i < 2; i++) {
        double a = (border[i] - e[i]) / d[i], b = (border[2 + i] - e[i]) / d[i];
        if (d[i] == 0 && (e[i] < border[i] || e[i] > border[2 + i]))
            return false;
        if (d[i] != 0)
            from = fmax(from, fmin(a, b)), to = fmin(to, fmax(a, b));
    }
    for (int i = 0; i < 2; i++) {
        e[2 + i] = e[i] + to * d[i];
        e[i] += from * d[i];
    }
    return from < to;
}

/* The line as seen from `pose`, in ideal pixels, as far as the picture reaches. */
static bool foresee(const guide *g, const arris_line *l, const arris_pose *pose, double position,
                    arris_foreseen *f) {
    double e[4], n[3], z[2], worst = 0;
    z[0] = arris_project(&g->ideal, pose, l->p, &e[0], &e[1]);
    z[1] = arris_project(&g->ideal, pose, l->q, &e[2], &e[3]);
    if (!(z[0] > 0) || !(z[1] > 0) || fabs(z[0] - z[1]) > STEEP * (z[0] + z[1]) / 2 ||
        arris_view_plane(&g->ideal, pose, e, n))
        return false;
    for (int i = 0; i < 2; i++) {
        double px = g->ideal.fx / z[i];
        worst = fmax(worst, px * px * (variance_along(l->cov, i, n) + position * position));
    }
    bool inside = isfinite(e[0] + e[1] + e[2] + e[3]) && clip(g->border, e);
    *f = (arris_foreseen){l->id, e[0], e[1], e[2], e[3], sqrt(worst), 0, 0};
    return inside && isfinite(worst);
}

/* Sets how the line's middle moves in the picture, px. Returns how far. */
static double set_motion(const guide *g, const arris_foreseen *from, arris_foreseen *to) {
    double x, y;
    arris_distort(&g->lens, (from->x1 + from->x2) / 2, (from->y1 + from->y2) / 2, &x, &y);
    arris_distort(&g->lens, (to->x1 + to->x2) / 2, (to->y1 + to->y2) / 2, &to->dx, &to->dy);
    to->dx -= x, to->dy -= y;
    return hypot(to->dx, to->dy);
}

/* Whether another line may be so near to a stretch of this one, at its polarity, that one could be
 * taken for the other. */
static bool may_be_mistaken(const arris_foreseen *line, const arris_foreseen *other) {
    double dx = line->x2 - line->x1, dy = line->y2 - line->y1, length = hypot(dx, dy);
    double ex = other->x2 - other->x1, ey = other->y2 - other->y1, along[2], right[2];
    if (!(dx * ex + dy * ey > COS_TURN * length * hypot(ex, ey)))
        return false;
    for (int i = 0; i < 2; i++) {
        double x = (i ? other->x2 : other->x1) - line->x1;
        double y = (i ? other->y2 : other->y1) - line->y1;
        along[i] = (x * dx + y * dy) / length;
        right[i] = (y * dx - x * dy) / length;
    }
    double reach = NEAR + 3 * other->sigma;
    return along[1] > 0 && along[0] < length && fmin(right[0], right[1]) < reach &&
           fmax(right[0], right[1]) > -reach;
}

static bool is_alone(const guide *g, uint32_t line) {
    for (uint32_t i = 0; i < g->n; i++)
        if (i != line && may_be_mistaken(&g->known[line], &g->known[i]))
            return false;
    return true;
}

/* Foresees the known lines, the sure ones first. Returns how many these are: none when one of them
 * moves too fast. */
static uint32_t foresee_all(guide *g, const arris_lines *lines, const arris_pose *pose) {
    uint32_t sure = 0;
    g->n = 0;
    for (uint32_t i = 0; i < lines->n && g->n < GUIDE_LINES; i++) {
        const arris_line *l = &lines->item[i];
        arris_foreseen before, now;
        if (l->state == ARRIS_UNOBSERVABLE || l->change == ARRIS_MERGED ||
            l->change == ARRIS_RETIRED || l->seen == 0 || lines->frames - l->seen > RECENT ||
            !foresee(g, l, pose, lines->pose_sigma, &now))
            continue;
        arris_foreseen *to = &g->known[g->n++];
        if (l->seen == lines->frames && now.sigma < SURE &&
            foresee(g, l, &g->pose, lines->pose_sigma, &before)) {
            if (!(set_motion(g, &before, &now) <= FASTEST))
                return 0;
            *to = g->known[sure];
            to = &g->known[sure++];
        }
        *to = now;
    }
    return sure;
}

/* Hands on the lines that are sure and not to be mistaken. */
static void add_lines(guide *g, const arris_lines *lines, const arris_pose *pose,
                      arris_guide *out) {
    uint32_t sure = foresee_all(g, lines, pose);
    for (uint32_t i = 0; i < sure && out->n < out->max; i++)
        if (is_alone(g, i))
            out->item[out->n++] = g->known[i];
}

bool guide_decide(guide *g, const arris_lines *lines, const arris_pose *pose, arris_guide *out) {
    out->n = out->lost = 0;
    out->camera = &g->ideal;
    bool known = pose && pose->valid;
    if (g->searched >= GUIDE_PERIOD - 1 && lines && known && g->pose.valid)
        add_lines(g, lines, pose, out);
    g->pose = known ? *pose : (arris_pose){0};
    g->searched = out->n > 0 ? 0 : g->searched < GUIDE_PERIOD ? g->searched + 1 : GUIDE_PERIOD;
    return out->n > 0;
}
