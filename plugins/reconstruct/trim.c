/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * trim.c: where a line ends. End points scatter, and lines enter and leave the picture: so a line
 * reaches to where still a good part of those views saw it that could. Where it is foreshortened a
 * view tells little of that, and counts little. A frame that saw the edge in pieces is one.
 */
#include <math.h>
#include <stddef.h>

#include "lane.h"
#include "line.h"

static const double SUPPORT = 0.3; /* of the views that could see a place must have seen it */

static const double SCATTER = 4; /* px along a line within which end points scatter */

/* Of four views: places on the line, from and to; NAN of a view that does not take part. */
typedef struct reach {
    lane seen[2], visible[2];
    lane pixel[2];  /* mm that a pixel measures along the line at its ends */
    lane weight[2]; /* what the view tells of where an end is, mm⁻² */
    lane share;     /* of its frame, that may have seen the edge in pieces */
} reach;

/* Where the line M + s D passes the picture's points `px` along the segments (view_places):
 * s = (p[0] + p[1] px + p[2] px²) / (q[0] + q[1] px + q[2] px²). */
typedef struct places {
    lane p[3], q[3];
} places;

/* The numbers of a view, up to `to`. */
enum { CENTRE = 0, RAY = 6, STEP = 9, HALF = 15, FROM = 16, TO = 17, NUMBERS = 20 };
_Static_assert(offsetof(view, step) == STEP * sizeof(double) &&
                   offsetof(view, to) == TO * sizeof(double),
               "views are loaded in blocks of four numbers");

INLINE void find_places(const lane u[NUMBERS], const double M[3], const double D[3], places *f) {
    lane w[3], along[2][3], at[2][3]; /* each at the middle, and by px */
    for (int i = 0; i < 3; i++)
        w[i] = u[CENTRE + i] - M[i];
    for (int k = 0; k < 2; k++) {
        cross_fixed(D, u + (k ? STEP : RAY), along[k]);
        cross(w, u + (k ? STEP : RAY), at[k]);
    }
    f->p[0] = DOT(along[0], at[0]);
    f->p[1] = DOT(along[0], at[1]) + DOT(along[1], at[0]);
    f->p[2] = DOT(along[1], at[1]);
    f->q[0] = DOT(along[0], along[0]);
    f->q[1] = 2 * DOT(along[0], along[1]);
    f->q[2] = DOT(along[1], along[1]);
}

INLINE void place(const places *f, const lane *px, lane *s) {
    lane s2 = f->q[0] + *px * (f->q[1] + *px * f->q[2]);
    lane sum = f->p[0] + *px * (f->p[1] + *px * f->p[2]);
    *s = (lane)((lane_bits)(sum / s2) | ~(s2 > VIEW_PARALLEL)); /* all bits: not a number */
}

/* a where the bits are set, elsewhere b */
#define CHOOSE(where, a, b) ((lane)(((lane_bits)(a) & (where)) | ((lane_bits)(b) & ~(where))))

INLINE void reach_of(const view *const v[VIEWS], lane_bits taken, const line *l, const double M[3],
                     const double D[3], reach *r) {
    lane u[NUMBERS];
    places f;
    for (size_t k = 0; k < NUMBERS; k += 4)
        lane_load(v, k * sizeof(double), u + k);
    find_places(u, M, D, &f);
    for (int i = 0; i < 2; i++) {
        lane px = i ? u[HALF] : -u[HALF], next = px + 1, mm;
        place(&f, &px, &r->seen[i]);
        place(&f, &u[FROM + i], &r->visible[i]);
        place(&f, &next, &mm);
        mm = (mm - r->seen[i]) * l->f.h;
        r->pixel[i] = CHOOSE(mm < 0, -mm, mm);
        r->weight[i] = 1 / (mm * mm);
    }
    lane sum = r->seen[0] + r->seen[1] + r->pixel[0] + r->pixel[1];
    taken &= sum - sum == 0; /* finite */
    /* beyond its vanishing point a line is seen no more */
    r->visible[0] = CHOOSE(r->visible[0] < r->seen[0], r->visible[0], r->seen[0]);
    r->visible[1] = CHOOSE(r->visible[1] > r->seen[1], r->visible[1], r->seen[1]);
    for (int i = 0; i < 2; i++) {
        r->seen[i] = (lane)((lane_bits)r->seen[i] | ~taken);
        r->visible[i] = (lane)((lane_bits)r->visible[i] | ~taken);
    }
}

INLINE double total(lane a) {
    return (a[0] + a[2]) + (a[1] + a[3]);
}

/* Whether enough of the views that could see the place, which one of them saw as an end, did. */
INLINE bool supported(const reach *v, uint32_t blocks, uint32_t n, int end, double at) {
    lane seen = {0}, visible = {0};
    lane_bits views = {0};
    for (uint32_t i = 0; i < blocks; i++) {
        lane_bits could = (v[i].visible[0] <= at) & (v[i].visible[1] >= at);
        lane_bits did = (v[i].seen[0] <= at) & (v[i].seen[1] >= at);
        visible += (lane)((lane_bits)(v[i].weight[end] * v[i].share) & could);
        seen += (lane)((lane_bits)v[i].weight[end] & did);
        views -= did;
    }
    return total(seen) >= SUPPORT * total(visible) &&
           (views[0] + views[1] + views[2] + views[3] > 1 || n < 3);
}

/* Moves an end from the outermost place that is supported to the mean of what was seen as the end
 * there; the ends scatter. */
INLINE void settle_end(line *l, const reach *v, uint32_t blocks, int end) {
    lane sum = {0}, all = {0};
    lane_bits views = {0};
    for (uint32_t i = 0; i < blocks; i++) {
        lane off = (v[i].seen[end] - l->ends[end]) * l->f.h, far = SCATTER * v[i].pixel[end];
        lane_bits near = (off <= far) & (off >= -far);
        lane w = (lane)((lane_bits)v[i].weight[end] & near);
        sum += w * CHOOSE(near, v[i].seen[end], w);
        all += w;
        views -= near;
    }
    l->ends[end] = total(sum) / total(all);
    l->pixel[end] = sqrt((double)(views[0] + views[1] + views[2] + views[3]) / total(all));
}

/* Of a view's frame, its share: one over the number of views there that take part. */
INLINE void share_frames(const line *l, double share[LINE_KEPT]) {
    uint32_t number[LINE_KEPT], n;
    for (uint32_t i = 0; i < LINE_KEPT; i++)
        number[i] = i < l->n_kept && l->inlier[i] ? l->kept[i].frame : UINT32_MAX;
    for (uint32_t i = 0; i < l->n_kept; i++) {
        n = 0;
        for (uint32_t k = 0; k < LINE_KEPT; k++)
            n += number[k] == number[i];
        share[i] = 1.0 / n;
    }
}

INLINE void trim(line *l) {
    reach v[LINE_KEPT / VIEWS];
    uint32_t blocks = 0, n = 0;
    double M[3], D[3], ends[2] = {(double)INFINITY, -(double)INFINITY}, share[LINE_KEPT];
    share_frames(l, share);
    frame_line(&l->f, l->x, M, D);
    for (uint32_t i = 0; i < l->n_kept; i += VIEWS) {
        const view *u[VIEWS];
        lane_bits taken;
        for (uint32_t k = 0; k < VIEWS; k++) {
            bool there = i + k < l->n_kept;
            u[k] = &l->kept[there ? i + k : i];
            taken[k] = -(int64_t)(there && l->inlier[i + k]);
            v[blocks].share[k] = share[there ? i + k : i];
        }
        reach_of(u, taken, l, M, D, &v[blocks++]);
    }
    for (uint32_t i = 0; i < l->n_kept; i++)
        n += !isnan(v[i / VIEWS].seen[0][i % VIEWS]);
    for (uint32_t i = 0; i < l->n_kept; i++) {
        double from = v[i / VIEWS].seen[0][i % VIEWS], to = v[i / VIEWS].seen[1][i % VIEWS];
        if (from < ends[0] && supported(v, blocks, n, 0, from))
            ends[0] = from;
        if (to > ends[1] && supported(v, blocks, n, 1, to))
            ends[1] = to;
    }
    bool found = ends[0] < ends[1];
    l->ends[0] = found ? ends[0] : -1;
    l->ends[1] = found ? ends[1] : 1;
    for (int end = 0; found && end < 2; end++)
        settle_end(l, v, blocks, end);
}

static void trim_portable(line *l) {
    trim(l);
}

AVX2_PATH static void trim_avx2(line *l) {
    trim(l);
}

void line_trim(line *l) {
    (HAS_AVX2 ? trim_avx2 : trim_portable)(l);
}
