/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * smooth.cc: a homography and, for the lens, a polynomial of degree 4 on top of it, both fitted so
 * that strays do not count: the one by least medians, the other by Tukey's weights.
 */
#include "smooth.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>
#include <opencv2/calib3d.hpp>

enum { DEGREE = 4, ROUNDS = 8 };

/* The terms u^i v^j on coordinates of -1 to 1; fewer than the board has corners along a side. */
static Eigen::MatrixXd terms(const cal_board *b) {
    std::vector<Eigen::VectorXd> columns;
    for (int i = 0; i <= DEGREE && i < b->cols - 1; i++)
        for (int j = 0; i + j <= DEGREE && j < b->rows - 1; j++) {
            Eigen::VectorXd column(cal_corners(b));
            for (int k = 0; k < cal_corners(b); k++)
                column[k] = std::pow(2.0 * (k % b->cols) / (b->cols - 1) - 1, i) *
                            std::pow(2.0 * (k / b->cols) / (b->rows - 1) - 1, j);
            columns.push_back(column);
        }
    Eigen::MatrixXd A(cal_corners(b), columns.size());
    for (size_t i = 0; i < columns.size(); i++)
        A.col((Eigen::Index)i) = columns[i];
    return A;
}

static double median(Eigen::VectorXd v) {
    std::nth_element(v.data(), v.data() + v.size() / 2, v.data() + v.size());
    return v[v.size() / 2];
}

/* Least squares of A x = y (two columns) with Tukey's weights: the first rounds without. */
static Eigen::MatrixXd fit(const Eigen::MatrixXd &A, const Eigen::MatrixXd &y) {
    Eigen::MatrixXd x = Eigen::MatrixXd::Zero(A.cols(), 2);
    for (int round = 0; round < ROUNDS; round++) {
        const Eigen::VectorXd off = (y - A * x).rowwise().norm();
        const double limit = std::max(6 * median(off), 1e-3);
        const Eigen::VectorXd w = off.unaryExpr([limit](double r) {
            const double q = r / limit;
            return q < 1 ? 1 - q * q : 0;
        });
        x = (w.asDiagonal() * A).colPivHouseholderQr().solve(w.asDiagonal() * y);
    }
    return x;
}

bool smooth_board(const cal_board *b, const std::vector<cv::Point2f> &corner,
                  std::vector<cv::Point2f> *smooth) {
    std::vector<cv::Point2f> plane, flat;
    for (int i = 0; i < cal_corners(b); i++)
        plane.emplace_back((float)(i % b->cols), (float)(i / b->cols));
    const cv::Mat H = cv::findHomography(plane, corner, cv::LMEDS);
    if (H.empty())
        return false;
    cv::perspectiveTransform(plane, flat, H);
    Eigen::MatrixXd rest(corner.size(), 2);
    for (size_t i = 0; i < corner.size(); i++) {
        const cv::Point2f d = corner[i] - flat[i];
        if (!(std::fabs(d.x) < 1e6f && std::fabs(d.y) < 1e6f))
            return false;
        rest.row((Eigen::Index)i) << (double)d.x, (double)d.y;
    }
    const Eigen::MatrixXd A = terms(b), bend = A * fit(A, rest);
    for (size_t i = 0; i < corner.size(); i++)
        (*smooth)[i] =
            flat[i] + cv::Point2f((float)bend((Eigen::Index)i, 0), (float)bend((Eigen::Index)i, 1));
    return true;
}
