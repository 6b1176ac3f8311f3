/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * nearest.c: the name that was probably meant, by Levenshtein's edit distance.
 */
#include <string.h>

#include "internal.h"

enum { LONGEST = 32 };

static unsigned distance(const char *a, const char *b) {
    unsigned row[LONGEST + 1];
    size_t n = strlen(b);
    for (unsigned j = 0; j <= n; j++)
        row[j] = j;
    for (unsigned i = 0; a[i]; i++) {
        unsigned diagonal = row[0];
        row[0] = i + 1;
        for (size_t j = 0; j < n; j++) {
            unsigned best = diagonal + (a[i] != b[j]);
            diagonal = row[j + 1];
            if (row[j] + 1 < best)
                best = row[j] + 1;
            if (diagonal + 1 < best)
                best = diagonal + 1;
            row[j + 1] = best;
        }
    }
    return row[n];
}

void nearest_offer(nearest *n, const char *candidate) {
    if (strlen(n->word) > LONGEST || strlen(candidate) > LONGEST)
        return;
    unsigned d = distance(n->word, candidate);
    if (!n->best || d < n->distance) {
        n->best = candidate;
        n->distance = d;
    }
}

const char *nearest_result(const nearest *n) {
    return n->best && n->distance <= 1 + strlen(n->word) / 3 ? n->best : NULL;
}
