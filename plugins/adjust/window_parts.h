/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * window_parts.h: the fixed lag from within (window.h). window.c keeps the frames, window_lines.c
 * says which lines take part, window_solve.c moves them and the poses, window_noise.c weighs them,
 * tell.c tells of them.
 */
#ifndef ADJUST_WINDOW_PARTS_H
#define ADJUST_WINDOW_PARTS_H

#include "dense.h"
#include "fit.h"
#include "window.h"

enum { WINDOW_LINES = DENSE / 4, WINDOW_VIEWS = 256, WINDOW_ALIASES = 256 }; /* views of a frame */
enum { WINDOW_LAGS = 64, WINDOW_ERRORS = WINDOW_LAGS + WINDOW_FRAMES };

/* What the poses' errors sum up to, by axis (mm², rad²), and by lag, in squared sigmas. */
typedef struct pose_sums {
    double squares[6], dof[6], redundancy[6];
    double product[WINDOW_LAGS], square[WINDOW_LAGS], n[WINDOW_LAGS];
} pose_sums;

/* A frame, linear: C d + B' x = b for its pose's step d and the lines' x; C = L L'. */
typedef struct pose_part {
    double L[6][6], b[6];
    uint32_t n, line[WINDOW_LINES];
    double B[WINDOW_LINES][4][6];
} pose_part;

/* A line of the running lines, in their order. */
typedef struct known {
    int32_t id, slot; /* the problem's line; -1: it is not in the window */
    bool adjusted;    /* l, cov and rms are; as of when it last was in the window */
    adj_line l;
    double cov[16], rms;
    enum arris_line_state state; /* when it was last said to have moved; */
    double told[6];              /* its ends then, mm */
} known;

struct window {
    window_params params;
    adj_problem p;          /* frames in a ring, WINDOW_VIEWS views for each place in it */
    uint32_t first, n;      /* the oldest frame's place; frames */
    uint32_t *n_views;      /* by place */
    pose_part *part;        /* by place */
    double (*redundant)[6]; /* by place: what the rest tells of a pose by axis; 1: all */
    int32_t *track;         /* by view */
    float *misfit;          /* likewise */
    dense H;                /* the past is x' H x - 2 g' x, x of all lines */
    double g[DENSE];
    dense U;            /* all together: the Cholesky factor, */
    double step[DENSE]; /* the right-hand side, then the step, */
    dense V;            /* and row i is U'^-1 e_i: the covariance is V V' */

    uint32_t time;                                 /* frames that there were */
    int32_t id[WINDOW_LINES];                      /* by line */
    uint32_t seen[WINDOW_LINES];                   /* likewise: `time` when it last was */
    adj_fit past[WINDOW_LINES], now[WINDOW_LINES]; /* by line */
    known *known, *before;                         /* of this frame, of the one before */
    uint32_t n_known, max_known;
    struct alias {
        int32_t track, line;
    } alias[WINDOW_ALIASES]; /* of lines that were merged */
    uint32_t n_alias;

    pose_sums past_poses;
    double error[WINDOW_ERRORS][6]; /* of the last frames, in sigmas, by `time` */
    double left, counted;           /* frames in the past; those that they counted as */
    double sigma[6], memory;        /* as of adj_quality */
    bool determined;                /* sigma is */
    double redundancy;              /* degrees of freedom that the poses take */
    double usual;                   /* of the frames' squared distances from what was reported */
    double distance;                /* mm, of the lines */
    double expected;                /* as of adj_expected_share */
};

/* The place of the i-th oldest frame. */
static inline uint32_t window_place(const window *w, uint32_t i) {
    return (w->first + i) % w->params.frames;
}

/* ---- window_lines.c: no line is NULL or stays where it was, once one was forgotten -------------
 */

/* Takes over which lines there are, and puts every view that is new or was of none to its own. */
void window_follow(window *w, const arris_lines *lines);
/* Lines that went astray start anew with the next frame, and until then nothing is told of them. */
void window_drop_strays(window *w, const arris_lines *lines);

/* ---- window_solve.c ----------------------------------------------------------------------------
 */

/* Moves the newest frame's pose to where the lines see it. */
void window_locate(window *w);
/* A step of Gauss and Newton. False when it cannot be solved: nothing has moved. */
bool window_step(window *w);
/* Where all was before the last step: V, and `redundant` of some frames, all in turn. */
void window_covariances(window *w);
void window_line_covariance(const window *w, uint32_t line, double cov[16]);
/* What the oldest frame says goes into the past; the frame itself stays. */
void window_retain(window *w);
/* Takes a line out of the past, and the last line to its rows. */
void window_eliminate(window *w, uint32_t line);

/* ---- window_noise.c ----------------------------------------------------------------------------
 */

/* Sums residuals and errors, and by them weighs lines and poses. */
void window_weigh(window *w);
/* Adds those of the oldest frame to the past's. */
void window_sum_oldest(window *w);
/* How much less all frames count by what is known of the memory now than they were counted. */
double window_late_memory(const window *w);
/* What the reported pose counts: 1, less where it is far off. */
double window_pose_weight(const window *w, uint32_t place);

#endif
