/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * quality.h: what a calibration is worth: its uncertainty on the part, the same by two halves of
 * the views, what the views cover, and what to do next. The rms of the residuals is none of these:
 * it falls when views are thrown away.
 */
#ifndef CALIBRATE_QUALITY_H
#define CALIBRATE_QUALITY_H

#include "fit.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { MAP_COLS = 16, MAP_ROWS = 12 };

/* µm on a plane that faces the camera, in the middle of each cell of the picture, the camera having
 * been shifted and turned as fits best: what no hand-eye calibration can take away. */
typedef struct cal_map {
    double at[MAP_ROWS][MAP_COLS];
    double worst, middle; /* the greatest, the median */
} cal_map;

enum { ADVICE_MAX = 8, GRID = 3 };

typedef struct cal_quality {
    double distance;    /* mm, of the plane */
    cal_map sigma;      /* one standard deviation */
    double depth_sigma; /* µm at that distance, of the depth, by the focal length */
    bool halved;        /* there were views enough for two halves */
    cal_result half[2];
    cal_map difference;      /* of the two halves */
    double apart;            /* the halves' parameters, rms of difference over its sigma */
    int covered[GRID][GRID]; /* corners in the outer fifths and the middle of the picture */
    int tilted;              /* views tilted by more than 20 degrees */
    double tilt_x, tilt_y;   /* degrees, the range of the tilts about the picture's x and y */
    int n_advice;
    char advice[ADVICE_MAX][240]; /* at least one */
} cal_quality;

/* Fills *q. `distance` is that of the part, mm; 0: the middle one of the views'. `views` are those
 * that the result is from. Returns 0, or ARRIS_E_MEMORY, ARRIS_E_INTERNAL. */
int cal_assess(const cal_board *b, const cal_view *views, int n, const cal_options *o,
               const cal_result *r, double distance, cal_quality *q, fault *f);

/* The first part of it alone, which is quick. */
void cal_map_sigma(const cal_result *r, double distance, cal_map *m);

/* The middle one of the views' distances, mm; 0 when none counts. */
double cal_usual_distance(const cal_board *b, const cal_view *views, int n);

/* The angle between the board's normal and the view's axis, degrees. */
double cal_tilt(const cal_view *v);

#ifdef __cplusplus
}
#endif
#endif
