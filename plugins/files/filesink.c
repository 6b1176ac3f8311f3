/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * filesink.c: the stage `filesink`: writes a result to a file, in the format of its name's ending.
 * The formats are in writers.h; the file appears complete or not at all (output.h).
 */
#include "arris_plugin.h"

#include <errno.h>
#include <locale.h>
#include <sha256.h>
#include <stdlib.h>
#include <string.h>

#include "html.h"
#include "output.h"
#include "writers.h"

struct filesink;

typedef int step(arris_stage *s, struct filesink *k, const arris_frame *f);

/* What makes a kind of file; what it doesn't need is NULL. */
typedef struct writer {
    const char *ending;
    uint32_t needs, wants;
    step *begin, *frame, *end;
    void (*lines)(FILE *out, const arris_lines *lines); /* for end_lines */
} writer;

struct filesink {
    const char *location, *recipe;
    int32_t view;
    const writer *writer;
    output out;
    locale_t c; /* numbers have a point, whatever the application's language is */

    svg_cameras cameras;
    FILE *spool;       /* of tracks.csv */
    uint32_t total;    /* tracks ever started */
    int32_t *track_of; /* of segments.csv: by segment */
    char recipe_hash[65];
    report report;
    const arris_caps *caps; /* in setup */
    recording recording;    /* of frames.csv */
};

static const arris_prop props[] = {
    ARRIS_P_STRING(struct filesink, location, "location", NULL,
                   "the file to write; its ending says what is written"),
    ARRIS_P_INFILE(struct filesink, recipe, "recipe", NULL,
                   "of verdict.json and .html: the recipe whose SHA-256 they state"),
    ARRIS_P_ENUM(struct filesink, view, "view", "all", "all|xy|yz|zx", "of an .svg"),
};

static int cannot_write(arris_stage *s, const struct filesink *k, int error) {
    const char *hint = error == ENOENT   ? "create the folder first"
                       : error == ENOSPC ? "free some space, or write to another disk"
                       : error == EEXIST ? "a recording is not written over: name another folder"
                                         : NULL;
    return arris_fail(s, ARRIS_E_IO, hint, "cannot write %s: %s", k->location, strerror(error));
}

/* ---- files of lines ------------------------------------------------------------------------- */

static int end_lines(arris_stage *s, struct filesink *k, const arris_frame *f) {
    const arris_lines *lines = arris_layer_get(f, ARRIS_LINES);
    if (!lines)
        return arris_fail(s, ARRIS_E_INTERNAL, NULL, "no lines came with the end of the stream");
    if (k->writer->lines)
        k->writer->lines(k->out.file, lines);
    else
        svg_write(k->out.file, lines, &k->cameras, NULL, (enum svg_views)k->view);
    return 0;
}

static int frame_svg(arris_stage *s, struct filesink *k, const arris_frame *f) {
    (void)s;
    const arris_pose *pose = arris_layer_get(f, ARRIS_POSE);
    if (pose)
        svg_add_camera(&k->cameras, pose);
    return 0;
}

/* ---- verdict.json, .html --------------------------------------------------------------------- */

static int begin_verdict(arris_stage *s, struct filesink *k, const arris_frame *f) {
    (void)f;
    if (k->recipe && !SHA256File(k->recipe, k->recipe_hash))
        return arris_fail(s, ARRIS_E_INPUT, NULL, "cannot read the recipe %s: %s", k->recipe,
                          strerror(errno));
    return 0;
}

static int end_verdict(arris_stage *s, struct filesink *k, const arris_frame *f) {
    const arris_verdict *v = arris_layer_get(f, ARRIS_VERDICT);
    if (!v)
        return arris_fail(s, ARRIS_E_INTERNAL, NULL, "no verdict came with the end of the stream");
    verdict_write(k->out.file, v, k->recipe_hash);
    return 0;
}

static int frame_html(arris_stage *s, struct filesink *k, const arris_frame *f) {
    const arris_verdict *v = arris_layer_get(f, ARRIS_VERDICT);
    const arris_image *image = arris_layer_get(f, ARRIS_IMAGE);
    const arris_pose *pose = arris_layer_get(f, ARRIS_POSE);
    frame_svg(s, k, f);
    if (v && image && !k->report.grey && !report_begin(&k->report, image->width, image->height))
        return arris_fail(s, ARRIS_E_MEMORY, NULL, "no memory for a frame");
    if (v && image && pose)
        report_frame(&k->report, v, image, pose);
    return 0;
}

static int end_html(arris_stage *s, struct filesink *k, const arris_frame *f) {
    const arris_verdict *v = arris_layer_get(f, ARRIS_VERDICT);
    const arris_lines *lines = arris_layer_get(f, ARRIS_LINES);
    if (!v || !lines)
        return arris_fail(s, ARRIS_E_INTERNAL, NULL, "no verdict came with the end of the stream");
    report_write(k->out.file, &k->report, v, lines, &k->cameras, k->recipe_hash);
    return 0;
}

/* ---- segments.csv --------------------------------------------------------------------------- */

static int begin_segments(arris_stage *s, struct filesink *k, const arris_frame *f) {
    (void)f;
    size_t n = arris_capacity(s, ARRIS_SEGMENTS, NULL);
    k->track_of = malloc((n + 1) * sizeof *k->track_of);
    if (!k->track_of)
        return arris_fail(s, ARRIS_E_MEMORY, NULL, "no memory for %zu segments", n);
    segments_head(k->out.file);
    return 0;
}

static int frame_segments(arris_stage *s, struct filesink *k, const arris_frame *f) {
    (void)s;
    segments_write(k->out.file, arris_frame_index(f), arris_layer_get(f, ARRIS_SEGMENTS),
                   arris_layer_get(f, ARRIS_TRACKS), k->track_of);
    return 0;
}

/* ---- tracks.csv ----------------------------------------------------------------------------- */

static int begin_tracks(arris_stage *s, struct filesink *k, const arris_frame *f) {
    (void)f;
    k->spool = output_scratch(k->location);
    return k->spool ? 0 : cannot_write(s, k, errno);
}

static int frame_tracks(arris_stage *s, struct filesink *k, const arris_frame *f) {
    const arris_tracks *tracks = arris_layer_get(f, ARRIS_TRACKS);
    tracks_spool(k->spool, tracks);
    k->total = tracks->total;
    int error = output_error(k->spool);
    return error ? cannot_write(s, k, error) : 0;
}

static int end_tracks(arris_stage *s, struct filesink *k, const arris_frame *f) {
    (void)f;
    int rc = tracks_write(k->out.file, k->spool, k->total);
    if (rc == ARRIS_E_MEMORY)
        return arris_fail(s, rc, NULL, "no memory for a row of %u tracks", k->total);
    return rc ? cannot_write(s, k, errno ? errno : EIO) : 0;
}

/* ---- frames.csv ----------------------------------------------------------------------------- */

static int begin_recording(arris_stage *s, struct filesink *k, const arris_frame *f) {
    (void)f;
    int error = recording_begin(&k->recording, k->out.file, k->location, k->caps);
    return error ? cannot_write(s, k, error) : 0;
}

static int frame_recording(arris_stage *s, struct filesink *k, const arris_frame *f) {
    int error =
        recording_frame(&k->recording, k->out.file, arris_frame_index(f), arris_frame_utime(f),
                        arris_layer_get(f, ARRIS_IMAGE), arris_layer_get(f, ARRIS_POSE));
    return error ? cannot_write(s, k, error) : 0;
}

/* ---- the kinds of file ---------------------------------------------------------------------- */

enum {
    LINES = ARRIS_BIT(ARRIS_LINES),
    POSE = ARRIS_BIT(ARRIS_POSE),
    SEGMENTS = ARRIS_BIT(ARRIS_SEGMENTS),
    TRACKS = ARRIS_BIT(ARRIS_TRACKS),
    VERDICT = ARRIS_BIT(ARRIS_VERDICT),
    IMAGE = ARRIS_BIT(ARRIS_IMAGE)
};

static const writer writers[] = {
    {"verdict.json", VERDICT, 0, begin_verdict, NULL, end_verdict, NULL},
    {".html", VERDICT | LINES, POSE | IMAGE, begin_verdict, frame_html, end_html, NULL},
    {".json", LINES, 0, NULL, NULL, end_lines, json_write},
    {".ply", LINES, 0, NULL, NULL, end_lines, ply_write},
    {".obj", LINES, 0, NULL, NULL, end_lines, obj_write},
    {".dxf", LINES, 0, NULL, NULL, end_lines, dxf_write},
    {".svg", LINES, POSE, NULL, frame_svg, end_lines, NULL},
    {"segments.csv", SEGMENTS, TRACKS, begin_segments, frame_segments, NULL, NULL},
    {"tracks.csv", TRACKS, 0, begin_tracks, frame_tracks, end_tracks, NULL},
    {"frames.csv", IMAGE, POSE, begin_recording, frame_recording, NULL, NULL},
};
enum { N_WRITERS = sizeof writers / sizeof *writers };

static bool ends_with(const char *name, const char *ending) {
    size_t n = strlen(name), m = strlen(ending);
    return n >= m && strcmp(name + n - m, ending) == 0;
}

static int unknown_ending(arris_stage *s, const struct filesink *k) {
    char known[100] = "";
    for (int i = 0; i < N_WRITERS; i++)
        snprintf(known + strlen(known), sizeof known - strlen(known), "%s%s", i ? ", " : "",
                 writers[i].ending);
    return arris_fail(s, ARRIS_E_USAGE, "the name's ending says what is written",
                      "location=%s ends in none of %s", k->location, known);
}

/* ---- the stage ------------------------------------------------------------------------------ */

static int settle(arris_stage *s, void *self, arris_layers *l) {
    struct filesink *k = self;
    if (!k->location)
        return arris_fail(s, ARRIS_E_USAGE, "for example location=lines.json",
                          "the location of the file is missing");
    for (int i = 0; i < N_WRITERS && !k->writer; i++)
        if (ends_with(k->location, writers[i].ending))
            k->writer = &writers[i];
    if (!k->writer)
        return unknown_ending(s, k);
    if (k->view != SVG_ALL && k->writer->frame != frame_svg)
        return arris_fail(s, ARRIS_E_USAGE, NULL, "only an .svg has a view");
    *l = (arris_layers){.needs = k->writer->needs, .wants = k->writer->wants};
    return 0;
}

/* Runs a step and looks at what came of its writing; after an error nothing of the file remains. */
static int run(arris_stage *s, struct filesink *k, step *todo, const arris_frame *f) {
    if (!todo || !k->out.file) /* closed: it has failed before */
        return 0;
    locale_t old = uselocale(k->c);
    errno = 0;
    int rc = todo(s, k, f), error = rc ? 0 : output_error(k->out.file);
    uselocale(old);
    if (error)
        rc = cannot_write(s, k, error);
    if (rc)
        output_abandon(&k->out);
    return rc;
}

static int setup(arris_stage *s, void *self, arris_caps *caps) {
    struct filesink *k = self;
    k->caps = caps;
    k->c = newlocale(LC_NUMERIC_MASK, "C", 0);
    if (!k->c)
        return arris_fail(s, ARRIS_E_MEMORY, NULL, "no memory for the numbers' format");
    int error = output_open(&k->out, k->location);
    return error ? cannot_write(s, k, error) : run(s, k, k->writer->begin, NULL);
}

static int process(arris_stage *s, void *self, arris_frame *f) {
    struct filesink *k = self;
    return run(s, k, k->writer->frame, f);
}

static int finish(arris_stage *s, void *self, arris_frame *f) {
    struct filesink *k = self;
    int rc = run(s, k, k->writer->end, f);
    if (rc || !k->out.file)
        return rc;
    int error = output_commit(&k->out);
    return error ? cannot_write(s, k, error) : 0;
}

static void close_filesink(arris_stage *s, void *self) {
    struct filesink *k = self;
    (void)s;
    output_abandon(&k->out);
    if (k->spool)
        fclose(k->spool);
    free(k->track_of);
    report_end(&k->report);
    recording_free(&k->recording);
    if (k->c)
        freelocale(k->c);
}

const arris_stage_desc stage_filesink = {
    .size = sizeof(arris_stage_desc),
    .name = "filesink",
    .summary = "writes lines (.json .ply .obj .dxf .svg), verdict.json, a report (.html), "
               "segments.csv, tracks.csv, or the frames themselves (frames.csv with pictures and "
               "camera.json beside it)",
    .example = "imagesrc location=frames.csv ! edges ! undistort ! segments "
               "! filesink location=segments.csv",
    .flags = ARRIS_SINK,
    .layers = {.wants = LINES | POSE | SEGMENTS | TRACKS | VERDICT | IMAGE},
    .self_size = sizeof(struct filesink),
    .props = props,
    .n_props = sizeof props / sizeof *props,
    .settle = settle,
    .setup = setup,
    .process = process,
    .finish = finish,
    .close = close_filesink,
};
