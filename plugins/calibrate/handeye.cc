/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * handeye.cc: where the camera sits on the robot's flange (handeye.h).
 *
 * Minimised is the sum over all corners of (residual / noise)² and over all views of (correction of
 * the reported pose / the robot's sigma)². A correction touches its own view only, and the corners
 * depend on it, X and Y only through the board's pose P in that view; so they enter by the minimum
 * P_i of their reprojection and the quadratic form around it, and the correction is eliminated:
 * what is left is d_i, the flange as the camera sees it, Y P_i^-1 X^-1, against the reported one,
 * with the covariance of both. Its derivatives are in closed form. The start is closed as well: the
 * rotation by Park and Martin (1994), then the positions, which are linear.
 */
#include "handeye.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <new>
#include <vector>

#include <Eigen/Dense>

#include "find.h"

using Eigen::Matrix3d;
using Eigen::Vector3d;
typedef Eigen::Matrix<double, 6, 6> Matrix6;
typedef Eigen::Matrix<double, 6, 1> Vector6;
typedef Eigen::Matrix<double, 6, 12> Matrix6x12;
typedef Eigen::Matrix<double, 12, 12> Matrix12;
typedef Eigen::Matrix<double, 12, 1> Vector12;

static const double ONE_AXIS = 0.02; /* of the diversity: below, a direction is unobservable */
static const double OUTLIER = 4;     /* times the middle view's misfit */
static const int FOLDS = 5;
static const size_t PIVOT_VIEWS = 10; /* fewer do not tell it */
static const double FAR = 5000;       /* mm; such a pivot is none */

static const char hint_turn[] =
    "turn the flange by 30 degrees and more about at least two axes between the views, with the "
    "whole board in the picture";

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
    Vector3d pivot; /* on the flange, mm: see spread() */
    Matrix12 information;
};

static Motion motion(const cal_pose &p) {
    return {Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(p.R),
            Eigen::Map<const Vector3d>(p.t)};
}

static cal_pose pose(const Motion &m) {
    cal_pose p;
    for (int i = 0; i < 9; i++)
        p.R[i] = m.R(i / 3, i % 3);
    for (int i = 0; i < 3; i++)
        p.t[i] = m.t[i];
    return p;
}

static Motion operator*(const Motion &a, const Motion &b) {
    return {a.R * b.R, a.R * b.t + a.t};
}

static Motion inverse(const Motion &m) {
    return {m.R.transpose(), -(m.R.transpose() * m.t)};
}

static Vector3d logarithm(const Matrix3d &R) {
    Vector3d w;
    const cal_pose p = pose({R, Vector3d::Zero()});
    cal_rotation_vector(p.R, w.data());
    return w;
}

static Motion moved(const Motion &m, const Vector6 &d) {
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

/* The rotations between the views, as the flange does them: their second moments. The second
 * greatest eigenvalue over the greatest says whether there is more than one axis. */
static double diversity(const std::vector<Station> &s) {
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

static void turn(const cal_board *b, const Station &v) {
    (find_turns(b) == 4 ? find_turn_quarter : find_turn_half)(b, v.from->view->corner);
}

static bool pose_station(const cal_board *b, const arris_camera *c, Station *v) {
    cal_view *w = v->from->view;
    if (cal_find_pose(b, c, nullptr, w->corner, nullptr, &w->pose, v->cov.data()))
        return false;
    v->P = motion(w->pose);
    return true;
}

/* The board may look the same turned by 180 or 90 degrees; the robot knows how far the flange has
 * turned since the first view. */
static void settle_turns(const cal_board *b, const arris_camera *c, std::vector<Station> *s) {
    const int turns = find_turns(b);
    for (size_t i = 1; turns > 1 && i < s->size(); i++) {
        Station *v = &(*s)[i];
        const double angle = logarithm(v->F.R.transpose() * s->front().F.R).norm();
        double least = INFINITY;
        int best = 0;
        for (int k = 0; k < turns; k++, turn(b, *v)) { /* ends as it began */
            pose_station(b, c, v);
            const double off =
                std::fabs(logarithm(v->P.R * s->front().P.R.transpose()).norm() - angle);
            best = off < least ? k : best;
            least = std::min(off, least);
        }
        for (int k = 0; k < best; k++)
            turn(b, *v);
        pose_station(b, c, v);
    }
}

/* ---- the minimum ----------------------------------------------------------------------------- */

/* The flange as the camera sees it against the reported one (rotation, position), its derivatives
 * by d of X and of Y, and by d of P. */
static Vector6 misfit(const HandEye &h, const Station &v, Matrix6x12 *J, Matrix6 *G) {
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
static Matrix6 to_pivot(const HandEye &h, const Station &v) {
    Matrix6 T = Matrix6::Identity();
    T.bottomLeftCorner<3, 3>() = -cross(v.F.R * h.pivot);
    return T;
}

/* Of a misfit at the flange: the robot's share and the camera's. */
static Matrix6 covariance_of(const HandEye &h, const Matrix6 &G, const Station &v) {
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

static HandEye solve(const std::vector<Station> &s) {
    HandEye h = start(s);
    h.pivot = Vector3d::Zero();
    h.sigma_t = 1;
    h.sigma_r = 1e-3;
    for (int round = 0; round < 100 && improve(&h, s) > 1e-9; round++)
        ;
    return h;
}

/* ---- what it is worth ------------------------------------------------------------------------ */

/* The rms of a view's corners when the board is at P. */
static double reprojection(const cal_board *b, const arris_camera *c, const cal_view *v,
                           const Motion &P) {
    const cal_pose p = pose(P);
    double k[CAL_N], sum = 0;
    int n = 0;
    cal_from_camera(c, k);
    for (int i = 0; i < cal_corners(b); i++) {
        double X[3], q[2];
        cal_corner(b, nullptr, i, X, nullptr);
        if (std::isnan(v->corner[2 * i]) || !cal_project(k, &p, X, q, nullptr, nullptr, nullptr))
            continue;
        sum += std::pow(v->corner[2 * i] - q[0], 2) + std::pow(v->corner[2 * i + 1] - q[1], 2);
        n++;
    }
    return std::sqrt(sum / std::max(n, 1));
}

static void measure_view(const cal_board *b, const arris_camera *c, const HandEye &h, Station *s) {
    he_view *v = s->from;
    Matrix6 G;
    const Vector6 d = misfit(h, *s, nullptr, &G);
    v->off_angle = d.head<3>().norm();
    v->off_mm = d.tail<3>().norm();
    /* The best estimate of the flange, by the robot's sigmas and the camera's. */
    const Matrix6 S = covariance_of(h, G, *s);
    const Vector6 e = d - G * s->cov * G.transpose() * S.inverse() * d;
    const Motion corrected = moved(s->F, e);
    v->reported = reprojection(b, c, v->view, inverse(h.X) * inverse(s->F) * h.Y);
    v->corrected = reprojection(b, c, v->view, inverse(h.X) * inverse(corrected) * h.Y);
}

static void hold_out(const std::vector<Station> &s) {
    for (int fold = 0; fold < FOLDS; fold++) {
        std::vector<Station> rest;
        for (size_t i = 0; i < s.size(); i++)
            if ((int)(i % FOLDS) != fold)
                rest.push_back(s[i]);
        if ((int)rest.size() < HE_MIN_VIEWS - 1)
            continue;
        const HandEye h = solve(rest);
        for (size_t i = (size_t)fold; i < s.size(); i += FOLDS)
            s[i].from->held_out = misfit(h, s[i], nullptr, nullptr).tail<3>().norm();
    }
}

static void measure_scatter(const HandEye &h, const std::vector<Station> &s, he_result *r) {
    Vector3d mean = Vector3d::Zero(), square = Vector3d::Zero();
    for (const Station &v : s) {
        const Vector3d origin = (v.F * h.X * v.P).t;
        mean += origin;
        square += origin.cwiseAbs2();
    }
    const double n = (double)s.size();
    const Vector3d sigma = (square / n - (mean / n).cwiseAbs2()).cwiseMax(0).cwiseSqrt();
    std::copy(sigma.data(), sigma.data() + 3, r->scatter);
}

static void measure(const cal_board *b, const arris_camera *c, const HandEye &h,
                    std::vector<Station> *s, he_result *r) {
    double sums[6] = {0};
    for (Station &v : *s) {
        measure_view(b, c, h, &v);
        const he_view *w = v.from;
        const double parts[6] = {w->off_mm,   w->off_angle, w->held_out,
                                 w->reported, w->corrected, w->view->rms};
        for (int k = 0; k < 6; k++)
            sums[k] += parts[k] * parts[k] / (double)s->size();
    }
    r->off_mm = std::sqrt(sums[0]);
    r->off_angle = std::sqrt(sums[1]);
    r->held_out = std::sqrt(sums[2]);
    r->reported_px = std::sqrt(sums[3]);
    r->corrected_px = std::sqrt(sums[4]);
    r->corner_px = std::sqrt(sums[5]);
    r->views = (int)s->size();
    r->camera_to_flange = pose(h.X);
    r->board_to_base = pose(h.Y);
    r->sigma_mm = h.sigma_t;
    r->sigma_angle = h.sigma_r;
    const Matrix12 cov = h.information.inverse(); /* rotation first there, position first here */
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++)
            r->cov[6 * i + j] = cov((i + 3) % 6, (j + 3) % 6);
    measure_scatter(h, *s, r);
}

/* ---- the whole ------------------------------------------------------------------------------- */

static std::vector<Station> stations(const cal_board *b, const arris_camera *c, he_view *views,
                                     int n) {
    std::vector<Station> s;
    for (int i = 0; i < n; i++) {
        Station v{&views[i], motion(views[i].flange), {}, {}};
        cal_view *w = views[i].view;
        if (*w->left_out)
            continue;
        if (pose_station(b, c, &v))
            s.push_back(v);
        else
            snprintf(w->left_out, sizeof w->left_out, "the board's pose cannot be told");
    }
    if (!s.empty())
        settle_turns(b, c, &s);
    double sum = 0;
    for (Station &v : s) {
        v.from->view->rms = reprojection(b, c, v.from->view, v.P);
        sum += v.from->view->rms * v.from->view->rms;
    }
    for (Station &v : s) /* of one coordinate */
        v.cov *= sum / (double)s.size() / 2;
    return s;
}

/* Leaves out views whose flange is elsewhere than the camera says; true when there was any. */
static bool leave_out_outliers(const HandEye &h, std::vector<Station> *s) {
    std::vector<double> off;
    for (const Station &v : *s) {
        const Vector6 d = misfit(h, v, nullptr, nullptr);
        const Vector6 e = to_pivot(h, v) * d;
        off.push_back(std::hypot(e.head<3>().norm() / h.sigma_r, e.tail<3>().norm() / h.sigma_t));
    }
    std::vector<double> sorted = off;
    std::nth_element(sorted.begin(), sorted.begin() + sorted.size() / 2, sorted.end());
    const double limit = OUTLIER * sorted[sorted.size() / 2];
    std::vector<Station> kept;
    for (size_t i = 0; i < s->size(); i++) {
        const Station &v = (*s)[i];
        const Vector6 d = misfit(h, v, nullptr, nullptr);
        if (off[i] > limit)
            snprintf(v.from->view->left_out, sizeof v.from->view->left_out,
                     "the flange is %.1f mm and %.2f degrees from where the camera sees it",
                     d.tail<3>().norm(), d.head<3>().norm() * 180 / M_PI);
        else
            kept.push_back(v);
    }
    const bool any = kept.size() < s->size();
    *s = kept;
    return any;
}

static int check(const std::vector<Station> &s, int n, he_result *r, fault *f) {
    if ((int)s.size() < HE_MIN_VIEWS)
        return fault_set(f, ARRIS_E_INPUT, hint_turn, "%zu of %d views can be used; %d are needed",
                         s.size(), n, HE_MIN_VIEWS);
    r->diversity = diversity(s);
    if (r->diversity < ONE_AXIS)
        return fault_set(f, ARRIS_E_INPUT, hint_turn,
                         "the flange turned about one axis only, or hardly: the camera's position "
                         "along it is unobservable");
    return 0;
}

static int fit(const cal_board *b, const arris_camera *c, he_view *views, int n, he_result *r,
               fault *f) {
    *r = he_result{};
    std::vector<Station> s = stations(b, c, views, n);
    HandEye h;
    for (int round = 0; round < 3; round++) {
        const int bad = check(s, n, r, f);
        if (bad < 0)
            return bad;
        h = solve(s);
        if (!leave_out_outliers(h, &s))
            break;
    }
    const int bad = check(s, n, r, f);
    if (bad < 0)
        return bad;
    h = solve(s);
    if (!h.X.t.allFinite() || !h.information.allFinite())
        return fault_set(f, ARRIS_E_INPUT, hint_turn, "the views do not determine the hand-eye");
    hold_out(s);
    measure(b, c, h, &s, r);
    return 0;
}

int he_fit(const cal_board *b, const arris_camera *c, he_view *views, int n, he_result *result,
           fault *f) {
    try {
        return fit(b, c, views, n, result, f);
    } catch (const std::bad_alloc &) {
        return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory for %d views", n);
    } catch (const std::exception &e) {
        return fault_set(f, ARRIS_E_INTERNAL, NULL, "the hand-eye failed: %.200s", e.what());
    }
}
