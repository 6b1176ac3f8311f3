/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * handeye_solve.cc: the least squares of the hand-eye (handeye.h).
 *
 * Minimised is the sum over all corners of (residual / noise)² and over all views of (correction of
 * the reported pose / the robot's sigma)². A correction touches its own view only, and the corners
 * depend on it, X and Y only through the board's pose P in that view; so they enter by the minimum
 * P_i of their reprojection and the quadratic form around it, and the correction is eliminated:
 * what is left is d_i, the flange as the camera sees it, Y P_i^-1 X^-1, against the reported one,
 * with the covariance of both. Its derivatives are in closed form. The start is closed as well: the
 * rotation by Park and Martin (1994), then the positions, which are linear.
 */
#include "handeye_solve.h"

#include <algorithm>
#include <cmath>

static const size_t PIVOT_VIEWS = 10; /* fewer do not tell it */
static const double FAR = 5000;       /* mm; such a pivot is none */

Motion motion(const cal_pose &p) {
    return {Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(p.R),
            Eigen::Map<const Vector3d>(p.t)};
}

cal_pose pose(const Motion &m) {
    cal_pose p;
    for (int i = 0; i < 9; i++)
        p.R[i] = m.R(i / 3, i % 3);
    for (int i = 0; i < 3; i++)
        p.t[i] = m.t[i];
    return p;
}

Motion operator*(const Motion &a, const Motion &b) {
    return {a.R * b.R, a.R * b.t + a.t};
}

Motion inverse(const Motion &m) {
    return {m.R.transpose(), -(m.R.transpose() * m.t)};
}

Vector3d logarithm(const Matrix3d &R) {
    Vector3d w;
    const cal_pose p = pose({R, Vector3d::Zero()});
    cal_rotation_vector(p.R, w.data());
    return w;
}

Motion moved(const Motion &m, const Vector6 &d) {
    const cal_pose p = pose(m), q = cal_moved(&p, d.data());
    return motion(q);
}

static Matrix3d cross(const Vector3d &v) {
    Matrix3d m;
    m << 0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0;
    return m;
}

static Matrix3d nearest_rotation(const Matrix3d &M) {
    const Eigen::JacobiSVD<Matrix3d> svd(M, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Vector3d d(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1);
    return svd.matrixU() * d.asDiagonal() * svd.matrixV().transpose();
}

/* ---- the start ------------------------------------------------------------------------------- */

double diversity(const std::vector<Station> &s) {
    Matrix3d M = Matrix3d::Zero();
    for (size_t i = 0; i < s.size(); i++)
        for (size_t j = 0; j < i; j++) {
            const Vector3d w = logarithm(s[i].F.R.transpose() * s[j].F.R);
            M += w * w.transpose();
        }
    const Vector3d e = Eigen::SelfAdjointEigenSolver<Matrix3d>(M).eigenvalues();
    const double turns = e[2] / ((double)s.size() * (double)(s.size() - 1) / 2); /* mean square */
    return turns > 0.003 ? std::sqrt(std::max(e[1], 0.0) / e[2]) : 0;
}

static HandEye start(const std::vector<Station> &s) {
    HandEye h{};
    Matrix3d M = Matrix3d::Zero();
    for (size_t i = 0; i < s.size(); i++)
        for (size_t j = 0; j < i; j++)
            M += logarithm(s[i].F.R.transpose() * s[j].F.R) *
                 logarithm(s[i].P.R * s[j].P.R.transpose()).transpose();
    h.X.R = nearest_rotation(M);
    Matrix3d sum = Matrix3d::Zero();
    for (const Station &v : s)
        sum += v.F.R * h.X.R * v.P.R;
    h.Y.R = nearest_rotation(sum);
    Eigen::MatrixXd A(3 * s.size(), 6);
    Eigen::VectorXd b(3 * s.size());
    for (size_t i = 0; i < s.size(); i++) { /* F (X P) = Y, its position */
        A.middleRows<3>(3 * (Eigen::Index)i) << s[i].F.R, -Matrix3d::Identity();
        b.segment<3>(3 * (Eigen::Index)i) = -(s[i].F.t + s[i].F.R * h.X.R * s[i].P.t);
    }
    const Vector6 t = A.colPivHouseholderQr().solve(b);
    h.X.t = t.head<3>();
    h.Y.t = t.tail<3>();
    return h;
}

/* ---- the minimum ----------------------------------------------------------------------------- */

Vector6 misfit(const HandEye &h, const Station &v, Matrix6x12 *J, Matrix6 *G) {
    const Motion seen = h.Y * inverse(v.P) * inverse(h.X);
    const Matrix3d B = h.Y.R * v.P.R.transpose();
    const Vector3d a = seen.t - h.Y.t; /* Y's rotation acts on it */
    Vector6 d;
    d << logarithm(seen.R * v.F.R.transpose()), seen.t - v.F.t;
    if (J) {
        const Matrix3d Z = Matrix3d::Zero(), I = Matrix3d::Identity();
        *J << -seen.R, Z, I, Z, -seen.R * cross(h.X.t), -seen.R, -cross(a), I;
    }
    if (G)
        *G << -B, Matrix3d::Zero(), B * cross(inverse(h.X).t - v.P.t), -B;
    return d;
}

/* An arm's errors in rotation and position are not independent at the flange: one joint that is off
 * moves it along a circle. They are taken to be so at another point that is fixed to the flange,
 * the pivot, which is estimated too. This turns a misfit at the flange into one at the pivot. */
Matrix6 to_pivot(const HandEye &h, const Station &v) {
    Matrix6 T = Matrix6::Identity();
    T.bottomLeftCorner<3, 3>() = -cross(v.F.R * h.pivot);
    return T;
}

Matrix6 covariance_of(const HandEye &h, const Matrix6 &G, const Station &v) {
    Vector6 robot;
    robot << Vector3d::Constant(h.sigma_r * h.sigma_r), Vector3d::Constant(h.sigma_t * h.sigma_t);
    Matrix6 back = to_pivot(h, v);
    back.bottomLeftCorner<3, 3>() *= -1;
    return back * robot.asDiagonal() * back.transpose() + G * v.cov * G.transpose();
}

/* The pivot at which the positions err least. */
static void find_pivot(HandEye *h, const std::vector<Station> &s) {
    Matrix3d A = Matrix3d::Zero();
    Vector3d b = Vector3d::Zero();
    for (const Station &v : s) {
        const Vector6 d = misfit(*h, v, nullptr, nullptr);
        const Matrix3d M = cross(d.head<3>()) * v.F.R;
        A += M.transpose() * M;
        b -= M.transpose() * d.tail<3>();
    }
    const Vector3d pivot = A.ldlt().solve(b);
    if (s.size() >= PIVOT_VIEWS && pivot.norm() < FAR)
        h->pivot = pivot;
}

/* The robot's sigmas by the misfits, less what the camera's own noise makes of them. Of the 6 n
 * values 12 are spent on X and Y. */
static void find_sigmas(HandEye *h, const std::vector<Station> &s) {
    double sum[2] = {0, 0}, camera[2] = {0, 0};
    for (const Station &v : s) {
        Matrix6 G;
        const Matrix6 T = to_pivot(*h, v);
        const Vector6 d = T * misfit(*h, v, nullptr, &G);
        const Matrix6 own = T * G * v.cov * G.transpose() * T.transpose();
        for (int k = 0; k < 2; k++) {
            sum[k] += d.segment<3>(3 * k).squaredNorm();
            camera[k] += own.diagonal().segment<3>(3 * k).sum();
        }
    }
    const double n = 3 * (double)s.size(), left = (n - 6) / n;
    h->sigma_r = std::sqrt(std::max(sum[0] / left - camera[0], 1e-4 * sum[0] + 1e-18) / n);
    h->sigma_t = std::sqrt(std::max(sum[1] / left - camera[1], 1e-4 * sum[1] + 1e-12) / n);
}

/* One Gauss-Newton step; returns its length. */
static double improve(HandEye *h, const std::vector<Station> &s) {
    Matrix12 A = Matrix12::Zero();
    Vector12 b = Vector12::Zero();
    for (const Station &v : s) {
        Matrix6x12 J;
        Matrix6 G;
        const Vector6 d = misfit(*h, v, &J, &G);
        const Matrix6 W = covariance_of(*h, G, v).inverse();
        A += J.transpose() * W * J;
        b -= J.transpose() * W * d;
    }
    const Vector12 x = A.ldlt().solve(b);
    h->information = A;
    h->X = moved(h->X, x.head<6>());
    h->Y = moved(h->Y, x.tail<6>());
    find_pivot(h, s);
    find_sigmas(h, s);
    return x.norm();
}

HandEye solve(const std::vector<Station> &s) {
    HandEye h = start(s);
    h.pivot = Vector3d::Zero();
    h.sigma_t = 1;
    h.sigma_r = 1e-3;
    for (int round = 0; round < 100 && improve(&h, s) > 1e-9; round++)
        ;
    return h;
}
