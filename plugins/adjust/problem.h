/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * problem.h: structure and motion from lines (thesis, chapter 4): what is unknown, what was seen of
 * it, and how one bears on the other. No dependency on the runtime.
 *
 * Unknown are the poses, six numbers each, the lines, four each, and what the scan's reported poses
 * have in common: their scale, a drift, the camera's place on the flange, a delay of the stamps;
 * and what the lens model left. Seen were segments; each is two residuals, the distances (px) from
 * its line's picture to its two ends. What was reported of the poses is a prior, whose errors are
 * taken for independent; where they hang together from frame to frame, adjust.h says what comes of
 * it.
 */
#ifndef ADJUST_PROBLEM_H
#define ADJUST_PROBLEM_H

#include "arris_geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { ADJ_POSE = 6, ADJ_LINE = 4, ADJ_LENS_TERMS = 4, ADJ_COMMON = 18 };

/* What the reported poses may have in common, and the pictures, as bits. */
enum { ADJ_SCALE = 1, ADJ_DRIFT = 2, ADJ_HAND_EYE = 4, ADJ_DELAY = 8, ADJ_LENS = 16 };

typedef struct adj_pose {
    double C[3], R[9]; /* as of arris_pose */
} adj_pose;

/* A frame. A pose moves by (mm along the world's axes, rad about them): see adj_pose_move. */
typedef struct adj_frame {
    adj_pose pose, reported;
    double time;  /* s, for the delay and the drift */
    bool outlier; /* what was reported is not to be believed */
} adj_frame;

/* A line through X - h u + x[0] a + x[1] b and X + h u + x[2] a + x[3] b; u, a, b are orthonormal.
 */
typedef struct adj_line {
    double X[3], u[3], a[3], b[3], h; /* mm; fixed */
    double x[4];                      /* mm; the estimate */
    double hold;                      /* mm: sigma of x about 0 before anything was seen */
    double variance;                  /* of its segments over the stated one */
    double memory;                    /* segments that count as one, since they err alike */
    double misfit;                    /* sum of the shares of it that no profile explained */
} adj_line;

/* A segment of a line in a frame. */
typedef struct adj_view {
    uint32_t frame, line;
    double end[2][2]; /* ideal px */
    double cov[3];    /* of the distances at the ends: var, cov, var; px² */
    bool apart;       /* its line is another one, most of whose views agree: it counts nothing */
} adj_view;

typedef struct adj_problem {
    arris_camera camera; /* its lens is not applied */
    uint32_t n_frames, max_frames, n_lines, max_lines, n_views, max_views;
    adj_frame *frame;
    adj_line *line;
    adj_view *view;
    double sigma[ADJ_POSE]; /* of a reported pose by axis, mm and rad */
    double robust;          /* sigmas from which a segment counts less (Cauchy's loss); 0: never */
    unsigned common;        /* which of the common states are estimated */
    double state[ADJ_COMMON]; /* those that are, in the order of the bits: 1, 6, 6, 1, 4 numbers: */
                              /* relative; mm and rad at the scan's end, minus that at its */
                              /* beginning; mm and rad, of the camera's axes; s; */
                              /* px: see adj_lens */
    double state_sigma[ADJ_COMMON]; /* of them beforehand */
} adj_problem;

/* Room for so much. 0 or ARRIS_E_MEMORY. For adj_free in any case. Nothing is allocated afterwards.
 */
int adj_init(adj_problem *p, uint32_t frames, uint32_t lines, uint32_t views);
void adj_free(adj_problem *p);

/* Each returns the number of what was added, or -1 when there is no room. The camera centre and
 * rotation are as reported, and the estimate begins there. */
int64_t adj_add_frame(adj_problem *p, const arris_pose *reported, double time);
/* The line through two points at least 1e-9 mm apart. `hold`, mm, is how far off it may be for all
 * that is known beforehand: a good part of its distance, so that it weighs nothing where views
 * tell. */
int64_t adj_add_line(adj_problem *p, const double P[3], const double Q[3], double hold);
/* A segment in ideal pixels. -1 as well when it is no segment. */
int64_t adj_add_view(adj_problem *p, uint32_t frame, uint32_t line, const arris_segment *s);

/* Which common states are estimated, and how well they are known beforehand; by default 1 %, 1 mm,
 * 1 mrad, 5 mm, 10 mrad, 50 ms, 1 px. */
void adj_set_common(adj_problem *p, unsigned common);
int adj_n_common(const adj_problem *p);
/* What the state of that number belongs to: "scale", "drift", "hand-eye", "delay", "lens". */
const char *adj_common_name(const adj_problem *p, int state);

/* The two points of the line. */
void adj_line_points(const adj_line *l, double P[3], double Q[3]);

/* C += d[0..2], and the camera is turned by the rotation vector d[3..5], in the world. */
void adj_pose_move(adj_pose *pose, const double d[6]);

/* The residuals of a segment: distances (px) of its ends to the right of the line's picture; their
 * derivatives by the pose (adj_pose_move, at 0) and by the line's x go to Jp and Jl unless these
 * are NULL. False, and nothing is written, when the line is not in front of the camera there. */
bool adj_residual(const adj_problem *p, const adj_view *v, const adj_pose *pose,
                  const adj_line *line, double r[2], double Jp[2][6], double Jl[2][4]);

/* How the distortion that is left moves the ideal pixel x (px by each lens state, which is px at
 * half the picture's width from the centre): as k1, k2, p1, p2 do (Brown 1971). */
void adj_lens(const arris_camera *c, const double x[2], double by[ADJ_LENS_TERMS][2]);

/* The derivatives of the residuals by the lens states. The line is in front of the camera. */
void adj_residual_lens(const adj_problem *p, const adj_view *v, const adj_pose *pose,
                       const adj_line *line, double J[2][ADJ_LENS_TERMS]);

/* Squared distance r' cov⁻¹ r in sigmas of the line's own variance; 2 degrees of freedom. */
double adj_distance(const adj_view *v, const adj_line *l, const double r[2]);

/* Cauchy's loss of a squared distance, and its weight, the derivative: c² log(1 + d² / c²). */
double adj_loss(const adj_problem *p, double d2);
double adj_weight(const adj_problem *p, double d2);

/* By how much all is larger than as reported. */
double adj_scale(const adj_problem *p);

/* By how much the pose differs from what was reported (mm along, rad about the world's axes) and
 * from what the common states make of it; its derivative by the pose's rotation goes to J, less
 * that by the common states to G (6 rows of ADJ_COMMON), unless NULL; that by the position is one
 * over the scale. For the error is in the robot's millimetres: in those of the scene a smaller
 * scene would have smaller errors, and be the likelier. */
void adj_error(const adj_problem *p, uint32_t frame, double e[6], double J[9],
               double G[6][ADJ_COMMON]);

/* What the prior weighs along one axis: 1 / sigma², and hardly anything for an outlier. */
double adj_precision(const adj_problem *p, int axis, uint32_t frame);

/* The sum of the losses of all views, each over its line's memory, of the prior, the lines' hold
 * and the common states'. INFINITY when a line falls behind a camera that sees it. */
double adj_cost(const adj_problem *p);

#ifdef __cplusplus
}
#endif
#endif
