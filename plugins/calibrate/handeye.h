/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * handeye.h: where the camera sits on the robot's flange.
 *
 * The robot reports the flange F_i, the camera sees the board at P_i; sought are the camera on the
 * flange X and the board in the base Y, both fixed:  F_i X P_i = Y. Neither the robot nor the
 * camera is exact: every corner of every view is a measurement with the camera's noise, and every
 * reported pose one with the robot's, whose sigmas in position and rotation are estimated along.
 */
#ifndef CALIBRATE_HANDEYE_H
#define CALIBRATE_HANDEYE_H

#include "fit.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct he_view {
    cal_view *view;   /* its corners; left_out is written when the view does not fit */
    cal_pose flange;  /* flange to base, as reported */
    double off_mm;    /* how far the reported flange is from where the camera sees it */
    double off_angle; /* rad, likewise */
    double held_out;  /* mm, the first by the hand-eye from the other four fifths of the views */
    double reported;  /* px, rms of the corners by the reported flange pose */
    double corrected; /* px, rms of the corners by the pose as adjusted between both */
} he_view;

typedef struct he_result {
    cal_pose camera_to_flange, board_to_base;
    double cov[36]; /* of camera_to_flange: position mm, rotation vector rad on the flange's side */
    double sigma_mm;    /* of a reported position along each axis */
    double sigma_angle; /* rad, of a reported rotation about each axis */
    double corner_px;   /* rms of all corners by their best poses: what the camera itself leaves */
    double reported_px, corrected_px; /* rms over the views */
    double scatter[3]; /* mm, of the board's origin seen from the base, along the base's axes */
    double off_mm, off_angle, held_out; /* rms over the views */
    double diversity; /* 0 to 1: how far the rotations' axes are from all being one */
    int views;
} he_result;

enum { HE_MIN_VIEWS = 4 };

/* Estimates both from the views that are not left out. Returns 0, or ARRIS_E_INPUT when they are
 * too few or the flange hardly turned, _MEMORY, _INTERNAL. */
int he_fit(const cal_board *b, const arris_camera *c, he_view *views, int n, he_result *result,
           fault *f);

#ifdef __cplusplus
}
#endif
#endif
