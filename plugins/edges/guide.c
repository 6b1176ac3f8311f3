/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * guide.c: which lines are foreseen, and what they leave to be searched (guide.h).
 */
#include "guide.h"

#include <math.h>
#include <stdlib.h>

#include "regions.h"

#define SURE 0.4     /* px: a sigma above this is no good forecast */
#define BESIDE 2.0   /* px from a foreseen line within which an edge point is its */
#define BEYOND 4.0   /* px, likewise, beyond its ends */
#define MARGIN 8.0   /* px around what is searched for, and */
#define PARALLAX 1.5 /* times the motion of the foreseen lines: others may be nearer */
#define FASTEST 32.0 /* px a frame: what moves faster is searched in the whole picture */
#define CHORD 64.0   /* px along which a lens bends no line by more than some tenths of a px */

enum {
    RECENT = 2, /* frames for which a known line that was not seen is searched where it should be */
    REST = 7,   /* frames */
    RUN = 16,   /* points of a chain that are explained together, or not */
    RUNS = 4096,
    CHORDS = 16, /* of a line */
    DOUBTS = 64,
    DOUBTED = 30 /* frames for which a line that was foreseen and not seen is searched for */
};

/* A straight stretch of a foreseen line in the picture, along the unit vector (dx, dy). */
typedef struct chord {
    float x, y, dx, dy, length;
} chord;

/* Neighbouring points of a chain: the first, the middle and the last, and a gradient. */
typedef struct run {
    float x[3], y[3], gx, gy;
} run;

/* A line that was foreseen and not seen. */
typedef struct doubt {
    int32_t line;
    uint32_t until; /* `frames` before which it is not foreseen again */
} doubt;

struct guide {
    arris_camera lens, ideal;
    double border[4];  /* x0, y0, x1, y1 around the picture, ideal px */
    arris_pose pose;   /* of the frame before */
    arris_pose next;   /* of this one */
    int due;           /* frames until the whole picture is searched again */
    int rest;          /* frames until regions are tried again, when they were no help */
    uint32_t n_runs;   /* of the frame before; above RUNS: too many */
    uint32_t n_chords; /* of foreseen lines, as they were in the frame before */
    regions regions;
    uint32_t n_handed; /* on in the frame before: the lines' ids */
    int32_t handed[GUIDE_LINES];
    doubt doubt[DOUBTS]; /* the newest, in a ring */
    uint32_t n_doubts;
    run run[RUNS];
    chord chord[GUIDE_LINES * CHORDS];
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

/* ---- what is foreseen ----------------------------------------------------------------------- */

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
    if (!(z[0] > 0) || !(z[1] > 0) || arris_view_plane(&g->ideal, pose, e, n))
        return false;
    for (int i = 0; i < 2; i++) {
        double px = g->ideal.fx / z[i];
        worst = fmax(worst, px * px * (variance_along(l->cov, i, n) + position * position));
    }
    bool inside = isfinite(e[0] + e[1] + e[2] + e[3]) && clip(g->border, e);
    *f = (arris_foreseen){l->id, e[0], e[1], e[2], e[3], sqrt(worst)};
    return inside && isfinite(worst);
}

static bool is_known(const arris_line *l, uint32_t frames) {
    return l->state != ARRIS_UNOBSERVABLE && l->change != ARRIS_MERGED &&
           l->change != ARRIS_RETIRED && l->seen > 0 && frames - l->seen <= RECENT;
}

/* The line in the picture as chords, end to end; returns how many. */
static uint32_t bend(const guide *g, const arris_foreseen *f, chord *c) {
    double length = hypot(f->x2 - f->x1, f->y2 - f->y1), x[2], y[2];
    int n = arris_camera_distorts(&g->lens) ? 1 + (int)(length / CHORD) : 1;
    n = n < CHORDS ? n : CHORDS;
    for (int i = 0; i <= n; i++) {
        double t = (double)i / n;
        arris_distort(&g->lens, f->x1 + t * (f->x2 - f->x1), f->y1 + t * (f->y2 - f->y1), &x[i > 0],
                      &y[i > 0]);
        if (i == 0)
            continue;
        double dx = x[1] - x[0], dy = y[1] - y[0], d = fmax(hypot(dx, dy), 1e-9);
        c[i - 1] = (chord){(float)x[0], (float)y[0], (float)(dx / d), (float)(dy / d), (float)d};
        x[0] = x[1], y[0] = y[1];
    }
    return (uint32_t)n;
}

/* ---- what is not ---------------------------------------------------------------------------- */

/* Whether a point whose gradient points like (gx, gy) lies on the chord. */
static bool on_chord(const chord *c, float x, float y, float gx, float gy) {
    float along = (x - c->x) * c->dx + (y - c->y) * c->dy;
    float right = (y - c->y) * c->dx - (x - c->x) * c->dy;
    return fabsf(right) < (float)BESIDE && along > -(float)BEYOND &&
           along < c->length + (float)BEYOND && gy * c->dx - gx * c->dy > 0;
}

/* `last` is the chord that explained the point before. */
static bool is_explained(const guide *g, const run *r, uint32_t *last) {
    for (int i = 0; i < 3; i++) {
        uint32_t k = *last;
        if (k < g->n_chords && on_chord(&g->chord[k], r->x[i], r->y[i], r->gx, r->gy))
            continue;
        for (k = 0; k < g->n_chords; k++)
            if (on_chord(&g->chord[k], r->x[i], r->y[i], r->gx, r->gy))
                break;
        if (k == g->n_chords)
            return false;
        *last = k;
    }
    return true;
}

static void add_runs(guide *g, double margin) {
    uint32_t last = 0;
    for (uint32_t i = 0; i < g->n_runs && !g->regions.full; i++) {
        const run *r = &g->run[i];
        double x[3], y[3];
        for (int k = 0; k < 3; k++)
            x[k] = (double)r->x[k], y[k] = (double)r->y[k];
        if ((regions_have(&g->regions, x[0], y[0], x[1], y[1], margin) &&
             regions_have(&g->regions, x[1], y[1], x[2], y[2], margin)) ||
            is_explained(g, r, &last))
            continue;
        for (int k = 0; k < 2; k++)
            regions_add(&g->regions, x[k], y[k], x[k + 1], y[k + 1], margin);
    }
}

void guide_learn(guide *g, const arris_edges *edges) {
    g->pose = g->next;
    g->n_runs = 0;
    for (uint32_t i = 0; i < edges->n_chains && g->n_runs <= RUNS; i++) {
        const arris_chain *c = &edges->chain[i];
        const arris_edge_point *p = edges->point + c->first;
        for (uint32_t k = 0; k < c->n && g->n_runs <= RUNS; k += RUN) {
            uint32_t last = k + RUN < c->n ? k + RUN : c->n - 1, mid = (k + last) / 2;
            if (g->n_runs++ < RUNS)
                g->run[g->n_runs - 1] = (run){{p[k].x, p[mid].x, p[last].x},
                                              {p[k].y, p[mid].y, p[last].y},
                                              p[mid].gx,
                                              p[mid].gy};
        }
    }
}

/* A line whose whole surroundings are searched need not be foreseen. */
static void drop_searched(const guide *g, arris_guide *out) {
    uint32_t n = 0;
    for (uint32_t i = 0; i < out->n; i++) {
        const arris_foreseen *f = &out->item[i];
        double u[2], v[2];
        arris_distort(&g->lens, f->x1, f->y1, &u[0], &v[0]);
        arris_distort(&g->lens, f->x2, f->y2, &u[1], &v[1]);
        if (!regions_have(&g->regions, u[0], v[0], u[1], v[1], MARGIN))
            out->item[n++] = *f;
    }
    out->n = n;
}

/* ---- lines that were foreseen and not seen -------------------------------------------------- */

static void note_doubts(guide *g, const arris_lines *lines) {
    uint32_t next = 0; /* both lists are in the same order, but lines may have gone */
    for (uint32_t i = 0; i < lines->n; i++) {
        const arris_line *l = &lines->item[i];
        uint32_t k = next;
        while (k < g->n_handed && g->handed[k] != l->id)
            k++;
        if (k == g->n_handed)
            continue;
        next = k + 1;
        if (l->seen < lines->frames)
            g->doubt[g->n_doubts++ % DOUBTS] = (doubt){l->id, lines->frames + DOUBTED};
    }
}

static bool is_doubted(const guide *g, int32_t line, uint32_t frames) {
    for (uint32_t i = 0; i < DOUBTS; i++)
        if (g->doubt[i].line == line && frames < g->doubt[i].until)
            return true;
    return false;
}

/* ---- the decision --------------------------------------------------------------------------- */

static double motion_of(const arris_foreseen *a, const arris_foreseen *b) {
    return fmax(hypot(a->x1 - b->x1, a->y1 - b->y1), hypot(a->x2 - b->x2, a->y2 - b->y2));
}

/* Hands on the lines that are sure, and searches for those that were lost. Returns how far the
 * former move in the picture, px. */
static double add_lines(guide *g, const arris_lines *lines, arris_guide *out) {
    double motion = 0;
    for (uint32_t i = 0; i < lines->n; i++) {
        const arris_line *l = &lines->item[i];
        arris_foreseen now, before;
        if (!is_known(l, lines->frames) || !foresee(g, l, &g->next, lines->pose_sigma, &now))
            continue;
        bool sure = l->seen == lines->frames && now.sigma < SURE && out->n < out->max &&
                    !is_doubted(g, l->id, lines->frames) &&
                    foresee(g, l, &g->pose, lines->pose_sigma, &before);
        chord *c = &g->chord[g->n_chords];
        uint32_t n = bend(g, sure ? &before : &now, c);
        if (sure) {
            out->item[out->n++] = now;
            g->n_chords += n;
            motion = fmax(motion, motion_of(&now, &before));
            continue;
        }
        for (uint32_t k = 0; k < n; k++)
            regions_add(&g->regions, (double)c[k].x, (double)c[k].y,
                        (double)(c[k].x + c[k].length * c[k].dx),
                        (double)(c[k].y + c[k].length * c[k].dy), MARGIN);
    }
    return motion;
}

static bool decide(guide *g, const arris_lines *lines, arris_guide *out) {
    if (lines)
        note_doubts(g, lines);
    if (g->rest > 0) {
        g->rest--;
        return false;
    }
    if (!lines || !g->next.valid || !g->pose.valid || g->n_runs > RUNS || g->due == 0)
        return false;
    double motion = add_lines(g, lines, out);
    if (out->n == 0 || motion > FASTEST)
        return false;
    add_runs(g, MARGIN + PARALLAX * motion);
    drop_searched(g, out);
    return !g->regions.full;
}

bool guide_decide(guide *g, const arris_lines *lines, const arris_pose *pose, arris_guide *out) {
    g->next = pose ? *pose : (arris_pose){0};
    g->n_chords = 0;
    regions_clear(&g->regions, g->lens.width, g->lens.height);
    out->n = out->lost = 0;
    out->camera = &g->ideal;
    bool part = decide(g, lines, out);
    g->due = part ? g->due - 1 : GUIDE_PERIOD - 1;
    if (g->regions.full)
        g->rest = REST;
    if (!part)
        out->n = 0;
    g->n_handed = out->n;
    for (uint32_t i = 0; i < out->n; i++)
        g->handed[i] = out->item[i].line;
    return part;
}

const canny_region *guide_regions(const guide *g, uint32_t *n) {
    *n = g->regions.n;
    return g->regions.item;
}
