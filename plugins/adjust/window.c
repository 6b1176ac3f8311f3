/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * window.c: the fixed lag: its frames, and what is done in each (window.h).
 */
#include "window.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "adjust.h"
#include "tell.h"
#include "window_parts.h"

window *window_new(const window_params *params, const arris_camera *c, uint32_t max_lines) {
    window *w = calloc(1, sizeof *w);
    size_t frames = params->frames, views = frames * WINDOW_VIEWS;
    if (!w)
        return NULL;
    int rc = adj_init(&w->p, params->frames, WINDOW_LINES, (uint32_t)views);
    w->n_views = calloc(frames, sizeof *w->n_views);
    w->part = calloc(frames, sizeof *w->part);
    w->redundant = calloc(frames, sizeof *w->redundant);
    w->track = calloc(views, sizeof *w->track);
    w->misfit = calloc(views, sizeof *w->misfit);
    w->known = calloc(max_lines + (size_t)1, sizeof *w->known);
    w->before = calloc(max_lines + (size_t)1, sizeof *w->before);
    if (rc || !w->n_views || !w->part || !w->redundant || !w->track || !w->misfit || !w->known ||
        !w->before) {
        window_free(w);
        return NULL;
    }
    w->params = *params;
    w->p.camera = arris_camera_ideal(c);
    w->p.robust = params->robust;
    w->expected = adj_expected_share(&w->p);
    w->max_known = max_lines;
    w->distance = 1000; /* until there is a line */
    window_weigh(w);
    return w;
}

void window_free(window *w) {
    if (!w)
        return;
    adj_free(&w->p);
    free(w->n_views);
    free(w->part);
    free(w->redundant);
    free(w->track);
    free(w->misfit);
    free(w->known);
    free(w->before);
    free(w);
}

static void drop_oldest(window *w) {
    window_sum_oldest(w);
    window_retain(w);
    w->first = window_place(w, 1);
    w->n--;
}

void window_frame(window *w, const arris_pose *reported) {
    if (w->n == w->params.frames)
        drop_oldest(w);
    uint32_t place = window_place(w, w->n++);
    w->p.n_frames = place;
    adj_add_frame(&w->p, reported, 0);
    memset(w->redundant[place], 0, sizeof w->redundant[place]);
    w->n_views[place] = 0;
    w->time++;
}

void window_add(window *w, int32_t track, const arris_segment *s, const arris_camera *c) {
    uint32_t place = window_place(w, w->n - 1), at = WINDOW_VIEWS * place + w->n_views[place];
    arris_segment o = *s;
    if (w->n_views[place] == WINDOW_VIEWS ||
        (arris_camera_distorts(c) && (arris_undistort(c, s->x1, s->y1, &o.x1, &o.y1) ||
                                      arris_undistort(c, s->x2, s->y2, &o.x2, &o.y2))))
        return;
    w->p.n_views = at;
    if (adj_add_view(&w->p, place, UINT32_MAX, &o) < 0)
        return;
    w->track[at] = track;
    w->misfit[at] = s->chi2 > 0 ? (float)(1 - 1 / (double)s->chi2) : 0;
    w->n_views[place]++;
}

static void note_result(const window *w, known *k) {
    k->adjusted = true;
    k->l = w->p.line[k->slot];
    window_line_covariance(w, (uint32_t)k->slot, k->cov);
    for (int i = 0; i < 16; i++)
        k->cov[i] *= window_late_memory(w);
    k->rms = adj_fit_rms(&w->now[k->slot]);
}

/* Whether an end went by more than half its sigma from where it was told to be. */
static bool moved(const known *k, const arris_line *l) {
    static const int diagonal[6] = {0, 6, 11, 15, 18, 20};
    double shift[2] = {0, 0}, variance[2] = {0, 0};
    for (int i = 0; i < 6; i++) {
        double d = (i < 3 ? l->p[i] : l->q[i - 3]) - k->told[i];
        shift[i / 3] += d * d;
        variance[i / 3] += l->cov[diagonal[i]];
    }
    return shift[0] > variance[0] / 4 || shift[1] > variance[1] / 4;
}

static void tell(known *k, arris_line *l) {
    if (k->adjusted) {
        tell_line(&k->l, k->cov, l);
        l->rms = k->rms;
    }
    if (l->change == ARRIS_SAME || l->change == ARRIS_MOVED)
        l->change = l->state != k->state || moved(k, l) ? ARRIS_MOVED : ARRIS_SAME;
    if (l->change == ARRIS_SAME)
        return;
    k->state = l->state;
    memcpy(k->told, l->p, sizeof l->p);
    memcpy(k->told + 3, l->q, sizeof l->q);
}

void window_adjust(window *w, arris_lines *lines) {
    window_follow(w, lines);
    if (w->n > 0)
        window_locate(w);
    bool good = window_step(w);
    if (good)
        window_covariances(w);
    window_weigh(w);
    for (uint32_t i = 0; good && w->determined && i < w->n_known; i++)
        if (w->known[i].slot >= 0)
            note_result(w, &w->known[i]);
    window_drop_strays(w, lines);
    for (uint32_t i = 0; i < w->n_known; i++)
        tell(&w->known[i], &lines->item[i]);
    lines->pose_sigma = sqrt(arris_dot(w->sigma, w->sigma) / 3);
}
