/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * mark.h: what may be a mark on a face and no edge. No dependency on the runtime.
 */
#ifndef MARK_H
#define MARK_H

#include "match.h"

/* A line on a face may be paint, a decal or a scratch there as well as the edge: it fails nothing.
 * True when f->at, as it was measured, lies on a face of the nominal `m` at `where`, to within
 * f->tolerance and f->U. */
bool mark_possible(const nominal *m, const place *where, const arris_feature *f);

#endif
