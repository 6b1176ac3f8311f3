/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * start.cc: where a calibration begins.
 *
 * The homography of each view constrains the focal length (Zhang 2000) when the principal point is
 * taken to be the picture's middle. A strong lens or nearly parallel views make that worthless, so
 * it is one candidate of several, each is tried for some steps, and the best one goes on.
 */
#include <cmath>

#include <opencv2/calib3d.hpp>

#include "problem.h"

static const double GOOD = 0.5; /* px: no other candidate can be right */

/* Board (mm) to the pixels or bearings that `seen` maps to. False when there is none. */
static bool homography(const Problem &p, const View &v, const std::vector<cv::Point2d> &to,
                       Eigen::Matrix3d *H) {
    std::vector<cv::Point2d> from, where;
    for (size_t i = 0; i < v.seen.size(); i++) {
        if (v.seen[i].rejected)
            continue;
        const int c = v.seen[i].corner;
        from.emplace_back((c % p.board->cols) * p.board->square,
                          (c / p.board->cols) * p.board->square);
        where.push_back(to[i]);
    }
    if (from.size() < 4)
        return false;
    const cv::Mat h = cv::findHomography(from, where, cv::LMEDS);
    if (h.empty())
        return false;
    for (int i = 0; i < 9; i++)
        (*H)(i / 3, i % 3) = h.at<double>(i / 3, i % 3);
    return H->allFinite();
}

/* The closed form of the focal length in px; 0 when the views do not give one. */
static double focal_length(const Problem &p, double cx, double cy) {
    double aa = 0, ab = 0;
    for (const View &v : p.views) {
        std::vector<cv::Point2d> to;
        Eigen::Matrix3d H;
        for (const Observation &o : v.seen)
            to.emplace_back(o.at.x() - cx, o.at.y() - cy);
        if (!homography(p, v, to, &H))
            continue;
        const Eigen::Vector3d x = H.col(0), y = H.col(1);
        const double n = x.head<2>().squaredNorm() + y.head<2>().squaredNorm();
        const double a[2] = {x.head<2>().dot(y.head<2>()) / n,
                             (x.head<2>().squaredNorm() - y.head<2>().squaredNorm()) / n};
        const double b[2] = {-x[2] * y[2] / n, -(x[2] * x[2] - y[2] * y[2]) / n};
        for (int i = 0; i < 2; i++) {
            aa += a[i] * a[i];
            ab += a[i] * b[i];
        }
    }
    return aa > 0 && ab > 0 ? std::sqrt(aa / ab) : 0;
}

bool start_pose(const Problem &p, View *v) {
    const arris_camera c = cal_to_camera(p.k, 1, 1);
    std::vector<cv::Point2d> to;
    for (const Observation &o : v->seen) {
        double x, y;
        arris_undistort(&c, o.at.x(), o.at.y(), &x, &y);
        y = (y - c.cy) / c.fy;
        to.emplace_back((x - c.cx - c.skew * y) / c.fx, y);
    }
    Eigen::Matrix3d H;
    if (!homography(p, *v, to, &H))
        return false;
    H /= std::sqrt(H.col(0).norm() * H.col(1).norm()) * (H(2, 2) < 0 ? -1 : 1);
    Eigen::Matrix3d R;
    R << H.col(0), H.col(1), H.col(0).cross(H.col(1));
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(R, Eigen::ComputeFullU | Eigen::ComputeFullV);
    R = svd.matrixU() * svd.matrixV().transpose();
    if (!R.allFinite() || R.determinant() < 0)
        return false;
    for (int i = 0; i < 9; i++)
        v->pose.R[i] = R(i / 3, i % 3);
    for (int i = 0; i < 3; i++)
        v->pose.t[i] = H(i, 2);
    return true;
}

bool start_problem(Problem *p, const cal_options *o) {
    const double cx = (o->width - 1) / 2.0, cy = (o->height - 1) / 2.0;
    const double side = std::max(o->width, o->height);
    const double candidates[] = {focal_length(*p, cx, cy), side, 0.6 * side, 1.8 * side, 4 * side};
    Problem best = *p;
    bool found = false;
    for (const double f : candidates) {
        Problem q = *p;
        const double k[CAL_N] = {f, f, 0, cx, cy, 0, 0, 0, 0, 0};
        for (int i = 0; i < CAL_N; i++)
            q.k[i] = o->fixed[i] ? o->value[i] : k[i];
        bool posed = f > 0;
        for (View &v : q.views)
            posed = posed && start_pose(q, &v);
        if (!posed)
            continue;
        q.noise = 1;
        q.minimise(15);
        q.estimate_noise();
        if (!found || q.noise < best.noise)
            best = q;
        found = true;
        if (best.noise < GOOD)
            break;
    }
    *p = best;
    return found;
}
