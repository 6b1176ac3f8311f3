/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * box.c: the black box with white painted edges (thesis, section 3.7): its measured lines beside
 * the truth, in three views. The pictures are rendered like the thesis's own, and the robot's
 * reported poses are off by some 0.3 mm, which limits what can be reached.
 */
#include "../common/scan.h"

int main(void) {
    truth t = truth_load("samples/box/truth.json");
    scan s = scan_measure("samples/box/frames.csv", "", "", ""), old;
    score r = scan_score(&s, &t, 3);
    printf("%d lines; of %d observable edges %d are measured\n", r.lines, r.edges, r.found);
    bool good = report("observable edges that are not measured", r.edges - r.found, "", "-", 0);
    good &= report("measured lines that lie on no edge", r.wrong, "", "-", 0);
    good &= report("RMS distance from the true edges", r.rms, "mm", "-", 0.8);
    scan_draw(&s, &t, "box");

    old = scan_measure("samples/box/frames.csv", "", "mode=thesis", "");
    r = scan_score(&old, &t, 3);
    printf("with the thesis's segments: %d lines, %d wrong, %d of %d edges, RMS %.3f mm\n", r.lines,
           r.wrong, r.found, r.edges, r.rms);
    scan_free(&s);
    scan_free(&old);
    return good ? 0 : 1;
}
