/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * fit.h: estimates the camera from views of a board (Zhang 2000, with Brown's lens), robustly, and
 * says how well it is known.
 */
#ifndef CALIBRATE_FIT_H
#define CALIBRATE_FIT_H

#include "fault.h"
#include "model.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { CAL_MIN_VIEWS = 3, CAL_MAX_VIEWS = 10000 };

typedef struct cal_view {
    char *name;         /* the file; of the caller */
    double *corner;     /* cal_corners pixels x, y; NAN, NAN: not seen. Of the caller */
    char left_out[160]; /* why it does not count; empty: it does */
    cal_pose pose;      /* board to camera */
    double rms;         /* px, of the distances of its corners from where they should be */
    int used;           /* corners that count */
} cal_view;

typedef struct cal_options {
    int32_t width, height; /* px, of the pictures */
    bool fixed[CAL_N];     /* these keep `value` */
    double value[CAL_N];
    bool flat; /* estimate the board's shape */
} cal_options;

typedef struct cal_result {
    arris_camera camera;
    double k[CAL_N];
    double cov[CAL_N * CAL_N]; /* of k; rows of fixed ones are 0 */
    double dof[CAL_N];         /* degrees of freedom of each variance, for its 95 % interval */
    double noise;              /* px, sigma of one coordinate of a corner */
    double rms, rms_x, rms_y;  /* px; rms² = rms_x² + rms_y² */
    int views, corners, rejected;
    double shape[CAL_SHAPE]; /* mm, of the board; 0 when it was not estimated */
    double bulge;            /* mm, from the board's lowest corner to its highest */
    double bulge_sigma;      /* mm, of the least sure corner's height */
} cal_result;

/* Fits the camera to the views that are not left out; leaves out more, with the reason, that do not
 * fit the others. Writes the poses, rms and used of those that count. Deterministic. Returns 0, or
 * ARRIS_E_INPUT when too few views are left or the camera cannot be told from them, _MEMORY,
 * _INTERNAL. */
int cal_fit(const cal_board *b, cal_view *views, int n, const cal_options *o, cal_result *result,
            fault *f);

/* Leaves out views that show the board where another one does: they add nothing. */
void cal_leave_out_same(const cal_board *b, cal_view *views, int n, const cal_options *o);

/* The pose of the board in one view by a known camera, from the corners whose `use` is not 0 (NULL:
 * all that are seen), robustly; `cov` (unless NULL) gets its covariance by cal_moved's d for a
 * noise of 1 px. Returns 0 or ARRIS_E_INPUT. */
int cal_find_pose(const cal_board *b, const arris_camera *c, const double *shape,
                  const double *corner, const uint8_t *use, cal_pose *pose, double cov[36]);

/* The half-width of the 95 % interval in standard deviations (Student's t). */
double cal_coverage(double dof);

#ifdef __cplusplus
}
#endif
#endif
