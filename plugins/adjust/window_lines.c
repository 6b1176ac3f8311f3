/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * window_lines.c: which lines are in the fixed lag (window_parts.h).
 */
#include <math.h>
#include <string.h>

#include "window_parts.h"

enum { VIEWS = 3 };                /* in the window, of a line that comes into it */
static const double HOLD = 0.3;    /* of its distance, that a line may be off */
static const double SHORT = 1e-3;  /* mm: shorter is no line */
static const double SLANTED = 0.5; /* cosine: a line that turned so far is not linear any more */
static const double WORSE = 1.5, SURELY = 50; /* times, and chi-square, that a line fits badly */
static const uint32_t NONE = UINT32_MAX;

static uint32_t slot_of(const window *w, int32_t id) {
    for (uint32_t i = 0; i < w->p.n_lines; i++)
        if (w->id[i] == id)
            return i;
    return NONE;
}

static known *known_of(window *w, int32_t id) {
    for (uint32_t i = 0; i < w->n_known; i++)
        if (w->known[i].id == id)
            return &w->known[i];
    return NULL;
}

static bool is_gone(const arris_line *l) {
    return l->change == ARRIS_MERGED || l->change == ARRIS_RETIRED;
}

/* ---- views ----------------------------------------------------------------------------------- */

/* Whose line a track is: its own, or the one that this was merged into. */
static int32_t line_of(const window *w, int32_t track) {
    for (uint32_t i = 0; i < w->n_alias; i++)
        if (w->alias[i].track == track)
            return w->alias[i].line;
    return track;
}

/* The oldest merger is forgotten when there is no room. */
static void note_merger(window *w, int32_t id, int32_t into) {
    for (uint32_t i = 0; i < w->n_alias; i++)
        if (w->alias[i].line == id)
            w->alias[i].line = into;
    if (w->n_alias == WINDOW_ALIASES)
        memmove(w->alias, w->alias + 1, --w->n_alias * sizeof *w->alias);
    w->alias[w->n_alias++] = (struct alias){id, into};
}

static uint32_t views_of(const window *w, int32_t id) {
    uint32_t n = 0;
    for (uint32_t i = 0; i < w->n; i++) {
        uint32_t place = window_place(w, i);
        const int32_t *track = w->track + WINDOW_VIEWS * place;
        for (uint32_t m = 0; m < w->n_views[place]; m++)
            n += line_of(w, track[m]) == id;
    }
    return n;
}

/* Every view of the frames from the i-th on to its line. */
static void associate(window *w, uint32_t i) {
    for (; i < w->n; i++) {
        uint32_t place = window_place(w, i), at = WINDOW_VIEWS * place;
        for (uint32_t m = 0; m < w->n_views[place]; m++, at++) {
            uint32_t line = slot_of(w, line_of(w, w->track[at]));
            w->p.view[at].line = line;
            if (line != NONE && i + 1 == w->n)
                w->seen[line] = w->time;
        }
    }
}

/* ---- coming and going ------------------------------------------------------------------------ */

/* The last line takes the place of one that leaves. */
static void forget(window *w, uint32_t line) {
    uint32_t last = w->p.n_lines - 1;
    known *k = known_of(w, w->id[line]), *moved = known_of(w, w->id[last]);
    window_eliminate(w, line);
    if (moved)
        moved->slot = (int32_t)line;
    if (k)
        k->slot = -1;
    w->p.line[line] = w->p.line[last];
    w->id[line] = w->id[last];
    w->seen[line] = w->seen[last];
    w->past[line] = w->past[last];
    w->now[line] = w->now[last];
    w->p.n_lines--;
    associate(w, 0);
}

/* Room for one more: in the place of the line that is out of the window for the longest. */
static bool make_room(window *w) {
    uint32_t oldest = 0;
    if (w->p.n_lines < WINDOW_LINES)
        return true;
    for (uint32_t i = 1; i < w->p.n_lines; i++)
        oldest = w->seen[i] < w->seen[oldest] ? i : oldest;
    if (w->seen[oldest] + w->params.frames > w->time)
        return false;
    forget(w, oldest);
    return true;
}

static bool is_line(const arris_line *l) {
    double d[3] = {l->q[0] - l->p[0], l->q[1] - l->p[1], l->q[2] - l->p[2]};
    double length = sqrt(arris_dot(d, d)), at = arris_dot(l->p, l->p) + arris_dot(l->q, l->q);
    return length > SHORT && isfinite(length + at);
}

static double distance_of(const window *w, const arris_line *l) {
    const double *C = w->p.frame[window_place(w, w->n - 1)].pose.C;
    double d[3];
    for (int i = 0; i < 3; i++)
        d[i] = (l->p[i] + l->q[i]) / 2 - C[i];
    return sqrt(arris_dot(d, d));
}

static bool admit(window *w, const arris_line *l, known *k) {
    if (is_gone(l) || !is_line(l) || views_of(w, l->id) < fmin(VIEWS, w->params.frames) ||
        !make_room(w))
        return false;
    w->distance = fmax(distance_of(w, l), SHORT);
    k->slot = (int32_t)adj_add_line(&w->p, l->p, l->q, HOLD * w->distance);
    w->id[k->slot] = l->id;
    w->seen[k->slot] = w->time;
    memset(&w->past[k->slot], 0, sizeof *w->past);
    return true;
}

/* What was known of the lines that still are there; these mostly stay in order. */
static void take_over(window *w, const arris_lines *lines) {
    known *before = w->known;
    uint32_t n = w->n_known, hint = 0;
    w->known = w->before, w->before = before;
    w->n_known = lines->n < w->max_known ? lines->n : w->max_known;
    for (uint32_t i = 0; i < w->n_known; i++) {
        w->known[i] = (known){.id = lines->item[i].id, .slot = -1};
        for (uint32_t m = 0; m < n; m++)
            if (before[(hint + m) % n].id == lines->item[i].id) {
                hint = (hint + m) % n;
                w->known[i] = before[hint++];
                break;
            }
    }
}

void window_follow(window *w, const arris_lines *lines) {
    bool changed = false;
    take_over(w, lines);
    for (uint32_t i = 0; i < w->n_known; i++)
        if (lines->item[i].change == ARRIS_MERGED) {
            note_merger(w, lines->item[i].id, lines->item[i].into);
            changed = true;
        }
    for (uint32_t i = w->p.n_lines; i-- > 0;) {
        const known *k = known_of(w, w->id[i]);
        if (!k || is_gone(&lines->item[k - w->known]))
            forget(w, i);
    }
    for (uint32_t i = 0; w->n > 0 && i < w->n_known; i++)
        if (w->known[i].slot < 0)
            changed |= admit(w, &lines->item[i], &w->known[i]);
    if (w->n > 0)
        associate(w, changed ? 0 : w->n - 1);
}

/* ---- strays ---------------------------------------------------------------------------------- */

/* Where l runs in the terms of `o`. False when they are too far from parallel. */
static bool express(const arris_line *l, adj_line *o) {
    double d[3], from[3];
    for (int i = 0; i < 3; i++)
        d[i] = l->q[i] - l->p[i], from[i] = l->p[i] - o->X[i];
    double along = arris_dot(d, o->u);
    for (int k = 0; k < 2; k++) {
        double t = ((k ? o->h : -o->h) - arris_dot(from, o->u)) / along;
        o->x[2 * k] = arris_dot(from, o->a) + t * arris_dot(d, o->a);
        o->x[2 * k + 1] = arris_dot(from, o->b) + t * arris_dot(d, o->b);
    }
    return fabs(along) > SLANTED * sqrt(arris_dot(d, d));
}

/* The loss of a line's views in the window if it were at `at`, by their stated variances. */
static double loss_of(const window *w, uint32_t line, adj_line at) {
    double sum = 0, r[2];
    at.variance = 1;
    for (uint32_t i = 0; i < w->n; i++) {
        uint32_t place = window_place(w, i);
        const adj_view *v = &w->p.view[WINDOW_VIEWS * place];
        for (uint32_t m = 0; m < w->n_views[place]; m++, v++)
            if (v->line == line)
                sum += adj_residual(&w->p, v, &w->p.frame[place].pose, &at, r, NULL, NULL)
                           ? adj_loss(&w->p, adj_distance(v, &at, r))
                           : (double)INFINITY;
    }
    return sum;
}

/* As of a line that came in too far off, where the running one fits much better. */
void window_drop_strays(window *w, const arris_lines *lines) {
    for (uint32_t i = w->p.n_lines; i-- > 0;) {
        known *k = known_of(w, w->id[i]);
        adj_line running = w->p.line[i];
        if (!express(&lines->item[k - w->known], &running) ||
            loss_of(w, i, w->p.line[i]) > WORSE * loss_of(w, i, running) + SURELY) {
            k->adjusted = false;
            forget(w, i);
        }
    }
}
