/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * writers.h: the file formats as pure functions onto a FILE; ferror() tells whether it was written.
 * The same input gives the same bytes, in the "C" locale. No NaN and no infinity is ever written.
 */
#ifndef WRITERS_H
#define WRITERS_H

#include <stdio.h>

#include "arris_types.h"

/* ---- lines ---------------------------------------------------------------------------------- */

bool all_finite(const double *v, int n);

/* Whether a line is to be written: neither merged nor retired, and its ends are finite. */
bool line_stands(const arris_line *l);

/* Its state, though never measured when a number of it isn't finite. */
enum arris_line_state line_state(const arris_line *l);

/* arris-lines/1 (FORMATS.md), one line object a line of text; what isn't finite is null. */
void json_write(FILE *out, const arris_lines *lines);

/* The measured lines as edges, in mm: PLY (ascii), OBJ (l), DXF (R12, LINE). */
void ply_write(FILE *out, const arris_lines *lines);
void obj_write(FILE *out, const arris_lines *lines);
void dxf_write(FILE *out, const arris_lines *lines);

/* ---- views ---------------------------------------------------------------------------------- */

enum svg_views { SVG_ALL, SVG_XY, SVG_YZ, SVG_ZX };

/* Where the cameras stood: all of them until they are too many, then every second, every fourth...
 */
enum { SVG_CAMERAS = 128 };
typedef struct svg_cameras {
    uint32_t n, seen, every; /* zero to begin with */
    struct {
        double C[3], axis[3]; /* centre, mm; optical axis, unit */
    } at[SVG_CAMERAS];
} svg_cameras;
void svg_add_camera(svg_cameras *c, const arris_pose *pose);

/* The views along the axes side by side (or one of them), with the cameras, as the thesis's figures
 * show them. The axes are in mm, equal in both directions. With a verdict (else NULL) the nominal
 * edges in its colours, and at their ends the deviations, magnified. */
void svg_write(FILE *out, const arris_lines *lines, const svg_cameras *cameras,
               const arris_verdict *verdict, enum svg_views views);

/* ---- the verdict ---------------------------------------------------------------------------- */

/* "PASS", "FAIL" or "INDETERMINATE". */
const char *judgement_name(enum arris_judgement j);

/* arris-verdict/1 (FORMATS.md). `recipe` is the SHA-256 of the recipe's file, or empty. */
void verdict_write(FILE *out, const arris_verdict *v, const char *recipe);

/* ---- tables --------------------------------------------------------------------------------- */

/* segments.csv (FORMATS.md). `frame` is the recording's number; a segment's id is its number in the
 * image, from 1, as in tracks.csv. `track_of` has segments->n places to work in; `tracks` may be
 * NULL. */
void segments_head(FILE *out);
void segments_write(FILE *out, int64_t frame, const arris_segments *segments,
                    const arris_tracks *tracks, int32_t *track_of);

/* tracks.csv: the index matrix. Its width is known at the end only, so the frames go into a spool
 * first. tracks_write reads it from its start; `total` is the number of tracks. Returns 0,
 * ARRIS_E_IO (the spool cannot be read back) or ARRIS_E_MEMORY. */
void tracks_spool(FILE *spool, const arris_tracks *tracks);
int tracks_write(FILE *out, FILE *spool, uint32_t total);

/* ---- pictures ------------------------------------------------------------------------------- */

/* A file in memory: n bytes of the `max` that it has room for. */
typedef struct memory_file {
    uint8_t *data;
    size_t n, max;
} memory_file;

/* Room for any picture of so many bytes as PNG; free(data) releases it. False: no memory. */
bool png_reserve(memory_file *out, size_t grey);

/* A picture as PNG. False when there is no room or no memory for it. */
bool png_encode(memory_file *out, const arris_image *image);

/* A scan as imagesrc plays it: frames.csv, which is to be at `location`, and beside it
 * frames/0000.png and so on, and camera.json when the camera is known. */
typedef struct recording {
    const char *location;
    uint64_t n; /* frames so far */
    memory_file buffer;
} recording;

/* A recording is not written over (EEXIST): it may be the one that is being played. `csv` is
 * frames.csv; `location` must outlive *r; `pose` may be NULL or invalid. The functions
 * return 0 or an errno. recording_free must follow in any case. */
int recording_begin(recording *r, FILE *csv, const char *location, const arris_caps *caps);
int recording_frame(recording *r, FILE *csv, int64_t index, int64_t utime, const arris_image *image,
                    const arris_pose *pose);
void recording_free(recording *r);

#endif
