/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * problem.h: the least squares problem of a calibration, in C++ between the files that solve it.
 *
 * Unknown are the free parameters of the camera, the board's shape when that is asked for ("the
 * globals"), and a pose for each view. A view's pose meets no other view's, so it is eliminated
 * from the normal equations (Schur), and they are as small as the globals are few.
 */
#ifndef CALIBRATE_PROBLEM_H
#define CALIBRATE_PROBLEM_H

#include <vector>

#include <Eigen/Dense>

#include "fit.h"

typedef Eigen::Matrix<double, 6, 6> Matrix6;
typedef Eigen::Matrix<double, 6, 1> Vector6;

/* One view's part of the normal equations, for the globals g and the pose p. */
struct Block {
    Eigen::MatrixXd gg, gp; /* G x G, G x 6 */
    Matrix6 pp;
    Eigen::VectorXd g; /* J' w r */
    Vector6 p;
};

struct Observation {
    int corner;
    Eigen::Vector2d at;
    bool rejected;
};

struct View {
    cal_view *view;
    cal_pose pose;
    std::vector<Observation> seen;
};

struct Problem {
    const cal_board *board;
    double k[CAL_N];
    double shape[CAL_SHAPE];
    bool bent; /* the shape is not 0 */
    std::vector<int>
        free; /* the globals: parameters below CAL_N, then CAL_N + terms of the shape */
    std::vector<View> views;
    double noise; /* px, the scale of Huber's weights */

    /* What is left of an observation, measured minus projected; false behind the camera. */
    bool residual(const View &v, const Observation &o, Eigen::Vector2d *r) const;
    double weight(const Eigen::Vector2d &r) const;
    /* Huber's cost in px²; infinite when a corner falls behind the camera. */
    double cost() const;
    Block block(const View &v) const;
    /* The noise of one coordinate by the median of all distances. */
    void estimate_noise();
    /* Levenberg and Marquardt, until the cost falls by less than 1e-12 of it or `rounds` are over.
     */
    void minimise(int rounds);
    int observations() const;
};

/* start.cc. Poses of all views by the problem's camera; false when a view has none. */
bool start_pose(const Problem &p, View *v);
/* Camera and poses to begin with; false when no pose could be found. */
bool start_problem(Problem *p, const cal_options *o);

/* covariance.cc. Of the globals, with the degrees of freedom of each variance. False: singular. */
bool covariance(const Problem &p, Eigen::MatrixXd *cov, Eigen::VectorXd *dof);

#endif
