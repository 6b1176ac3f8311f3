/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * judge.c: deviations with their expanded uncertainties, and the rule of ISO 14253-1.
 */
#include "judge.h"

#include <math.h>

enum arris_judgement judge(double deviation, double U, double tolerance) {
    return fabs(deviation) + U <= tolerance  ? ARRIS_PASS
           : fabs(deviation) - U > tolerance ? ARRIS_FAIL
                                             : ARRIS_INDETERMINATE;
}

enum arris_judgement judge_both(enum arris_judgement a, enum arris_judgement b) {
    return a == ARRIS_FAIL || b == ARRIS_FAIL   ? ARRIS_FAIL
           : a == ARRIS_PASS && b == ARRIS_PASS ? ARRIS_PASS
                                                : ARRIS_INDETERMINATE;
}

double length_across(double x, double y, double c00, double c01, double c11, double k, double *U) {
    double r = hypot(x, y), a = r > 0 ? x / r : 1, b = r > 0 ? y / r : 0;
    double along = k * sqrt(fmax(a * a * c00 + 2 * a * b * c01 + b * b * c11, 0));
    double square = k * sqrt(fmax(b * b * c00 - 2 * a * b * c01 + a * a * c11, 0));
    *U = hypot(along, hypot(r, square) - r);
    return r;
}

/* The same, negative on the inner side. */
static double deviation(const piece *e, double x, double y, double c00, double c01, double c11,
                        double k, double *U) {
    double r = length_across(x, y, c00, c01, c11, k, U);
    return e->outward && x < 0 ? -r : r;
}

void judge_piece(const piece *e, double k, double tolerance, arris_feature *f) {
    const double(*c)[4] = e->cov;
    double end[2], U[2];
    f->deviation = deviation(e, (e->d[0] + e->d[2]) / 2, (e->d[1] + e->d[3]) / 2,
                             (c[0][0] + 2 * c[0][2] + c[2][2]) / 4,
                             (c[0][1] + c[0][3] + c[2][1] + c[2][3]) / 4,
                             (c[1][1] + 2 * c[1][3] + c[3][3]) / 4, k, &f->U);
    for (int i = 0; i < 2; i++)
        end[i] = deviation(e, e->d[2 * i], e->d[2 * i + 1], c[2 * i][2 * i], c[2 * i][2 * i + 1],
                           c[2 * i + 1][2 * i + 1], k, &U[i]);
    int worst = fabs(end[1]) > fabs(end[0]);
    f->worst = end[worst];
    f->worst_U = U[worst];
    for (int i = 0; i < 2; i++) {
        piece_point(e, i, f->at[i]);
        for (int n = 0; n < 3; n++)
            f->at[i][n] += e->d[2 * i] * e->a[n] + e->d[2 * i + 1] * e->b[n];
    }
    f->tolerance = tolerance;
    f->verdict =
        judge_both(judge(f->deviation, f->U, tolerance), judge(f->worst, f->worst_U, tolerance));
}
