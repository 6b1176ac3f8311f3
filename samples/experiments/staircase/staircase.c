/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * staircase.c: the staircase (thesis, section 3.3, Dataset 1): six steps of 54 mm by 38 mm whose
 * edges are exact lines, seen from above; then, when it is there, the path-traced staircase of
 * ../shared/data/stairs, which has risers, soft shadows and noise, with the true poses.
 *
 * The exact steps are slabs on one another, each brighter than the one below it, and a riser has
 * the grey level of the tread at its foot: one line a step, alone in every picture.
 */
#include <math.h>
#include <stdlib.h>
#include <unistd.h>

#include "../common/scan.h"

#define RENDERED "../shared/data/stairs"
enum { STEPS = 6 };
static const double GOING = 54, RISE = 38, WIDTH = 250, FLOOR = 1000; /* mm */

static scene staircase(void) {
    scene s = scene_new();
    s.ground = 40;
    double end = STEPS * GOING / 2;
    for (int i = 0; i < STEPS; i++) {
        double half = (STEPS - i) * GOING / 2;
        scene_add(&s, end - half, 0, FLOOR - (i + 1) * RISE, half, WIDTH / 2, 0, 70 + 30 * i);
    }
    return s;
}

/* What must be found: the outer edge of each step, along y at the x where its tread begins. */
static truth treads(const scene *s) {
    truth t = truth_of(s);
    for (int i = 0; i < t.n; i++) {
        const edge *e = &t.edge[i];
        t.edge[i].observable = e->p[0] == e->q[0] && e->p[0] < STEPS * GOING / 2 - 1;
    }
    return t;
}

static bool test(const char *list, const truth *t, const char *name, const char *figure,
                 double most) {
    char what[100];
    scan s = scan_measure(list, "", "", "");
    score r = scan_score(&s, t, 3);
    scan old = scan_measure(list, "", "mode=thesis", "");
    score o = scan_score(&old, t, 3);
    printf("%s: %d lines, %d of them wrong; with the thesis's segments %d, %d, RMS %s\n", name,
           r.lines, r.wrong, o.lines, o.wrong, in_mm(o.rms).s);
    snprintf(what, sizeof what, "%s: of %d edges are not measured", name, r.edges);
    bool good = report(what, r.edges - r.found, "", "-", 0);
    snprintf(what, sizeof what, "%s: RMS distance from the true edges", name);
    good &= report(what, r.rms, "mm", "-", most);
    scan_draw(&s, t, figure);
    scan_free(&s);
    scan_free(&old);
    return good;
}

int main(void) {
    scene s = staircase();
    truth t = treads(&s);
    motion m = motion_along_x(60, 4.1);
    char *exact = scene_render(&s, &m, 1, "staircase");
    bool good = test(exact, &t, "exact", "staircase", 0.1);
    free(exact);
    if (access(RENDERED "/truth_poses.csv", R_OK)) {
        printf("there is no rendered staircase in " RENDERED ": left out\n");
        return good ? 0 : 1;
    }
    t = truth_load(RENDERED "/truth.json");
    good &= test(RENDERED "/truth_poses.csv", &t, "rendered", "staircase-rendered", 0.5);
    return good ? 0 : 1;
}
