/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * scan.c: the lines of a scan (scan.h).
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#include "entries.h"
#include "memory.h"

#define LARGE_PAGE ((size_t)1 << 21)
enum { SHIFTS = 4096 };                   /* frames whose poses are corrected apart */
static const double CHANGED = 0.3;        /* relative, of the noise's variance */
static const double INDISTINCT = 1e-5;    /* of the depth: less of it does not show */
static const double TYPICAL_DEPTH = 1000; /* mm, until a line is measured */
static const double NEAREST = 0.25;       /* of the depth: hardly any line is nearer */

/* Room for so many lines, in large pages where there are any: a line is large, few of them are ever
 * touched, and those in many places. */
static entry *pool_new(size_t n) {
    size_t size = (n * sizeof(entry) + LARGE_PAGE - 1) / LARGE_PAGE * LARGE_PAGE;
    entry *pool = aligned_alloc(LARGE_PAGE, size);
    if (pool)
        madvise(pool, size, MADV_HUGEPAGE);
    return pool;
}

scan *scan_new(const scan_params *p) {
    scan *s = calloc(1, sizeof *s);
    if (!s)
        return NULL;
    size_t n = (size_t)p->max_lines, places = 4;
    while (places < 3 * n) /* at most half of them by tracks, and each line once more */
        places *= 2;
    s->p = *p;
    s->mask = (uint32_t)places - 1;
    s->scene = (scene){.noise = {p->pose_sigma, p->rot_sigma, false},
                       .scale = 1,
                       .memory = 1,
                       .depth = TYPICAL_DEPTH,
                       .waits = true};
    s->weighted = p->pose_sigma;
    s->newest = -1;
    s->turn = 2; /* no place has it yet, nor the one before */
    s->pool = pool_new(n);
    s->alive = calloc(n, sizeof(entry *));
    s->now = calloc(places, sizeof(link));
    s->before = calloc(places, sizeof(link));
    s->shifts = shifts_new(SHIFTS);
    s->path = path_new();
    if (!s->shifts || !s->path || !s->pool || !s->alive || !s->now || !s->before) {
        scan_free(s);
        return NULL;
    }
    for (size_t i = 0; i < n; i++)
        s->alive[i] = &s->pool[i];
    return s;
}

void scan_free(scan *s) {
    if (!s)
        return;
    free(s->pool);
    free(s->alive);
    free(s->now);
    free(s->before);
    shifts_free(s->shifts);
    path_free(s->path);
    free(s);
}

/* ---- tracks --------------------------------------------------------------------------------- */

/* The link of the track, or the free place where it would stand: then its `e` is NULL. There are
 * more places than lines. */
static link *find(link *table, uint32_t mask, uint32_t turn, int32_t track) {
    uint32_t i = (uint32_t)track & mask; /* those that are alive are mostly neighbours */
    while (table[i].turn == turn && table[i].track != track)
        i = (i + 1) & mask;
    if (table[i].turn != turn)
        table[i] = (link){track, turn - 1, NULL};
    return &table[i];
}

static link *find_now(const scan *s, int32_t track) {
    return find(s->now, s->mask, s->turn, track);
}

static link *find_before(const scan *s, int32_t track) {
    return find(s->before, s->mask, s->turn - 1, track);
}

void entry_prepare(const scan *s, entry *e, int32_t id) {
    memset(e, 0, offsetof(entry, l));
    e->l.id = e->out.id = id;
    e->out.into = -1;
    e->next_merge = (uint32_t)s->p.min_views;
}

static entry *begin(scan *s, int32_t track) {
    if (s->n == (uint32_t)s->p.max_lines) {
        s->refused++;
        return NULL;
    }
    entry *e = s->alive[s->n++];
    line_begin(&e->l, track);
    entry_prepare(s, e, track);
    e->since = s->frames;
    e->l.next_fit = (uint32_t)s->p.min_views; /* nothing is told of it before */
    return e;
}

/* The line of a track that is taken up again, or NULL. All lines are linked once a frame for that,
 * if there is such a track. */
static entry *earlier(scan *s, int32_t track) {
    if (track > s->newest)
        return NULL;
    for (uint32_t i = 0; !s->all_linked && i < s->n; i++) {
        link *l = find_before(s, s->alive[i]->out.id);
        if (!l->e && !s->alive[i]->leaving)
            *l = (link){s->alive[i]->out.id, s->turn - 1, s->alive[i]};
    }
    s->all_linked = true;
    return find_before(s, track)->e;
}

static void fetch(const void *from, size_t size) {
    for (size_t at = 0; at < size; at += 64)
        __builtin_prefetch((const char *)from + at);
}

void scan_expect(const scan *s, int32_t track, bool next) {
    const entry *e = find_before(s, track)->e;
    if (!e)
        return;
    if (!next) {
        fetch(e, offsetof(entry, l.kept));
        return;
    }
    uint32_t last = e->l.n_kept > 0 ? e->l.n_kept - 1 : 0;
    fetch(&e->l.kept[last], 2 * sizeof(view));
    fetch(&e->l.rest[last], sizeof(info));
    fetch(&e->l.inlier[last], sizeof(bool));
}

void scan_add(scan *s, int32_t track, view *v) {
    entry *e = find_before(s, track)->e;
    while (e && e->into)
        e = e->into;
    if (s->linked > s->mask / 2) {
        s->refused++;
        return;
    }
    if (!e && v && !(e = earlier(s, track)))
        e = begin(s, track);
    if (track > s->newest)
        s->newest = track;
    if (!e)
        return;
    if (v) {
        line_align(&e->l, v);
        v->frame = e->at = s->frames;
    }
    *find_now(s, track) = (link){track, s->turn, e};
    s->linked++;
    e->tracked = true;
    if (!v)
        return;
    linear r;
    bool taken = line_add(&e->l, v, &s->scene, &r);
    if (taken && e->l.all.n > ESTABLISHED)
        e->residual = noise_add(&s->noise, v, &r, e->before);
    e->agreed |= taken;
    e->changed = true;
}

bool entry_counts(const scan *s, const entry *e) {
    return (!s->any_measured || e->out.state == ARRIS_MEASURED) && e->l.settled;
}

void entry_leave(entry *e, enum arris_line_change why, int32_t into) {
    e->leaving = true;
    e->out.change = why;
    e->out.into = into;
}

/* ---- what is told --------------------------------------------------------------------------- */

/* Whether an end went by more than half its sigma from where it was told to be. */
static bool moved(const entry *e) {
    static const int diagonal[6] = {0, 6, 11, 15, 18, 20};
    double shift[2] = {0, 0}, variance[2] = {0, 0};
    for (int i = 0; i < 6; i++) {
        double d = (i < 3 ? e->out.p[i] : e->out.q[i - 3]) - e->told[i];
        shift[i / 3] += d * d;
        variance[i / 3] += e->out.cov[diagonal[i]];
    }
    return shift[0] > variance[0] / 4 || shift[1] > variance[1] / 4;
}

static void tell(scan *s, entry *e) {
    arris_line out = e->out;
    bool fitted = !e->listed || e->told_fit != e->l.next_fit;
    bool revoked = e->listed && !e->l.settled && e->out.state != ARRIS_UNOBSERVABLE;
    bool known = e->l.all.n >= (uint32_t)s->p.min_views && (e->l.settled || fitted);
    if (!known && !revoked)
        return;
    e->told_fit = e->l.next_fit;
    if (!line_report(&e->l, &s->scene, s->p.limit, &out)) {
        out = e->out; /* as far as it was told before */
        out.state = ARRIS_UNOBSERVABLE;
        if (!e->listed)
            return;
    }
    if (out.views > s->frames)
        out.views = s->frames;
    if (e->agreed)
        out.seen = s->frames;
    bool other = out.state != e->out.state;
    e->out = out;
    e->out.change = !e->listed ? ARRIS_ADDED : other || moved(e) ? ARRIS_MOVED : ARRIS_SAME;
    e->listed = true;
    if (e->out.change == ARRIS_SAME)
        return;
    memcpy(e->told, out.p, sizeof out.p);
    memcpy(e->told + 3, out.q, sizeof out.q);
}

/* ---- frames --------------------------------------------------------------------------------- */

/* The scene's scale is the lines' geometric mean, in which a wrong line weighs little. */
static void update_typical(scan *s) {
    double depth = 0, scale = 0, n = 0;
    s->any_measured = false;
    for (uint32_t i = 0; i < s->n; i++)
        s->any_measured |= s->alive[i]->out.state == ARRIS_MEASURED && s->alive[i]->listed;
    for (uint32_t i = 0; i < s->n; i++) {
        const line *l = &s->alive[i]->l;
        if (!entry_counts(s, s->alive[i]) || l->all.n <= ESTABLISHED)
            continue;
        depth += log(l->depth);
        scale += log(line_chi2(l) / (2.0 * l->all.n - 4) + 1e-3);
        n++;
    }
    if (n > 0) {
        s->scene.depth = exp(depth / n);
        s->scene.nearest = NEAREST * s->scene.depth;
        s->scene.scale = exp(scale / n);
    }
}

/* What the lines sum up is weighted by the noise as it was estimated then. When that has changed
 * they are weighted anew; asked at ever longer intervals. */
static void follow_noise(scan *s) {
    double now = s->scene.noise.position * s->scene.noise.position;
    double then = s->weighted * s->weighted, least = INDISTINCT * s->scene.depth;
    if (s->frames < s->next_weighing)
        return;
    s->next_weighing = s->frames + 1 + s->frames / 8;
    if (fabs(now - then) < CHANGED * (then + least * least))
        return;
    s->weighted = s->scene.noise.position;
    for (uint32_t i = 0; i < s->n; i++)
        if (s->alive[i]->l.settled)
            line_refine(&s->alive[i]->l, &s->scene);
}

static double trace(const mat4 *P) {
    return P->m[0][0] + P->m[1][1] + P->m[2][2] + P->m[3][3];
}

/* What all kept views tell of the poses' noise. */
static void find_memory(scan *s) {
    memories *m = &s->scene.memories;
    double shared, sum = 0, n = 0;
    memory_begin(m);
    for (uint32_t i = 0; i < s->n; i++)
        if (entry_counts(s, s->alive[i]))
            memory_add(m, &s->alive[i]->l, &s->scene);
    memory_end(m);
    for (uint32_t i = 0; m->known && i < s->n; i++) {
        const line *l = &s->alive[i]->l;
        if (!entry_counts(s, s->alive[i]))
            continue;
        mat4 P = memory_covariance(m, l, &s->scene, l->scale, &l->cov, &shared);
        sum += trace(&P) / (l->scale * trace(&l->cov));
        n++;
    }
    m->mean = n > 0 ? fmax(sum / n, 1) : 1;
}

static void update_scene(scan *s) {
    noise_end_frame(&s->noise);
    if (s->p.pose_sigma <= 0)
        s->scene.noise.position = noise_position(&s->noise);
    s->scene.memory = noise_memory(&s->noise);
    follow_noise(s);
    update_typical(s);
}

/* Drops what left in the frame before, and lines whose track ended before they could be told of. */
static void drop(scan *s) {
    uint32_t n = 0;
    for (uint32_t i = 0; i < s->n; i++) {
        entry *e = s->alive[i];
        if (e->leaving || !(e->tracked || e->listed))
            continue;
        s->alive[i] = s->alive[n];
        s->alive[n++] = e;
    }
    s->n = n;
}

/* Lines whose track ended before they were worth keeping go; and when there is no room, the one of
 * the fewest views that is neither tracked nor measured. */
static void retire(scan *s) {
    entry *least = NULL;
    for (uint32_t i = 0; i < s->n; i++) {
        entry *e = s->alive[i];
        if (e->tracked || e->leaving || e->out.state == ARRIS_MEASURED)
            continue;
        if (e->at - e->since + 1 < ESTABLISHED)
            entry_leave(e, ARRIS_RETIRED, -1);
        else if (!least || e->l.seen < least->l.seen)
            least = e;
    }
    if (least && s->n == (uint32_t)s->p.max_lines)
        entry_leave(least, ARRIS_RETIRED, -1);
}

static void next_frame(scan *s) {
    link *t = s->before;
    s->before = s->now;
    s->now = t;
    s->lost = s->refused;
    s->linked = s->refused = 0;
    s->all_linked = false;
    s->turn++;
    for (uint32_t i = 0; i < s->n; i++) {
        entry *e = s->alive[i];
        e->before = e->residual;
        e->residual = 0;
        e->tracked = e->changed = e->agreed = false;
    }
}

void scan_end_frame(scan *s, bool counts) {
    s->frames += counts;
    drop(s);
    update_scene(s);
    unite_merge(s);
    for (uint32_t i = 0; i < s->n; i++) {
        entry *e = s->alive[i];
        if (e->leaving)
            continue;
        e->out.change = ARRIS_SAME;
        if (e->changed)
            tell(s, e);
    }
    retire(s);
    next_frame(s);
}

void scan_finish(scan *s) {
    s->scene.waits = false;
    drop(s);
    for (uint32_t i = 0; i < s->n; i++) {
        entry *e = s->alive[i];
        e->changed = true;
        e->next_merge = 0;
        if (e->l.settled)
            line_refine(&e->l, &s->scene);
    }
    update_typical(s);
    find_memory(s);
    for (uint32_t i = 0; i < s->n; i++)
        line_complete(&s->alive[i]->l, &s->scene);
    unite_finish(s);
    for (uint32_t i = 0; i < s->n; i++) {
        entry *e = s->alive[i];
        if (e->leaving)
            continue;
        if (e->l.settled)
            line_weigh(&e->l, &s->scene);
        else if (e->l.n_kept > 0)
            line_fit(&e->l, &s->scene);
        if (e->l.settled && s->scene.noise.corrected)
            e->l.common = path_covariance(s->path, &e->l, &s->scene);
        e->out.change = ARRIS_SAME;
        tell(s, e);
    }
}

void scan_write(const scan *s, arris_lines *out) {
    out->n = 0;
    out->lost = s->lost;
    out->frames = s->frames;
    out->scale_sigma = 0;
    out->pose_sigma = s->scene.noise.position;
    for (uint32_t i = 0; i < s->n; i++) {
        if (!s->alive[i]->listed)
            continue;
        if (out->n < out->max)
            out->item[out->n++] = s->alive[i]->out;
        else
            out->lost++;
    }
}
