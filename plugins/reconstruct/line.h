/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * line.h: the running estimate of one 3D line from the views of it. No dependency on the runtime.
 *
 * The estimate is the weighted least squares of the distances in the picture, by Gauss-Newton on
 * four parameters. Every view adds to a 4x4 information matrix, so it costs the same at view 10 and
 * at view 10,000. A sample of at most LINE_KEPT views, spread over the whole past, is kept: when
 * the estimate moved by more than a sigma, these are linearised anew; so is the start found, by
 * least median of squares, as the thesis wished for: up to half of the views may be of something
 * else. After that a view takes part when its chi-square is below a gate. Where a track went over
 * from one edge to another nearby, views contradict each other, and the line is split.
 */
#ifndef LINE_H
#define LINE_H

#include "info.h"

enum { LINE_KEPT = 64 };

/* How the poses' noise hangs together (memory.h): by how long, and whether roughly or smoothly. */
enum { MEMORIES = 24 };
typedef struct memories {
    bool known;
    double mean;                                 /* views that count as one, of the usual line */
    double weight[MEMORIES], variance[MEMORIES]; /* how likely it is; mm², of the noise then */
    double likelihood[MEMORIES], views, most;    /* logarithm; views in all, of a line at most */
} memories;

/* What all lines of a scan share. */
typedef struct scene {
    pose_noise noise;  /* of the poses */
    double scale;      /* variance of the residuals over the stated one; 1: as stated */
    double memory;     /* views that count as one, because their noise is correlated; at least 1 */
    memories memories; /* that of the poses alone, at the end of the scan */
    double rest;       /* what a view counts that is not kept, once the poses are well corrected:
                        * its own is not, and that is in other lines' views, too; 0: they are not */
    double S[9];       /* the covariance of the positions then, mm² */
    double depth;      /* mm; where a line is looked for as long as nothing is known of its own */
    bool waits;        /* views will tell more: what is known too badly is not judged yet */
    double nearest;    /* mm; no line is nearer; 0: unknown */
} scene;

typedef struct line {
    int32_t id;
    bool settled;    /* the estimate is good enough to be updated view by view */
    frame f;         /* reference of x; fixed once there is information in `rest` */
    double x[4];     /* the estimate, mm */
    double depth;    /* of the line in the last view, mm */
    double prior;    /* mm; sigma of x before any view */
    double scale;    /* variance of the residuals over the stated one; at least 1 */
    double drift;    /* variance of what parts of the views say over the stated one; 0: unknown */
    double shared;   /* variance of the estimate by what views share, over the stated one */
    double known;    /* variance over the stated one, of which `common` has the covariance */
    bool parted;     /* from a neighbour that it is not resolved from */
    double blend;    /* variance of a view by what is not resolved, over the stated one */
    double ends[2];  /* as places */
    double pixel[2]; /* mm that a pixel measures along it at its ends */

    info all;     /* of all views that take part */
    double at[4]; /* the estimate that the kept views were linearised about */
    mat4 cov;     /* of x, by the stated variances */
    mat4 common;  /* of x, by the poses; at the end of the scan */

    uint32_t seen, rejected;        /* views offered; views that failed the gate since it settled */
    uint32_t next_fit, next_survey; /* when `seen` is this */
    double first[3], last[3];       /* the outermost camera centres */
    double swing[2]; /* range of the angle about the line that it was seen from, rad */

    uint32_t n_kept, stride; /* every stride-th view is kept */
    bool inlier[LINE_KEPT];
    view kept[LINE_KEPT];
    info rest[LINE_KEPT]; /* of those views from a kept one to the next that take part; nothing at
                           * stride 1, and not looked at then */
} line;

/* Begins a line that no view has been added to. */
void line_begin(line *l, int32_t id);

/* Turns a view that runs against the settled line: over a changing background an edge's polarity
 * flips. */
void line_align(const line *l, view *v);

/* Adds a view. True when the line is settled and the view takes part; then *r is the view, linear
 * about the estimate before it, with its distance. */
bool line_add(line *l, const view *v, const scene *s, linear *r);

/* Fits the line to the kept views from scratch. */
void line_fit(line *l, const scene *s);

/* Repeats Gauss-Newton on all kept views until it stands. */
void line_refine(line *l, const scene *s);

/* Weighs the views anew by the scene's noise, where the estimate is. */
void line_weigh(line *l, const scene *s);

/* The sum of the views that are not kept, weighed. */
info line_past(const line *l, const scene *s);

/* What a view that is not kept counts. */
double line_rest_weight(const line *l, const scene *s);

/* What every kept view says with the rest up to the next. */
void line_groups(const line *l, const scene *s, info group[LINE_KEPT]);

/* Variance of what successive parts of n groups say over what their stated variances let expect,
 * where `expected` is the usual, and their estimate's covariance by the stated ones. 0 when the
 * groups are too few. */
double line_disagreement(const info *group, uint32_t n, double expected, mat4 *C);

/* By how much the kept views contradict each other: chi-square, over the noise's, that a second
 * line takes out of them. */
double line_contradiction(const line *l, const scene *s);

/* Parts a settled line whose views contradict each other. When they are of two edges, those of the
 * one that tells less go to *other, a line of the same id, and this returns true. Otherwise the
 * line is as it was. */
bool line_split(line *l, line *other, const scene *s);

/* Of a settled line whose views contradict each other although they are of one edge, that is seen
 * worse before or after some view: drops those when the line is the better for it. */
void line_prune(line *l, const scene *s);

/* Takes away the kept views from .. to - 1 and the rest that goes with them. */
void line_forget(line *l, uint32_t from, uint32_t to);

/* Fits the line after that, from x on where there is one, else from scratch. */
void line_resume(line *l, const scene *s, const double x[4]);

/* Finds the ends: the line reaches as far as a good part of the views saw it that could. */
void line_trim(line *l);

/* The mean blur of a line that nothing beside it moves, px; *weight is 0 when something does, or
 * when too few views tell. */
double line_blur(const line *l, double *weight);

/* Takes out of the views of a settled line by how much what is beside it moves them (beside.c),
 * when it evidently does. `usual`: blur of the lines that nothing moves, px; 0: there are none. */
void line_clear(line *l, const scene *s, double usual);

/* The best estimate that the views give, its ends and its drift. */
void line_complete(line *l, const scene *s);

/* Notes that the line was seen from C. */
void line_widen(line *l, const double C[3]);

/* Notes anew from where the kept views that take part were taken. */
void line_measure_motion(line *l);

/* Whether the camera has moved across the views by enough for the line to be observable, as far as
 * noise and outliers let that be told before it is fitted. */
bool line_may_be_observable(const line *l, const scene *s);

/* Whether the motion tells where the line is: false when it was seen from too narrow an angle, when
 * the camera moved along it, or when its parallax is not well above the noise. */
bool line_observable(const line *l);

/* The covariance across the line at two places: of the offsets along f.a and f.b at place[0], then
 * at place[1], mm². It has the residuals' true size and correlation in it. `prior`, mm, is the
 * sigma where the views tell nothing. */
mat4 line_covariance(const line *l, const scene *s, double prior, const double place[2]);

/* The sum of the squared residuals over their stated variances; 2 n - 4 when those are true. */
double line_chi2(const line *l);

/* Sigma by which the noise of the positions moves the line in the picture, px. */
double line_pose_px(const line *l, const scene *s);

/* mm between the outermost camera centres. */
double line_baseline(const line *l);

/* Whether two lines, both settled or both not, are the same edge: of the same polarity, or of the
 * opposite when `turned`, overlapping or nearly, and, by the Mahalanobis distance of their four
 * parameters, in the same place. While the scene `waits`, only what is known well enough to tell.
 */
bool line_same(const line *a, const line *b, const scene *s, bool turned);

/* Whether what was seen as b, which is not settled since the camera moved along it, is where the
 * settled line a is: of the same polarity, on it, and off it by no more than the noise. */
bool line_explains(const line *a, const line *b, const scene *s);

/* Two lines' kept views become one line's, a's. */
void line_absorb(line *a, const line *b, const scene *s);

/* Writes what is known of the line, all but id, change and into. It is measured when its sigma
 * across itself is below `limit` (mm; a negative one is the share of its distance) at both ends.
 * False when there is nothing to say: the line was looked along, and its ends may be anywhere. */
bool line_report(const line *l, const scene *s, double limit, arris_line *out);

/* A first estimate of l->f and l->scale from the kept views: the pair of planes whose intersection
 * has the least median distance. False when all planes coincide. */
bool line_start(line *l, const scene *s);

/* The same where that finds nothing: on the ray of a view, held at the distance of other lines. */
void line_guess(line *l, const scene *s);

/* Moves l->f onto the estimate, from end to end, so that x = 0. What the views said is void. */
void line_reframe(line *l);

#endif
