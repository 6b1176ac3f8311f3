/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * csv.c: segments.csv and tracks.csv of FORMATS.md.
 */
#include <math.h>
#include <stdlib.h>

#include "writers.h"

/* ---- segments.csv --------------------------------------------------------------------------- */

void segments_head(FILE *out) {
    fprintf(out, "frame,id,track,x1,y1,x2,y2,offset_sigma,angle_sigma,lo,hi,chi2\n");
}

/* What isn't finite stays empty. */
static void field(FILE *out, const char *format, double value) {
    fputc(',', out);
    if (isfinite(value))
        fprintf(out, format, value);
}

static void row(FILE *out, int64_t frame, uint32_t id, int32_t track, const arris_segment *s) {
    fprintf(out, "%lld,%u,%d", (long long)frame, id, track);
    const double ends[4] = {s->x1, s->y1, s->x2, s->y2};
    for (int k = 0; k < 4; k++)
        field(out, "%.4f", ends[k]);
    field(out, "%.5g", sqrt(s->cov[0]));
    field(out, "%.5g", sqrt(s->cov[2]));
    field(out, "%.2f", (double)s->lo);
    field(out, "%.2f", (double)s->hi);
    field(out, "%.4g", (double)s->chi2);
    fputc('\n', out);
}

void segments_write(FILE *out, int64_t frame, const arris_segments *segments,
                    const arris_tracks *tracks, int32_t *track_of) {
    for (uint32_t i = 0; i < segments->n; i++)
        track_of[i] = -1;
    for (uint32_t i = 0; tracks && i < tracks->n; i++)
        if (tracks->item[i].segment >= 0 && (uint32_t)tracks->item[i].segment < segments->n)
            track_of[tracks->item[i].segment] = tracks->item[i].id;
    for (uint32_t i = 0; i < segments->n; i++)
        row(out, frame, i + 1, track_of[i], &segments->item[i]);
}

/* ---- tracks.csv ----------------------------------------------------------------------------- */

/* A frame in the spool: the number of its tracks, then the tracks as they are. */
void tracks_spool(FILE *spool, const arris_tracks *tracks) {
    fwrite(&tracks->n, sizeof tracks->n, 1, spool);
    fwrite(tracks->item, sizeof *tracks->item, tracks->n, spool);
}

static void matrix_row(FILE *out, const int32_t *cell, uint32_t n) {
    for (uint32_t i = 0; i < n; i++)
        fprintf(out, i ? ",%d" : "%d", cell[i]);
    fputc('\n', out);
}

/* Reads n tracks into the cells of a row. */
static bool read_row(FILE *spool, uint32_t n, int32_t *cell, uint32_t total) {
    arris_track t;
    for (uint32_t i = 0; i < n; i++) {
        if (fread(&t, sizeof t, 1, spool) != 1)
            return false;
        if (t.id >= 0 && (uint32_t)t.id < total)
            cell[t.id] = t.segment + 1;
    }
    return true;
}

int tracks_write(FILE *out, FILE *spool, uint32_t total) {
    int32_t *cell = malloc((total + (size_t)1) * sizeof *cell);
    uint32_t n;
    bool good;
    if (!cell)
        return ARRIS_E_MEMORY;
    good = fseek(spool, 0, SEEK_SET) == 0;
    while (good && fread(&n, sizeof n, 1, spool) == 1) {
        for (uint32_t i = 0; i < total; i++)
            cell[i] = 0;
        good = read_row(spool, n, cell, total);
        matrix_row(out, cell, total);
    }
    free(cell);
    return good && !ferror(spool) ? 0 : ARRIS_E_IO;
}
