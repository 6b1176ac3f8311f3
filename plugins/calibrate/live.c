/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * live.c: `arris calibrate --from`: views are collected while the user moves the board.
 *
 * A view is taken when the board stands still, which two pictures in a row tell, and is seen from
 * somewhere new. After each the camera is calibrated, and the uncertainty on the part shown with
 * what to do next, until the target is reached.
 */
#include "live.h"

#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>

#include "command.h"
#include "find.h"

enum { ENOUGH_VIEWS = 200, FIRST_FIT = 5, SCRIPT = 8192 };

static const double STILL = 0.0015; /* of the diagonal, between two pictures; 1.2 px of 640x480 */
static const double NEW = 0.04;     /* of the diagonal, from every view so far */

static const char hint_from[] =
    "the pipeline gives pictures and has no sink, for example --from v4l2src";

static struct live {
    command *m; /* NULL: --from is not what runs */
    arris_pipeline *volatile pipeline;
    double *corner, *before; /* of this picture and of the one before */
    bool seen_before, enough;
    int64_t pictures;
} live;

bool live_runs(void) {
    return live.m != NULL;
}

/* ---- a picture ------------------------------------------------------------------------------ */

/* The rms distance of two views' corners over the picture's diagonal. */
static double distance(const view_list *l, const double *a, const double *b) {
    double sum = 0;
    int n = 0;
    for (int i = 0; i < 2 * cal_corners(&l->board); i++)
        if (!isnan(a[i]) && !isnan(b[i])) {
            sum += (a[i] - b[i]) * (a[i] - b[i]);
            n++;
        }
    return n ? sqrt(2 * sum / n) / hypot(l->width, l->height) : INFINITY;
}

static bool is_new(const view_list *l, const double *corner) {
    for (int i = 0; i < l->n; i++)
        if (distance(l, corner, l->item[i].corner) < NEW)
            return false;
    return true;
}

/* What is known after this view, in one line. Returns 1 when it is enough. */
static int show(command *m) {
    cal_options *o = &m->options;
    const view_list *l = &m->views;
    fault f;
    o->width = l->width;
    o->height = l->height;
    cal_view *copy = malloc((size_t)l->n * sizeof *copy); /* the fit may leave some out for now */
    if (!copy)
        return 0;
    memcpy(copy, l->item, (size_t)l->n * sizeof *copy);
    int r = cal_fit(&l->board, copy, l->n, o, &m->result, &f);
    if (r == 0)
        r = cal_assess(&l->board, copy, l->n, o, &m->result, m->distance, &m->quality, &f);
    free(copy);
    if (r < 0) {
        fprintf(stderr, "%d views: %s\n", l->n, f.text);
        return 0;
    }
    const cal_quality *q = &m->quality;
    fprintf(stderr,
            "%d views: %.1f µm on the part at %.0f mm at the worst place, %.1f in the middle "
            "one. %s\n",
            l->n, q->sigma.worst, q->distance, q->sigma.middle, q->advice[0]);
    return m->target > 0 && q->sigma.worst < m->target;
}

static int add(command *m, int64_t frame, fault *f) {
    char name[64];
    view_list *l = &m->views;
    snprintf(name, sizeof name, "frame %lld", (long long)frame);
    cal_view *v = views_add(l, name);
    if (!v)
        return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for the views");
    memcpy(v->corner, live.corner, 2 * sizeof(double) * (size_t)cal_corners(&l->board));
    if (l->n < FIRST_FIT) {
        fprintf(stderr, "%d views: tilt the board and show it in every corner of the picture\n",
                l->n);
        return 0;
    }
    return show(m) || l->n == ENOUGH_VIEWS;
}

static int take(command *m, const arris_image *image, int64_t frame, bool paced, fault *f) {
    view_list *l = &m->views;
    l->width = image->width;
    l->height = image->height;
    live.pictures++;
    enum find_result found = find_board(image, &l->board, paced, live.corner);
    const bool still =
        !paced || (live.seen_before && distance(l, live.corner, live.before) < STILL);
    if (found == FIND_BIGGER)
        return fault_set(f, ARRIS_E_INPUT, "count the inner corners, where four squares meet",
                         "the board has more than %dx%d corners", l->board.cols, l->board.rows);
    live.seen_before = found == FIND_OK;
    if (found == FIND_OK)
        memcpy(live.before, live.corner, 2 * sizeof(double) * (size_t)cal_corners(&l->board));
    return found == FIND_OK && still && is_new(l, live.corner) ? add(m, frame, f) : 0;
}

int live_take(const arris_image *image, int64_t frame, bool paced, fault *f) {
    int r = live.enough ? 0 : take(live.m, image, frame, paced, f);
    if (r > 0) { /* some pictures may still be on their way */
        live.enough = true;
        arris_stop(live.pipeline);
    }
    return r < 0 ? r : 0;
}

/* ---- the stream ----------------------------------------------------------------------------- */

static void on_signal(int number) {
    (void)number;
    if (live.pipeline)
        arris_stop(live.pipeline);
}

/* The hint lives on in a place of its own, since a fault does not hold it. */
static int say(fault *f, int code, const char *text, const char *hint) {
    static char kept[512];
    snprintf(kept, sizeof kept, "%s", hint);
    return fault_set(f, code, *kept ? kept : hint_from, "--from: %s", text);
}

static int run(arris_pipeline *p, fault *f) {
    arris_error err;
    arris_message m;
    int r = arris_check(p, &err);
    if (r == 0)
        r = arris_start(p, &err);
    if (r < 0)
        return say(f, r, err.text, err.hint);
    enum arris_wait_result w;
    while ((w = arris_wait(p, &m, 100)) != ARRIS_WAIT_ENDED)
        if (w == ARRIS_WAIT_MESSAGE && m.severity == ARRIS_ERROR && r == 0)
            r = say(f, m.code, m.text, m.hint);
    return r;
}

static int collect(command *m, fault *f) {
    char line[SCRIPT];
    arris_error err;
    if (snprintf(line, sizeof line, "%s ! calibrate", m->from) >= (int)sizeof line)
        return fault_set(f, ARRIS_E_USAGE, hint_from, "--from: the pipeline is too long");
    arris_pipeline *p = arris_parse(line, &err);
    if (!p)
        return say(f, err.code, err.text, err.hint);
    live.pipeline = p;
    struct sigaction action = {.sa_handler = on_signal}, old[2];
    sigaction(SIGINT, &action, &old[0]);
    sigaction(SIGTERM, &action, &old[1]);
    int r = run(p, f);
    sigaction(SIGINT, &old[0], NULL);
    sigaction(SIGTERM, &old[1], NULL);
    live.pipeline = NULL;
    arris_free(p);
    return r;
}

int live_collect(command *m, fault *f) {
    const size_t n = 2 * (size_t)cal_corners(&m->views.board);
    live = (struct live){
        .m = m, .corner = calloc(n, sizeof(double)), .before = calloc(n, sizeof(double))};
    int r = live.corner && live.before ? collect(m, f)
                                       : fault_set(f, ARRIS_E_MEMORY, NULL, "no memory");
    if (r == 0 && m->views.n == 0)
        r = fault_set(
            f, ARRIS_E_INPUT,
            "hold the board still for a moment, the whole of it in the picture; --board "
            "counts the inner corners",
            "no view was taken from %lld pictures: a board of %dx%d inner corners was not "
            "found, or never stood still",
            (long long)live.pictures, m->views.board.cols, m->views.board.rows);
    free(live.corner);
    free(live.before);
    live.m = NULL;
    return r;
}
