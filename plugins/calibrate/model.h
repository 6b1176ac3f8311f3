/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * model.h: the camera as `arris calibrate` estimates it, a board, and what one view of it is.
 *
 * The ten parameters are those of the thesis's eq. 2.6 with the lens of Bouguet's toolbox, and so
 * OpenCV's. What his conventions hide:
 *   - his alpha_c is skew / fx: u = fx (x + alpha_c y) + cx, ours u = fx x + skew y + cx;
 *   - his kc is [k1 k2 p1 p2 k3], the third radial term last; p1 goes with y, p2 with x:
 *     dx = 2 p1 x y + p2 (r² + 2 x²), dy = p1 (r² + 2 y²) + 2 p2 x y, on distorted-free x, y;
 *   - his toolbox fixes alpha_c and k3 at 0 unless told otherwise (est_alpha, est_dist);
 *   - pixel (0, 0) is the centre of the first pixel, as in his C-like coordinates and in OpenCV; in
 *     Matlab's own coordinates it is (1, 1), and where pixels are areas (OpenGL, most
 * photogrammetry) (0.5, 0.5): cx and cy differ by that much, and by (s - 1) / 2 when a picture is
 * scaled by s;
 *   - the uncertainties that he prints are three standard deviations, ours are one.
 */
#ifndef CALIBRATE_MODEL_H
#define CALIBRATE_MODEL_H

#include "arris_geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { CAL_FX, CAL_FY, CAL_SKEW, CAL_CX, CAL_CY, CAL_K1, CAL_K2, CAL_P1, CAL_P2, CAL_K3, CAL_N };

/* "fx", ... "k3", and "px" or "". */
extern const char *const cal_names[CAL_N], *const cal_units[CAL_N];

/* The parameters of a camera as one vector, and back. */
void cal_from_camera(const arris_camera *c, double k[CAL_N]);
arris_camera cal_to_camera(const double k[CAL_N], int32_t width, int32_t height);

/* A chessboard by its inner corners. Corner i stands in column i % cols and row i / cols; x runs
 * along the rows and y down the columns of a board that is looked at, z away from who looks. */
typedef struct cal_board {
    int32_t cols, rows;
    double square; /* mm */
} cal_board;

enum { CAL_MAX_SIDE = 100 }; /* inner corners */

static inline int cal_corners(const cal_board *b) {
    return b->cols * b->rows;
}

/* Board to camera: X_camera = R X + t. */
typedef struct cal_pose {
    double R[9], t[3]; /* t in mm */
} cal_pose;

/* The rotation matrix of a rotation vector, rad (Rodrigues), and the vector of a matrix. */
void cal_rotation(const double w[3], double R[9]);
void cal_rotation_vector(const double R[9], double w[3]);
/* C = A B for 3x3 matrices; C may be neither. */
void cal_multiply(const double A[9], const double B[9], double C[9]);
/* a after b, and the inverse. */
cal_pose cal_compose(const cal_pose *a, const cal_pose *b);
cal_pose cal_inverse(const cal_pose *p);

/* p turned by the rotation vector d[0..2] on the camera's side and shifted by d[3..5]. */
cal_pose cal_moved(const cal_pose *p, const double d[6]);

/* Corner i with the board's own shape: z is the sum of CAL_SHAPE smooth terms of degrees 2 to 4 on
 * coordinates of -1 to 1 (`shape` in mm; NULL: flat). basis, unless NULL, gets the terms. */
enum { CAL_SHAPE = 12 };
void cal_corner(const cal_board *b, const double *shape, int i, double X[3],
                double basis[CAL_SHAPE]);

/* Projects X, in the board's coordinates, to the pixel p. Jk, Jp (by cal_moved's d) and JX get the
 * Jacobians by parameters, pose and X; each may be NULL. Returns false when X is not before the
 * camera; then nothing is written. */
bool cal_project(const double k[CAL_N], const cal_pose *pose, const double X[3], double p[2],
                 double Jk[2][CAL_N], double Jp[2][6], double JX[2][3]);

#ifdef __cplusplus
}
#endif
#endif
