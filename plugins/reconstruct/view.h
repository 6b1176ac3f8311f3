/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * view.h: one sighting of a line, and how it bears on the line's four parameters. No dependency on
 * the runtime.
 *
 * The thesis (section 2.6) puts a plane through the camera centre and the observed segment, on
 * which the line lies. Here that plane is scaled so that its equation, divided by the depth, is the
 * distance in the picture: plane (X - C) / (axis (X - C)) = px of X's image to the right of the
 * segment. So every view weighs as its pixels do.
 */
#ifndef VIEW_H
#define VIEW_H

#include "arris_geometry.h"
#include "mat4.h"

typedef struct view {
    double C[3];     /* camera centre, mm */
    double axis[3];  /* optical axis; the depth of X is axis (X - C) */
    double ray[3];   /* to the middle of the segment, at depth 1 */
    double step[3];  /* by how much it turns per px along the segment */
    double plane[3]; /* ray x step, in px */
    double half;     /* px: the segment reaches from -half to half */
    double from, to; /* px: the picture reaches from here to there along it */
    double cov[3];   /* of offset and angle, as of the segment: px², px rad, rad² */
    double misfit;   /* share of it that the edge's profile left unexplained */
    double level[2]; /* grey levels on its left and on its right */
    uint32_t frame;  /* by number */
    double shift[3]; /* mm: by how much C seems off, from what the frame's other lines say; */
    double left;     /* and the share of the position's sigma that is left then */
    float blur;      /* px; 0: unknown */
    float beside[2]; /* what is on its left and on its right that is no part of a step, sigma */
} view;

/* Where a line's parameters are counted from: it passes X - h u + x[0] a + x[1] b and
 * X + h u + x[2] a + x[3] b. u, a, b are orthonormal; X, h and x are mm. A place on the line is
 * s = -1 at the first of these points, 1 at the second. */
typedef struct frame {
    double X[3], u[3], a[3], b[3], h;
} frame;

/* The noise of the poses, of one view: 0 is none. */
typedef struct pose_noise {
    double position, rotation; /* mm, rad */
    bool corrected;            /* the camera is where the views' shifts put it */
} pose_noise;

/* A view, linear about some parameters: the distances r (px) of the line, to the right of the
 * segment, at the segment's two ends; their derivatives by the four parameters, their variances and
 * covariance (px²), the share of these that is misfit, and where on the line the ends are. */
typedef struct linear {
    double r[2], J[2][4], cov[3], misfit, s[2], depth;
} linear;

/* Several views at once, with the view as the last index, and their squared Mahalanobis distances
 * (linear_distance): NAN where the line is not in front of the camera. */
enum { VIEWS = 4 };
typedef struct linears {
    double r[2][VIEWS], J[2][4][VIEWS], cov[3][VIEWS], misfit[VIEWS], s[2][VIEWS], depth[VIEWS];
    double distance[VIEWS];
} linears;

#define VIEW_PARALLEL 1e-18 /* sin² of the angle at which one looks along a line */

/* The view of a segment in pixels of the camera `c`, whose lens is taken out of them when it
 * distorts, from `pose`. `picture` is x0, y0, x1, y1, in ideal pixels, of what the camera surely
 * sees. 0, or ARRIS_E_INPUT when the segment is a point, it or the pose is not finite,
 * or it is outside of the lens. */
int view_make(view *v, const arris_segment *segment, const arris_camera *c, const arris_pose *pose,
              const double picture[4]);

/* The same view of an edge whose polarity is the other: it runs the other way. */
void view_turn(view *v);

/* Moves the segment `px` to its right; `variance`, px², of that adds to its offset's, `share` of
 * which is systematic. */
void view_move(view *v, double px, double variance, double share);

/* The line is M + s D. */
void frame_line(const frame *f, const double x[4], double M[3], double D[3]);

/* The point of the line at s. */
void frame_point(const frame *f, const double x[4], double s, double P[3]);

/* Where on the line the points of the picture are nearest that lie `px` along the segment from its
 * middle, n of them. NAN when one looks along the line. */
void view_places(const view *v, const frame *f, const double x[4], const double px[], int n,
                 double s[]);

/* The same of its two ends. */
void view_ends(const view *v, const frame *f, const double x[4], double s[2]);

/* False when the line is not in front of the camera where the segment is. */
bool view_linearise(const view *v, const frame *f, const double x[4], const pose_noise *noise,
                    linear *l);

/* The same of the first VIEWS of n views, every stride-th from the first on. Where there are fewer,
 * *l has the first again. */
void views_linearise(const view *first, uint32_t n, uint32_t stride, const frame *f,
                     const double x[4], const pose_noise *noise, linears *l);

/* The one of index k; false as view_linearise. */
bool views_pick(const linears *l, uint32_t k, linear *one);

/* Squared Mahalanobis distance of l->r, 2 degrees of freedom. `P` is the covariance of parameters
 * that this view had no part in, else NULL. */
double linear_distance(const linear *l, const mat4 *P);

#endif
