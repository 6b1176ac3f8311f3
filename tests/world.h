/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * world.h: a world of edges, a camera that goes through it, and what the stages made of that; for
 * the tests that play sequences (sequence.h).
 */
#ifndef WORLD_H
#define WORLD_H

#include "sequence.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "arris.h"
#include "chance.h"
#include "scratch.h"

/* ---- the world ------------------------------------------------------------------------------ */

/* An edge, its darker side on the left as one looks from p to q with y down. */
typedef struct edge {
    double p[3], q[3];
    float lo, hi;
} edge;

enum { EDGES = 12000, TRACKS = 40000, FOREIGN = -1 };

static sequence now;
static edge world[EDGES];
static int n_edges;
static double sigma; /* px: noise of a segment of 100 px across itself */

/* What is remembered of a run. */
static int truth[SEQUENCE_SEGMENTS];      /* by segment of this frame: its edge */
static int shown[EDGES], held[EDGES];     /* by edge: in how many frames */
static int32_t track_of[EDGES];           /* the one that held it last; -1 */
static int changes[EDGES];                /* how often another track held it */
static int owner[TRACKS], swaps, unsound; /* by track: the edge that it held last */
static uint32_t tracks_total;
static arris_line result[4000];
static uint32_t n_results;

const sequence *sequence_now(void) {
    return &now;
}

void sequence_look(int frame, const arris_segments *segments, const arris_tracks *tracks,
                   const arris_lines *lines) {
    n_results = 0;
    for (uint32_t i = 0; i < lines->n && n_results < 4000; i++)
        if (lines->item[i].change < ARRIS_MERGED)
            result[n_results++] = lines->item[i];
    (void)frame;
    if (!segments || !tracks)
        return;
    tracks_total = tracks->total;
    for (uint32_t k = 0; k < tracks->n; k++) {
        int32_t id = tracks->item[k].id, s = tracks->item[k].segment;
        int e = s < 0 ? FOREIGN : truth[s];
        unsound += id < 0 || id >= TRACKS || (k > 0 && id <= tracks->item[k - 1].id);
        if (e == FOREIGN || id < 0 || id >= TRACKS)
            continue;
        if (owner[id] >= 0 && owner[id] != e)
            swaps++;
        owner[id] = e;
        if (track_of[e] >= 0 && track_of[e] != id)
            changes[e]++;
        track_of[e] = id;
        held[e]++;
    }
}

/* ---- the camera ----------------------------------------------------------------------------- */

static const arris_camera camera = {320, 240, 380, 378, 0.5, 158.5, 121, 0, 0, 0, 0, 0};

static inline arris_pose pose_at(double x, double y, double z, double omega, double theta,
                                 double kappa) {
    arris_pose p = {.valid = true, .C = {x, y, z}};
    arris_rotation(omega, theta, kappa, p.R);
    return p;
}

/* The places 0..1 of the edge between which it is in front of the camera and in its picture. */
static inline bool in_view(const edge *e, const arris_pose *pose, double w[2]) {
    const double border[4][3] = {/* n K (X - C) > 0 inside */
                                 {1, 0, -3},
                                 {-1, 0, camera.width - 4},
                                 {0, 1, -3},
                                 {0, -1, camera.height - 4}};
    double h[2][3];
    for (int k = 0; k < 2; k++) {
        double d[3], c[3];
        for (int i = 0; i < 3; i++)
            d[i] = (k ? e->q : e->p)[i] - pose->C[i];
        for (int i = 0; i < 3; i++)
            c[i] = arris_dot(pose->R + 3 * i, d);
        h[k][0] = camera.fx * c[0] + camera.skew * c[1] + camera.cx * c[2];
        h[k][1] = camera.fy * c[1] + camera.cy * c[2];
        h[k][2] = c[2];
    }
    w[0] = 0, w[1] = 1;
    for (int i = 0; i < 5; i++) {
        double a = i < 4 ? arris_dot(border[i], h[0]) : h[0][2] - 50;
        double b = i < 4 ? arris_dot(border[i], h[1]) : h[1][2] - 50;
        if (a < 0 && b < 0)
            return false;
        if (a < 0)
            w[0] = fmax(w[0], a / (a - b));
        if (b < 0)
            w[1] = fmin(w[1], a / (a - b));
    }
    return w[1] > w[0];
}

static inline void point(const edge *e, double w, double P[3]) {
    for (int i = 0; i < 3; i++)
        P[i] = e->p[i] + w * (e->q[i] - e->p[i]);
}

/* Adds what a detector finds between the places from and to of the edge; nothing under 15 px. */
static inline void see_part(const edge *e, int name, double from, double to, const arris_pose *pose,
                            arris_segments *out) {
    double w[2], P[3], a[2], b[2];
    if (!in_view(e, pose, w) || fmin(w[1], to) <= fmax(w[0], from) ||
        fabs((double)e->hi - e->lo) < 8)
        return;
    point(e, fmax(w[0], from), P);
    arris_project(&camera, pose, P, &a[0], &a[1]);
    point(e, fmin(w[1], to), P);
    arris_project(&camera, pose, P, &b[0], &b[1]);
    double dx = b[0] - a[0], dy = b[1] - a[1], length = hypot(dx, dy);
    if (length < 15 || out->n == out->max)
        return;
    dx /= length, dy /= length;
    double var = sigma * sigma * 100 / length, turn = sqrt(12 * var) / length * normal();
    double offset = sqrt(var) * normal(), s = 1.5 * normal(), t = 1.5 * normal();
    double l = offset - turn * length / 2, r = offset + turn * length / 2;
    arris_segment g = {.x1 = a[0] + s * dx - l * dy,
                       .y1 = a[1] + s * dy + l * dx,
                       .x2 = b[0] + t * dx - r * dy,
                       .y2 = b[1] + t * dy + r * dx,
                       .cov = {var, 0, 12 * var / (length * length)},
                       .lo = e->lo,
                       .hi = e->hi,
                       .chi2 = 1};
    if (e->lo > e->hi) /* a chain has its brighter side on the right */
        g = (arris_segment){g.x2, g.y2, g.x1, g.y1,  {var, 0, g.cov[2]}, e->hi, e->lo,
                            0,    1,    0,    {0, 0}};
    truth[out->n] = name;
    if (name != FOREIGN)
        shown[name]++;
    out->item[out->n++] = g;
}

static inline void see(int name, const arris_pose *pose, arris_segments *out) {
    see_part(&world[name], name, 0, 1, pose, out);
}

static inline void see_all(const arris_pose *pose, arris_segments *out) {
    for (int i = 0; i < n_edges; i++)
        see(i, pose, out);
}

/* Segments that are nothing, of 15 to 45 px. */
static inline void see_noise(int n, arris_segments *out) {
    for (int i = 0; i < n && out->n < out->max; i++) {
        double x = 320 * uniform(), y = 240 * uniform(), a = 2 * M_PI * uniform();
        double length = 15 + 30 * uniform();
        truth[out->n] = FOREIGN;
        out->item[out->n++] = (arris_segment){.x1 = x,
                                              .y1 = y,
                                              .x2 = x + length * cos(a),
                                              .y2 = y + length * sin(a),
                                              .cov = {1e-3, 0, 1e-5},
                                              .lo = 50,
                                              .hi = 90};
    }
}

/* ---- building the world ---------------------------------------------------------------------- */

static inline int add(double x1, double y1, double z1, double x2, double y2, double z2) {
    world[n_edges] = (edge){{x1, y1, z1}, {x2, y2, z2}, 40, 160};
    return n_edges++;
}

/* Plates that float at several depths over the path, each of four edges. */
static inline void add_plates(void) {
    static const double at[5][4] = {/* x, y, z, angle */
                                    {-150, -90, 980, 0.2},
                                    {130, -70, 900, -0.25},
                                    {-140, 80, 820, -0.15},
                                    {10, -10, 760, 0.3},
                                    {120, 90, 690, 0.1}};
    for (int i = 0; i < 5; i++) {
        double c = cos(at[i][3]), s = sin(at[i][3]), x[5], y[5];
        for (int k = 0; k < 5; k++) {
            double u = (k % 4 == 1 || k % 4 == 2) ? 45 : -45, v = k % 4 > 1 ? 40 : -40;
            x[k] = at[i][0] + c * u - s * v;
            y[k] = at[i][1] + s * u + c * v;
        }
        for (int k = 0; k < 4; k++)
            add(x[k], y[k], at[i][2], x[k + 1], y[k + 1], at[i][2]);
    }
}

/* ---- running it ------------------------------------------------------------------------------ */

static inline void begin(uint64_t with) {
    seed = with * 7919 + 1;
    for (int i = 0; i < 10; i++)
        uniform();
    sigma = 0.02;
    n_edges = 0;
    now = (sequence){.camera = camera, .frames = 100};
}

static inline void play_with(const char *track) {
    char line[300];
    arris_error err;
    arris_message m;
    memset(shown, 0, sizeof shown);
    memset(held, 0, sizeof held);
    memset(changes, 0, sizeof changes);
    memset(track_of, -1, sizeof track_of);
    memset(owner, -1, sizeof owner);
    swaps = unsound = 0;
    n_results = 0;
    snprintf(line, sizeof line, "sequence ! %s%s ! reconstruct max-lines=4000 ! seen",
             now.draw ? "edges ! segments ! " : "", track);
    arris_pipeline *p = arris_parse(line, &err);
    if (!p || arris_check(p, &err) || arris_start(p, &err))
        fail_msg("%s: %s", line, err.text);
    while (arris_wait(p, &m, 1000) != ARRIS_WAIT_ENDED)
        if (m.severity == ARRIS_ERROR)
            fail_msg("%s", m.text);
    assert_int_equal(arris_result(p), 0);
    assert_int_equal(unsound, 0);
    arris_free(p);
}

static inline void play(void (*shoot)(int, arris_pose *, arris_segments *)) {
    now.shoot = shoot;
    play_with("track");
}

/* ---- what came out --------------------------------------------------------------------------- */

/* Whether the point is beside the edge's line by more than `sigmas` of the covariance `cov` (of p
 * when end is 0, of q when it is 1) across it; *mm says how far. */
static inline double sigmas_off(const edge *e, const arris_line *l, int end, double *mm) {
    const double *P = end ? l->q : l->p;
    double u[3], d[3], across = 0, var = 0;
    for (int i = 0; i < 3; i++)
        u[i] = e->q[i] - e->p[i], d[i] = P[i] - e->p[i];
    arris_unit(u);
    double along = arris_dot(u, d);
    for (int i = 0; i < 3; i++)
        d[i] -= along * u[i];
    across = arris_unit(d);
    for (int a = 0, k = 0; a < 6; a++)
        for (int b = a; b < 6; b++, k++)
            if (a / 3 == end && b / 3 == end)
                var += (a == b ? 1 : 2) * l->cov[k] * d[a % 3] * d[b % 3];
    *mm = across;
    return across / sqrt(var);
}

/* The edge that the line is: that of its direction which is nearest. */
static inline int edge_of(const arris_line *l, double *mm) {
    int nearest = -1;
    *mm = (double)INFINITY;
    for (int i = 0; i < n_edges; i++) {
        double u[3], v[3], a, b, w;
        for (int k = 0; k < 3; k++)
            u[k] = world[i].q[k] - world[i].p[k], v[k] = l->q[k] - l->p[k];
        double length = arris_unit(u);
        arris_unit(v);
        for (int k = 0; k < 3; k++)
            v[k] = (l->p[k] + l->q[k]) / 2 - world[i].p[k];
        w = arris_dot(u, v);
        sigmas_off(&world[i], l, 0, &a);
        sigmas_off(&world[i], l, 1, &b);
        if (w > -5 && w < length + 5 && fmax(a, b) < *mm)
            *mm = fmax(a, b), nearest = i;
    }
    return nearest;
}

/* The share of the shorter line that both have. */
static inline double in_common(const arris_line *a, const arris_line *b) {
    double u[3], p = 0, q = 0;
    for (int i = 0; i < 3; i++)
        u[i] = a->q[i] - a->p[i];
    double length = arris_unit(u);
    for (int i = 0; i < 3; i++)
        p += u[i] * (b->p[i] - a->p[i]), q += u[i] * (b->q[i] - a->p[i]);
    return (fmin(fmax(p, q), length) - fmax(fmin(p, q), 0)) / fmin(length, fabs(q - p));
}

/* Every measured line is an edge, to within 5 of its sigmas. Returns how many are, and in *twice
 * how many of them are another of an edge that was there before. */
static inline int true_lines(int *twice) {
    int n = 0;
    *twice = 0;
    for (uint32_t i = 0; i < n_results; i++) {
        const arris_line *l = &result[i];
        double mm, d;
        if (l->state != ARRIS_MEASURED)
            continue;
        int e = edge_of(l, &mm);
        if (e < 0 || fmax(sigmas_off(&world[e], l, 0, &d), sigmas_off(&world[e], l, 1, &d)) > 5)
            fail_msg("line %d is %g mm from edge %d, %g and %g sigmas; of %u views, rms %g px",
                     l->id, mm, e, e < 0 ? 0 : sigmas_off(&world[e], l, 0, &d),
                     e < 0 ? 0 : sigmas_off(&world[e], l, 1, &d), l->views, l->rms);
        for (uint32_t k = 0; k < i; k++)
            *twice += result[k].state == ARRIS_MEASURED && edge_of(&result[k], &d) == e &&
                      in_common(l, &result[k]) > 0.2;
        n++;
    }
    return n;
}

/* The same where none may be measured twice. */
static inline int assert_true_lines(void) {
    int twice, n = true_lines(&twice);
    assert_int_equal(twice, 0);
    return n;
}

static inline bool is_measured(int e) {
    double mm;
    for (uint32_t i = 0; i < n_results; i++)
        if (result[i].state == ARRIS_MEASURED && edge_of(&result[i], &mm) == e)
            return true;
    return false;
}

/* No track went from an edge to another, and each edge was held all the time, but for `gaps`
 * sightings, by one track. */
static inline void assert_one_track_each(int gaps) {
    assert_int_equal(swaps, 0);
    for (int i = 0; i < n_edges; i++) {
        if (changes[i])
            fail_msg("edge %d: another track %d times", i, changes[i]);
        if (held[i] < shown[i] - gaps)
            fail_msg("edge %d: held %d times of %d", i, held[i], shown[i]);
    }
}

/* Where the stages are. Call it first; false when they are not built. */
static inline bool find_stages(void) {
    char path[2 * PATH_MAX], built[PATH_MAX];
    const char *b = getenv("B");
    snprintf(path, sizeof path, "%s/lib/arris", b ? b : "build");
    if (!realpath(path, built)) {
        fprintf(stderr, "%s is not there: run make, and say B= where it built\n", path);
        return false;
    }
    scratch_mkdir("plugins");
    scratch_link("plugins/sequence.so", "tests/plugins/sequence.so");
    snprintf(path, sizeof path, "%s:%s", scratch("plugins"), built);
    setenv("ARRIS_PLUGIN_PATH", path, 1);
    return true;
}

#endif
