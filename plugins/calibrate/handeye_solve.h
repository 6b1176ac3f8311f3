/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * handeye_solve.h: the least squares of the hand-eye, in C++ between its two files.
 */
#ifndef CALIBRATE_HANDEYE_SOLVE_H
#define CALIBRATE_HANDEYE_SOLVE_H

#include <vector>

#include <Eigen/Dense>

#include "handeye.h"

using Eigen::Matrix3d;
using Eigen::Vector3d;
typedef Eigen::Matrix<double, 6, 6> Matrix6;
typedef Eigen::Matrix<double, 6, 1> Vector6;
typedef Eigen::Matrix<double, 6, 12> Matrix6x12;
typedef Eigen::Matrix<double, 12, 12> Matrix12;
typedef Eigen::Matrix<double, 12, 1> Vector12;

/* A rigid motion in Eigen's terms. */
struct Motion {
    Matrix3d R;
    Vector3d t;
};

struct Station {
    he_view *from;
    Motion F, P;
    Matrix6 cov; /* of P by cal_moved's d */
};

struct HandEye {
    Motion X, Y;
    double sigma_t, sigma_r;
    Vector3d pivot; /* on the flange, mm: see to_pivot */
    Matrix12 information;
};

/* To and from the C type. */
Motion motion(const cal_pose &p);
cal_pose pose(const Motion &m);

Motion operator*(const Motion &a, const Motion &b);
Motion inverse(const Motion &m);
/* As cal_moved. */
Motion moved(const Motion &m, const Vector6 &d);
/* The rotation vector of R. */
Vector3d logarithm(const Matrix3d &R);

/* How far the flange's rotations between the views are from having one axis: the root of the ratio
 * of their moments about the second axis and about the first, 0 to 1; 0 when it hardly turned. */
double diversity(const std::vector<Station> &s);

/* The flange as the camera sees it against the reported one (rotation, position), its derivatives
 * by d of X and of Y, and by d of P; each may be NULL. */
Vector6 misfit(const HandEye &h, const Station &v, Matrix6x12 *J, Matrix6 *G);

/* An arm's errors in rotation and position are not independent at the flange: one joint that is off
 * moves it along a circle. They are taken to be so at another point that is fixed to the flange,
 * the pivot, which is estimated too. This turns a misfit at the flange into one at the pivot. */
Matrix6 to_pivot(const HandEye &h, const Station &v);

/* Of a misfit at the flange: the robot's share and the camera's. */
Matrix6 covariance_of(const HandEye &h, const Matrix6 &G, const Station &v);

/* X, Y and the robot's noise from at least three stations. */
HandEye solve(const std::vector<Station> &s);

#endif
