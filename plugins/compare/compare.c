/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * compare.c: the stage `compare`: the measured lines against the nominal edges of a part, judged by
 * ISO 14253-1. nominal.h reads the edges, align.h lays them on the lines, match.h finds which line
 * measured which, judge.h and derive.h conclude, mark.h doubts, sight.h tells what the path could
 * see.
 */
#include <fnmatch.h>
#include <math.h>
#include <sha256.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "arris_plugin.h"

#include "align.h"
#include "calibration.h"
#include "derive.h"
#include "judge.h"
#include "mark.h"
#include "sight.h"

enum { ALIGN_NONE, ALIGN_DATUM, ALIGN_BEST_FIT };

struct compare {
    const char *model, *features, *datum, *derived_text, *calibration_file;
    double tolerance, coverage, search, crease, min_length;
    int32_t align, every;

    const arris_camera *camera;
    nominal nominal;
    char model_hash[65], camera_hash[65];
    calibration calibration;
    sight sight;
    place where;
    piece *piece; /* by edge, as all below */
    bool *judged, *is_datum;
    uint32_t *seen;
    candidates *candidates;
    int32_t *owner; /* by line */
    derived *derived;
    int n_derived;
    bool named; /* the user has said which features count */
};

static const arris_prop props[] = {
    ARRIS_P_INFILE(struct compare, model, "model", NULL,
                   "the nominal edges: .json, .obj, .stl, .ply, .dxf, in mm"),
    ARRIS_P_DOUBLE_OR(struct compare, tolerance, "tolerance", "missing", "missing", 1e-6, 1e6, "mm",
                      "how far an edge may be off"),
    ARRIS_P_DOUBLE(struct compare, coverage, "coverage", "2", 1, 10, NULL,
                   "k of the expanded uncertainty U = k u"),
    ARRIS_P_STRING(struct compare, features, "features", NULL,
                   "which edges are judged: ids or patterns (top-*), with commas; all that the "
                   "path can see unless given"),
    ARRIS_P_ENUM(struct compare, align, "align", "none", "none|datum|best-fit",
                 "how the model is laid on the part: as it stands, on the datum edges, on all"),
    ARRIS_P_STRING(struct compare, datum, "datum", NULL, "ids of the datum edges, with commas"),
    ARRIS_P_STRING(struct compare, derived_text, "derived", NULL,
                   "further features: distance(a,b)=260:0.5; angle(a,b):0.2; corner(a,b); nominal "
                   "and tolerance in mm, degrees"),
    ARRIS_P_DOUBLE(struct compare, search, "search", "15", 1e-3, 1e6, "mm",
                   "how far from where it should be an edge is looked for"),
    ARRIS_P_DOUBLE(struct compare, crease, "crease-angle", "25", 0, 180, "degrees",
                   "faces of a mesh that meet at more form an edge"),
    ARRIS_P_DOUBLE(struct compare, min_length, "min-length", "15", 0, 1e6, "mm",
                   "shorter nominal edges are left out"),
    ARRIS_P_INFILE(struct compare, calibration_file, "calibration", NULL,
                   "a camera.json whose \"calibration\" states its uncertainty, which U then has "
                   "in it"),
    ARRIS_P_INT(struct compare, every, "every", "10", 1, 1000000, "frames",
                "a running verdict is given so often"),
};

/* ---- what is judged -------------------------------------------------------------------------- */

/* The next of some words with commas between; *at moves on. Its length. */
static size_t next_word(const char **at, const char **word) {
    *word = *at + strspn(*at, ", \t\n");
    size_t n = strcspn(*word, ", \t\n");
    *at = *word + n;
    return n;
}

static int mark(arris_stage *s, const struct compare *c, const char *what, const char *words,
                bool patterns, bool *set) {
    const char *word;
    for (size_t n; (n = next_word(&words, &word)) > 0;) {
        char pattern[128];
        uint32_t found = 0;
        if (n >= sizeof pattern)
            return arris_fail(s, ARRIS_E_USAGE, NULL, "%s: '%.*s' is too long", what, (int)n, word);
        snprintf(pattern, sizeof pattern, "%.*s", (int)n, word);
        for (uint32_t i = 0; i < c->nominal.n_edges; i++) {
            if (c->nominal.edge[i].mark)
                continue;
            if (patterns ? fnmatch(pattern, c->nominal.edge[i].id, 0) != 0
                         : strcmp(pattern, c->nominal.edge[i].id) != 0)
                continue;
            if (set[i] && !patterns)
                return arris_fail(s, ARRIS_E_USAGE, "name every edge once",
                                  "%s: the edge '%s' is named twice", what, pattern);
            set[i] = true;
            found++;
        }
        if (!found)
            return arris_fail(s, ARRIS_E_USAGE, "`arris inspect --edges MODEL` lists them",
                              "%s: the model has no edge '%s'", what, pattern);
    }
    return 0;
}

static int choose(arris_stage *s, struct compare *c) {
    fault why;
    c->named = c->features && c->features[strspn(c->features, ", \t\n")];
    for (uint32_t i = 0; i < c->nominal.n_edges; i++)
        c->judged[i] = !c->named && !c->nominal.edge[i].mark;
    int r = c->named ? mark(s, c, "features", c->features, true, c->judged) : 0;
    if (r == 0 && c->datum)
        r = mark(s, c, "datum", c->datum, false, c->is_datum);
    if (r)
        return r;
    c->n_derived =
        derived_parse(c->derived_text ? c->derived_text : "", &c->nominal, c->derived, &why);
    return c->n_derived < 0 ? arris_fail(s, c->n_derived, why.hint, "derived: %s", why.text) : 0;
}

/* ---- setting up ------------------------------------------------------------------------------ */

static int check_words(arris_stage *s, const struct compare *c) {
    if (!c->model)
        return arris_fail(s, ARRIS_E_USAGE, "for example model=box.obj", "the model is missing");
    if (c->tolerance < 0)
        return arris_fail(s, ARRIS_E_USAGE, "for example tolerance=0.5",
                          "the tolerance is missing");
    if ((c->align == ALIGN_DATUM) != (c->datum != NULL))
        return arris_fail(s, ARRIS_E_USAGE, "for example align=datum datum=a,b,c",
                          "align=datum and datum= go together");
    return 0;
}

/* The camera model's own name: SHA-256 of its numbers as text. */
static void hash_camera(const arris_camera *c, char hash[65]) {
    char text[512];
    int n = snprintf(text, sizeof text,
                     "%d %d %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g "
                     "%.17g\n",
                     c->width, c->height, c->fx, c->fy, c->skew, c->cx, c->cy, c->k1, c->k2, c->p1,
                     c->p2, c->k3);
    SHA256Data((const uint8_t *)text, (size_t)n, hash);
}

static int allocate(arris_stage *s, struct compare *c, size_t lines) {
    size_t n = c->nominal.n_edges;
    c->piece = calloc(n, sizeof *c->piece);
    c->judged = calloc(n, sizeof *c->judged);
    c->is_datum = calloc(n, sizeof *c->is_datum);
    c->seen = calloc(n, sizeof *c->seen);
    c->candidates = calloc(n, sizeof *c->candidates);
    c->owner = calloc(lines + 1, sizeof *c->owner);
    c->derived = calloc(DERIVED_MAX, sizeof *c->derived);
    if (c->piece && c->judged && c->is_datum && c->seen && c->candidates && c->owner && c->derived)
        return 0;
    return arris_fail(s, ARRIS_E_MEMORY, NULL, "no memory for %zu edges", n);
}

static int setup(arris_stage *s, void *self, arris_caps *caps) {
    struct compare *c = self;
    size_t lines = arris_capacity(s, ARRIS_LINES, NULL);
    fault why = {.hint = NULL};
    int r = check_words(s, c);
    if (r)
        return r;
    if (!caps->camera)
        return arris_fail(s, ARRIS_E_INPUT, "give the source a camera.json",
                          "the stream has no camera model");
    c->camera = caps->camera;
    hash_camera(c->camera, c->camera_hash);
    r = nominal_read(&c->nominal, c->model, c->crease * 0.017453292519943295, c->min_length, &why);
    if (r == 0 && c->calibration_file)
        r = calibration_read(&c->calibration, c->calibration_file, &why);
    if (r)
        return arris_fail(s, r, why.hint, "%s", why.text);
    if (!SHA256File(c->model, c->model_hash))
        return arris_fail(s, ARRIS_E_IO, NULL, "cannot read %s", c->model);
    if ((r = allocate(s, c, lines)) || (r = choose(s, c)))
        return r;
    place_identity(&c->where, &c->nominal);
    return arris_reserve(s, ARRIS_VERDICT, c->nominal.n_edges + (size_t)c->n_derived, lines);
}

/* ---- judging --------------------------------------------------------------------------------- */

static const double ALONG_MOTION = 0.02; /* rad, of sight_swing */

static bool lay_datum(const struct compare *c) {
    for (uint32_t i = 0; i < c->nominal.n_edges; i++)
        if (c->is_datum[i] && c->piece[i].line < 0)
            return false;
    return true;
}

/* Lays the model and matches it. False: it could not be aligned as asked. */
static bool lay(struct compare *c, const arris_lines *lines) {
    place_identity(&c->where, &c->nominal);
    if (c->align != ALIGN_NONE) {
        const bool *use = c->align == ALIGN_DATUM ? c->is_datum : NULL;
        return align(&c->where, &c->nominal, c->piece, use, lines, c->search, c->candidates,
                     c->owner) > 0 &&
               (c->align == ALIGN_BEST_FIT || lay_datum(c));
    }
    for (uint32_t i = 0; i < c->nominal.n_edges; i++)
        piece_place(&c->piece[i], &c->nominal.edge[i], &c->where);
    match(c->piece, c->nominal.n_edges, lines, c->search, c->candidates, c->owner);
    return true;
}

static const char *why_not(const struct compare *c, const arris_feature *f, const piece *e,
                           bool aligned, bool unseen) {
    return !aligned ? "the model could not be aligned"
           : unseen ? "the camera's path does not see it"
           : e->line < 0 && sight_swing(&c->sight, e) < ALONG_MOTION
               ? "it runs along the camera's motion, which cannot measure it"
           : e->line < 0                       ? "nothing was measured near it"
           : 2 * (e->to - e->from) < e->length ? "less than half of it was measured"
           : f->U > f->tolerance               ? "its uncertainty is above the tolerance"
                                 : "the tolerance's limit lies within its uncertainty";
}

static arris_feature *begin(arris_verdict *v, const char *id, double tolerance) {
    arris_feature *f = &v->item[v->n++];
    *f = (arris_feature){.deviation = NAN,
                         .U = NAN,
                         .worst = NAN,
                         .worst_U = NAN,
                         .straightness = NAN,
                         .tolerance = tolerance,
                         .line = -1,
                         .verdict = ARRIS_INDETERMINATE};
    snprintf(f->id, sizeof f->id, "%s", id);
    for (int i = 0; i < 3; i++)
        f->p[i] = f->q[i] = f->at[0][i] = f->at[1][i] = NAN;
    return f;
}

/* mm: what the picture's scatter about the line is on the part. */
static double straightness(const struct compare *c, const arris_line *l) {
    double d[3];
    if (!c->sight.n)
        return NAN;
    const arris_pose *pose = &c->sight.pose[c->sight.n / 2];
    for (int k = 0; k < 3; k++)
        d[k] = (l->p[k] + l->q[k]) / 2 - pose->C[k];
    return l->rms * fabs(arris_dot(pose->R + 6, d)) / c->camera->fx;
}

static void judge_edge(const struct compare *c, arris_verdict *v, uint32_t i, bool aligned,
                       bool final, const arris_lines *lines) {
    const nominal_edge *n = &c->nominal.edge[i];
    piece e = c->piece[i];
    bool unseen = final && c->seen[i] == 0, marked = false;
    if (unseen && !c->named)
        return;
    arris_feature *f = begin(v, n->id, n->tolerance > 0 ? n->tolerance : c->tolerance);
    for (int k = 0; k < 3; k++) {
        f->p[k] = e.p[k];
        f->q[k] = e.p[k] + e.length * e.u[k];
    }
    if (aligned && !unseen && e.line >= 0) {
        align_spread(&c->where, &e);
        calibration_spread(&c->calibration, &e);
        judge_piece(&e, c->coverage, f->tolerance, f);
        f->line = lines->item[e.line].id;
        f->straightness = straightness(c, &lines->item[e.line]);
        marked = f->verdict == ARRIS_FAIL && mark_possible(&c->nominal, &c->where, f);
        if (marked)
            f->verdict = ARRIS_INDETERMINATE;
        if (f->verdict == ARRIS_PASS && 2 * (e.to - e.from) < e.length)
            f->verdict = ARRIS_INDETERMINATE;
    }
    if (f->verdict == ARRIS_INDETERMINATE)
        f->reason = marked ? "what was measured near it lies on a face: the edge, or a mark there"
                           : why_not(c, f, &e, aligned, unseen);
}

static void judge_derived(const struct compare *c, arris_verdict *v, const derived *d, bool aligned,
                          const arris_lines *lines) {
    arris_feature *f = begin(v, d->id, d->tolerance > 0 ? d->tolerance : c->tolerance);
    const piece *a = &c->piece[d->a], *b = &c->piece[d->b];
    f->is_angle = d->kind == DERIVED_ANGLE;
    if (aligned && a->line >= 0 && b->line >= 0)
        derived_judge(d, &c->nominal, &c->where, &c->calibration, c->piece, lines, c->coverage,
                      c->tolerance, f);
    if (f->verdict == ARRIS_INDETERMINATE)
        f->reason = !aligned                     ? "the model could not be aligned"
                    : a->line < 0 || b->line < 0 ? "one of its edges was not measured"
                    : f->U > f->tolerance        ? "its uncertainty is above the tolerance"
                                                 : "the tolerance's limit lies within its "
                                                   "uncertainty";
}

/* Whether some edge accounts for a line that none owns: another piece of an edge. */
static bool explained(const struct compare *c, const arris_line *l) {
    for (uint32_t i = 0; i < c->nominal.n_edges; i++) {
        piece e = c->piece[i];
        double own = c->nominal.edge[i].tolerance;
        if (piece_compare(&e, l, (own > 0 ? own : c->tolerance) / 3) < 9)
            return true;
    }
    return false;
}

static void find_extra(const struct compare *c, arris_verdict *v, const arris_lines *lines) {
    for (uint32_t k = 0; k < lines->n; k++) {
        const arris_line *l = &lines->item[k];
        if (l->state != ARRIS_MEASURED || l->change == ARRIS_MERGED || l->change == ARRIS_RETIRED ||
            c->owner[k] >= 0 || explained(c, l))
            continue;
        if (v->n_extra < v->max_extra)
            v->extra[v->n_extra++] = l->id;
        else
            v->lost_extra++;
    }
}

static int conclude(arris_stage *s, struct compare *c, const arris_lines *lines, arris_verdict *v,
                    bool final) {
    if (c->sight.n) {
        const arris_pose *pose = &c->sight.pose[c->sight.n / 2];
        memcpy(c->calibration.C, pose->C, sizeof pose->C);
        memcpy(c->calibration.R, pose->R, sizeof pose->R);
    }
    bool aligned = lay(c, lines);
    if (final && sight_count(&c->sight, c->camera, &c->nominal, &c->where, c->piece, c->seen))
        return arris_fail(s, ARRIS_E_MEMORY, NULL, "no memory to see what the path can see");
    v->tolerance = c->tolerance;
    v->coverage_factor = c->coverage;
    memcpy(v->model, c->model_hash, sizeof v->model);
    memcpy(v->calibration, c->camera_hash, sizeof v->calibration);
    for (uint32_t i = 0; i < c->nominal.n_edges; i++)
        if (c->judged[i])
            judge_edge(c, v, i, aligned, final, lines);
    for (int i = 0; i < c->n_derived; i++)
        judge_derived(c, v, &c->derived[i], aligned, lines);
    find_extra(c, v, lines);
    v->verdict = v->n ? ARRIS_PASS : ARRIS_INDETERMINATE;
    for (uint32_t i = 0; i < v->n; i++)
        v->verdict = judge_both(v->verdict, v->item[i].verdict);
    return 0;
}

static int process(arris_stage *s, void *self, arris_frame *f) {
    struct compare *c = self;
    sight_add(&c->sight, arris_layer_get(f, ARRIS_POSE));
    if ((arris_frame_seq(f) + 1) % (uint64_t)c->every)
        return 0;
    return conclude(s, c, arris_layer_get(f, ARRIS_LINES), arris_layer_give(s, f, ARRIS_VERDICT),
                    false);
}

static int finish(arris_stage *s, void *self, arris_frame *f) {
    const arris_lines *lines = arris_layer_get(f, ARRIS_LINES);
    if (!lines)
        return arris_fail(s, ARRIS_E_INTERNAL, NULL, "no lines came with the end of the stream");
    return conclude(s, self, lines, arris_layer_give(s, f, ARRIS_VERDICT), true);
}

static void close_compare(arris_stage *s, void *self) {
    struct compare *c = self;
    (void)s;
    nominal_free(&c->nominal);
    free(c->piece);
    free(c->judged);
    free(c->is_datum);
    free(c->seen);
    free(c->candidates);
    free(c->owner);
    free(c->derived);
}

const arris_stage_desc stage_compare = {
    .size = sizeof(arris_stage_desc),
    .name = "compare",
    .summary = "judges the measured lines against nominal edges: deviation, uncertainty, verdict",
    .example = "imagesrc location=frames.csv ! edges ! undistort ! segments ! track ! reconstruct "
               "! compare model=samples/box/box.obj tolerance=3 ! filesink location=verdict.json",
    .layers = {.needs = ARRIS_BIT(ARRIS_LINES) | ARRIS_BIT(ARRIS_POSE),
               .gives = ARRIS_BIT(ARRIS_VERDICT)},
    .self_size = sizeof(struct compare),
    .props = props,
    .n_props = sizeof props / sizeof *props,
    .setup = setup,
    .process = process,
    .finish = finish,
    .close = close_compare,
};
