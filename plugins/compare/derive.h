/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * derive.h: features that derive from two measured edges: their distance, their angle, the corner
 * where they meet. No dependency on the runtime.
 */
#ifndef DERIVE_H
#define DERIVE_H

#include "calibration.h"
#include "judge.h"

enum derived_kind { DERIVED_DISTANCE, DERIVED_ANGLE, DERIVED_CORNER };

/* distance: from the middle of b, square to a, mm; of parallel edges. angle: the one between the
 * nominal edges that is at most 90°, rad. corner: the middle of where they are nearest to each
 * other; its deviation is its distance from the nominal's, mm. */
typedef struct derived {
    enum derived_kind kind;
    uint32_t a, b;    /* edges of the nominal */
    bool obtuse;      /* from p to q the edges enclose more than 90° */
    double nominal;   /* mm or rad; nothing for a corner */
    double tolerance; /* mm or rad; 0: that of the inspection, which an angle hasn't */
    char id[64];
} derived;

enum { DERIVED_MAX = 256 };

/* Reads `distance(a,b)=260:0.5; angle(a,b):0.2; corner(a,b)`: the nominal value (mm, degrees) is
 * that of the model where none is given, a tolerance follows a colon. Returns their number, or
 * ARRIS_E_USAGE. */
int derived_parse(const char *text, const nominal *m, derived *out, fault *f);

/* Fills a feature from the pieces and the lines that measured them; both pieces have one. */
void derived_judge(const derived *d, const nominal *m, const place *where, const calibration *cal,
                   const piece *e, const arris_lines *lines, double k, double tolerance,
                   arris_feature *f);

#endif
