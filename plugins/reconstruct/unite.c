/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * unite.c: one line per edge, one edge per line (entries.h). The tracks of an edge that was seen as
 * several become one line; a track that went from one edge over to another becomes two.
 */
#include <math.h>

#include "entries.h"

enum { SPLIT = 1 << 30 };        /* the first id of a line that began by a split */
enum { ROUNDS = 16 };            /* of splitting at the end, at most */
enum { CORRECTIONS = 3 };        /* of the poses, in the first */
static const double SUDDEN = 40; /* chi-square over the noise's by which views contradict */
static const double WORST = 0.9; /* of the most */
static const double BESIDE = 1;  /* px: nearer, and alike, it may be one edge found twice */

/* ---- merging -------------------------------------------------------------------------------- */

/* b becomes part of a. The views of the one that is settled are the better start. */
static void merge(const scan *s, entry *a, entry *b) {
    if (b->l.settled && !a->l.settled) {
        line swap = a->l;
        a->l = b->l;
        b->l = swap;
        a->l.id = a->out.id;
    }
    line_absorb(&a->l, &b->l, &s->scene);
    a->tracked |= b->tracked;
    a->changed = true;
    b->into = a;
    entry_leave(b, ARRIS_MERGED, a->out.id);
}

/* Whether two views have half of the shorter stretch of the line in common. */
static bool overlap(const line *l, const view *v, const view *w) {
    double p[2], q[2];
    view_ends(v, &l->f, l->x, p);
    view_ends(w, &l->f, l->x, q);
    return fabs(p[0] + p[1] - q[0] - q[1]) < fmax(fabs(p[1] - p[0]), fabs(q[1] - q[0]));
}

/* Whether some frame saw the two beside each other; anywhere at all when they are `turned`. */
static bool side_by_side(const line *a, const line *b, bool turned) {
    double least = turned ? 0 : BESIDE;
    for (uint32_t i = 0; i < a->n_kept; i++)
        for (uint32_t k = 0; k < b->n_kept; k++) {
            const view *v = &a->kept[i], *w = &b->kept[k];
            if (v->frame == w->frame && a->inlier[i] && b->inlier[k] &&
                fabs(arris_dot(v->plane, w->ray)) >= least && overlap(a, v, w))
                return true;
        }
    return false;
}

/* Whether two lines are one edge. That may be seen in either polarity, but not twice at once. */
static bool same_edge(const scan *s, const entry *a, const entry *b, bool turned) {
    const line *l = &a->l, *m = &b->l;
    if (l->settled && m->settled)
        return line_same(l, m, &s->scene, turned) && !side_by_side(l, m, turned);
    if (turned)
        return false;
    if (l->settled != m->settled)
        return l->settled ? line_explains(l, m, &s->scene) : line_explains(m, l, &s->scene);
    return line_same(l, m, &s->scene, false);
}

/* Merges the line with each that is the same edge, into the older one. */
static void merge_with_others(const scan *s, uint32_t index, bool turned) {
    entry *e = s->alive[index];
    for (uint32_t i = 0; i < s->n && !e->leaving; i++) {
        entry *o = s->alive[i];
        if (i == index || o->leaving || !o->listed || !same_edge(s, o, e, turned))
            continue;
        merge(s, i < index ? o : e, i < index ? e : o);
    }
}

static bool is_due(const entry *e) {
    return !e->leaving && e->listed && e->changed && e->l.seen >= e->next_merge;
}

/* Those of one polarity come first: an edge seldom changes it, and two edges that are near are
 * mostly opposite. */
void unite_merge(scan *s) {
    for (int turned = 0; turned < 2; turned++)
        for (uint32_t i = 0; i < s->n; i++)
            if (is_due(s->alive[i]))
                merge_with_others(s, i, turned);
    for (uint32_t i = 0; i < s->n; i++) {
        entry *e = s->alive[i];
        if (is_due(e))
            e->next_merge = e->l.seen + 1 + e->l.seen / 4;
    }
}

/* ---- splitting ------------------------------------------------------------------------------ */

/* Two lines where the track went over to another edge, unless that was seen too rarely. False where
 * it did not. */
static bool split(scan *s, entry *e) {
    if (s->n == (uint32_t)s->p.max_lines)
        return false;
    entry *o = s->alive[s->n];
    if (!line_split(&e->l, &o->l, &s->scene))
        return false;
    if (o->l.seen < ESTABLISHED)
        return true;
    entry_prepare(s, o, SPLIT + s->splits++);
    o->changed = true;
    s->n++;
    return true;
}

/* ---- at the end ----------------------------------------------------------------------------- */

/* Splits the lines that contradict themselves the most, each once; the others may only look so, by
 * their correction. False when there are none. */
static bool split_worst(scan *s) {
    double most = SUDDEN;
    for (uint32_t i = 0; i < s->n; i++) {
        entry *e = s->alive[i];
        bool asked = e->listed && !e->leaving && !e->judged;
        e->contradiction = asked ? line_contradiction(&e->l, &s->scene) : 0;
        most = fmax(most, e->contradiction);
    }
    for (uint32_t i = 0, n = s->n; i < n && most > SUDDEN; i++) {
        entry *e = s->alive[i];
        if (e->contradiction < WORST * most)
            continue;
        e->judged = true;
        if (!split(s, e))
            line_prune(&e->l, &s->scene);
    }
    return most > SUDDEN;
}

static void refine_settled(scan *s) {
    for (uint32_t i = 0; i < s->n; i++)
        if (s->alive[i]->l.settled)
            line_refine(&s->alive[i]->l, &s->scene);
}

/* What changes from frame to frame. */
static void correct_frames(scan *s) {
    shifts_begin(s->shifts, s->frames, s->scene.S);
    for (uint32_t i = 0; i < s->n; i++)
        if (entry_counts(s, s->alive[i]))
            shifts_add(s->shifts, &s->alive[i]->l, &s->scene);
    for (uint32_t i = 0; i < s->n; i++)
        shifts_set(s->shifts, &s->alive[i]->l, &s->scene, entry_counts(s, s->alive[i]));
    s->scene.noise.corrected = true;
    refine_settled(s);
}

/* Whether shifts explain what the lines see, by the geometric mean of what they leave over what is
 * expected; else the rotations are wrong as well. */
static bool shifts_explain(const scan *s) {
    double sum = 0;
    for (uint32_t i = 0; i < s->n; i++) {
        const line *l = &s->alive[i]->l;
        if (entry_counts(s, s->alive[i]) && l->all.weight > 2)
            sum += log(line_chi2(l) / (2 * l->all.weight - 4) + 1e-3);
    }
    return sum < 0;
}

/* What changes slowly, and how large the noise is. */
static void correct_path(scan *s) {
    double *S = s->scene.S, most = 3 * s->scene.noise.position * s->scene.noise.position;
    shifts_spread(s->shifts, S);
    double scale = fmin(1, most / (S[0] + S[4] + S[8]));
    for (int i = 0; i < 9; i++)
        S[i] *= scale;
    s->scene.rest = 1 / (s->scene.memories.mean * shifts_lines(s->shifts));
    refine_settled(s);
    path_begin(s->path, s->shifts, s->frames, &s->scene);
    for (uint32_t i = 0; i < s->n; i++)
        if (entry_counts(s, s->alive[i]))
            path_add(s->path, &s->alive[i]->l, &s->scene);
    if (!path_solve(s->path))
        return;
    for (uint32_t i = 0; i < s->n; i++)
        path_shift(s->path, &s->alive[i]->l);
    refine_settled(s);
}

/* Whether the positions' noise is worth correcting, which the kept views alone can be. It is taken
 * for the same in all directions at first. */
static bool worth_it(scan *s) {
    double variance = s->scene.noise.position * s->scene.noise.position, by_pose = 0, own = 0;
    for (int i = 0; i < 9; i++)
        s->scene.S[i] = i % 4 ? 0 : variance;
    for (uint32_t i = 0; i < s->n; i++) {
        const line *l = &s->alive[i]->l;
        if (!entry_counts(s, s->alive[i]))
            continue;
        double px = line_pose_px(l, &s->scene);
        by_pose += px * px;
        own += l->stride * l->kept[0].cov[0];
    }
    return by_pose > own;
}

/* Corrects the poses by what the lines say, and the lines by them. False when that is not all that
 * is wrong. */
static bool correct(scan *s, int times) {
    for (int i = 0; i < times; i++) {
        correct_frames(s);
        if (!shifts_explain(s))
            return false;
        correct_path(s);
    }
    return true;
}

/* Takes out what lies beside the edges, by the blur of those beside which nothing does. */
static void clear_sides(scan *s) {
    double sum = 0, weights = 0;
    for (uint32_t i = 0; i < s->n; i++) {
        double weight, blur = line_blur(&s->alive[i]->l, &weight);
        if (entry_counts(s, s->alive[i]))
            sum += weight * blur, weights += weight;
    }
    for (uint32_t i = 0; i < s->n; i++)
        if (s->alive[i]->l.settled)
            line_clear(&s->alive[i]->l, &s->scene, weights > 0 ? sum / weights : 0);
}

void unite_finish(scan *s) {
    bool corrects = worth_it(s), well = corrects;
    for (int i = 0; i < ROUNDS; i++) {
        if (well && !correct(s, i == 0 ? CORRECTIONS : 1)) {
            s->scene.rest = 0;
            well = false;
        } else if (corrects && !well) {
            correct_frames(s);
        }
        if (!split_worst(s))
            break;
    }
    clear_sides(s);
    unite_merge(s);
    s->scene.noise.corrected = well;
}
