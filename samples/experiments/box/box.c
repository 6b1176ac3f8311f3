/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * box.c: the black box with white painted edges (thesis, section 3.7): its measured lines beside
 * the truth, in three views. The pictures are rendered like the thesis's own. With the poses as the
 * robot reports them, off by some 0.3 mm, which limits what can be reached; and with the true ones,
 * to see the vision alone.
 */
#include "../common/scan.h"

static bool test(const truth *edges, const char *list, const char *name, double most,
                 const char *figure) {
    char what[100];
    scan s = scan_measure(list, "", "", ""), old = scan_measure(list, "", "mode=thesis", "");
    score r = scan_score(&s, edges, 3), o = scan_score(&old, edges, 3);
    printf(
        "%s: %d lines; with the thesis's segments %d, %d of them wrong, %d of %d edges, RMS %s\n",
        name, r.lines, o.lines, o.wrong, o.found, o.edges, in_mm(o.rms).s);
    snprintf(what, sizeof what, "%s: of %d edges are not measured", name, r.edges);
    bool good = report(what, r.edges - r.found, "", "-", 0);
    snprintf(what, sizeof what, "%s: measured lines that lie on no edge", name);
    good &= report(what, r.wrong, "", "-", 0);
    snprintf(what, sizeof what, "%s: RMS distance from the true edges", name);
    good &= report(what, r.rms, "mm", "-", most);
    scan_draw(&s, edges, figure);
    scan_free(&s);
    scan_free(&old);
    return good;
}

int main(void) {
    truth t = truth_load("samples/box/truth.json");
    bool good = test(&t, "samples/box/frames.csv", "reported poses", 0.8, "box");
    good &=
        test(&t, "samples/experiments/data/box/frames.csv", "true poses", 0.15, "box-true-poses");
    return good ? 0 : 1;
}
