/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * mark.c: lines on the faces of a part.
 */
#include "mark.h"

#include <math.h>

#include "arris_geometry.h"

/* Whether a point lies on a face of the part, to within `off` mm. */
static bool on_face(const nominal *m, const place *where, const double X[3], double off) {
    for (uint32_t t = 0; t < m->n_triangles; t++) {
        double v[3][3], n[3], d[3], w[3], a[3];
        bool inside = true;
        for (int k = 0; k < 3; k++)
            place_point(where, m->vertex[m->triangle[t][k]], v[k]);
        for (int k = 0; k < 3; k++) {
            d[k] = v[1][k] - v[0][k];
            w[k] = v[2][k] - v[0][k];
        }
        arris_cross(d, w, n);
        if (!(arris_unit(n) > 0))
            continue;
        for (int i = 0; i < 3 && inside; i++) {
            for (int k = 0; k < 3; k++) {
                d[k] = v[(i + 1) % 3][k] - v[i][k];
                w[k] = X[k] - v[i][k];
            }
            arris_cross(d, w, a);
            inside = fabs(arris_dot(w, n)) < off && arris_dot(a, n) > 0;
        }
        if (inside)
            return true;
    }
    return false;
}

bool mark_possible(const nominal *m, const place *where, const arris_feature *f) {
    double off = f->tolerance + f->U, X[3], Y[3];
    for (int k = 0; k < 3; k++) { /* away from the ends, which lie on a face's border */
        X[k] = 0.9 * f->at[0][k] + 0.1 * f->at[1][k];
        Y[k] = 0.1 * f->at[0][k] + 0.9 * f->at[1][k];
    }
    return on_face(m, where, X, off) && on_face(m, where, Y, off);
}
