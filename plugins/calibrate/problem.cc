/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * problem.cc: the least squares problem of a calibration and its minimum (problem.h).
 *
 * Huber's weight beyond 3 sigma leaves Gaussian noise its efficiency and a stray corner hardly any
 * pull. Damping is Marquardt's, by the diagonal, so that the scales of the parameters don't matter.
 */
#include "problem.h"

#include <algorithm>
#include <cmath>
#include <limits>

static const double HUBER = 3; /* sigma */

bool Problem::residual(const View &v, const Observation &o, Eigen::Vector2d *r) const {
    double X[3], q[2];
    cal_corner(board, bent ? shape : nullptr, o.corner, X, nullptr);
    if (!cal_project(k, &v.pose, X, q, nullptr, nullptr, nullptr))
        return false;
    *r = o.at - Eigen::Vector2d(q[0], q[1]);
    return r->allFinite();
}

double Problem::weight(const Eigen::Vector2d &r) const {
    const double n = r.norm(), limit = HUBER * noise;
    return n > limit ? limit / n : 1;
}

double Problem::cost() const {
    double sum = 0;
    const double limit = HUBER * noise;
    for (const View &v : views)
        for (const Observation &o : v.seen) {
            Eigen::Vector2d r;
            if (o.rejected)
                continue;
            if (!residual(v, o, &r))
                return std::numeric_limits<double>::infinity();
            const double n = r.norm();
            sum += n > limit ? limit * (2 * n - limit) : n * n;
        }
    return sum;
}

/* The 2 x (G + 6) Jacobian by the globals and the pose, and the residual. */
static bool jacobian(const Problem &p, const View &v, const Observation &o, Eigen::Vector2d *r,
                     Eigen::Ref<Eigen::MatrixXd> J) {
    double X[3], q[2], basis[CAL_SHAPE], by_k[2][CAL_N], by_pose[2][6], by_X[2][3];
    cal_corner(p.board, p.bent ? p.shape : nullptr, o.corner, X, p.bent ? basis : nullptr);
    if (!cal_project(p.k, &v.pose, X, q, by_k, by_pose, by_X))
        return false;
    *r = o.at - Eigen::Vector2d(q[0], q[1]);
    const Eigen::Index G = (Eigen::Index)p.free.size();
    for (int row = 0; row < 2; row++) {
        for (Eigen::Index i = 0; i < G; i++) {
            const int at = p.free[(size_t)i];
            J(row, i) = at < CAL_N ? by_k[row][at] : by_X[row][2] * basis[at - CAL_N];
        }
        for (int i = 0; i < 6; i++)
            J(row, G + i) = by_pose[row][i];
    }
    return true;
}

Block Problem::block(const View &v) const {
    const Eigen::Index G = (Eigen::Index)free.size(), n = 2 * (Eigen::Index)v.seen.size();
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(n, G + 6); /* rows times the root of the weight */
    Eigen::VectorXd r = Eigen::VectorXd::Zero(n);
    for (Eigen::Index i = 0; i < n; i += 2) {
        const Observation &o = v.seen[(size_t)i / 2];
        Eigen::Vector2d d;
        if (o.rejected || !jacobian(*this, v, o, &d, J.middleRows(i, 2)))
            continue;
        const double root = std::sqrt(weight(d));
        J.middleRows(i, 2) *= root;
        r.segment<2>(i) = root * d;
    }
    const Eigen::MatrixXd A = J.transpose() * J;
    const Eigen::VectorXd b = J.transpose() * r;
    return {A.topLeftCorner(G, G), A.topRightCorner(G, 6), A.bottomRightCorner<6, 6>(), b.head(G),
            b.tail<6>()};
}

int Problem::observations() const {
    int n = 0;
    for (const View &v : views)
        for (const Observation &o : v.seen)
            n += !o.rejected;
    return n;
}

/* The squared distance of a 2D Gaussian has its median at 2 ln 2 sigma². */
void Problem::estimate_noise() {
    std::vector<double> squares;
    for (const View &v : views)
        for (const Observation &o : v.seen) {
            Eigen::Vector2d r;
            if (!o.rejected)
                squares.push_back(residual(v, o, &r) ? r.squaredNorm() : 1e12);
        }
    if (squares.empty())
        return;
    std::nth_element(squares.begin(), squares.begin() + squares.size() / 2, squares.end());
    const double n = 2 * (double)squares.size();
    const double unknown = (double)free.size() + 6 * (double)views.size();
    const double left = std::max(n - unknown, 0.1 * n) / n;
    noise = std::max(std::sqrt(squares[squares.size() / 2] / (2 * std::log(2)) / left), 1e-9);
}

/* The damped step of the globals and every pose. False when the equations have no solution. */
static bool step(const Problem &p, const std::vector<Block> &blocks, double damping, Problem *to) {
    const Eigen::Index G = (Eigen::Index)p.free.size();
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(G, G);
    Eigen::VectorXd b = Eigen::VectorXd::Zero(G);
    std::vector<Eigen::LDLT<Matrix6>> inverse;
    for (const Block &v : blocks) {
        Matrix6 pp = v.pp;
        pp.diagonal() *= 1 + damping;
        inverse.emplace_back(pp);
        A += v.gg - v.gp * inverse.back().solve(v.gp.transpose());
        A.diagonal() += damping * v.gg.diagonal();
        b += v.g - v.gp * inverse.back().solve(v.p);
    }
    const Eigen::VectorXd d = A.ldlt().solve(b);
    if (!d.allFinite())
        return false;
    *to = p;
    for (Eigen::Index i = 0; i < G; i++) {
        const int at = p.free[(size_t)i];
        (at < CAL_N ? to->k[at] : to->shape[at - CAL_N]) += d[i];
    }
    for (size_t v = 0; v < blocks.size(); v++) {
        const Vector6 q = inverse[v].solve(blocks[v].p - blocks[v].gp.transpose() * d);
        if (!q.allFinite())
            return false;
        to->views[v].pose = cal_moved(&p.views[v].pose, q.data());
    }
    return to->k[CAL_FX] > 0 && to->k[CAL_FY] > 0;
}

void Problem::minimise(int rounds) {
    double now = cost(), damping = 1e-3;
    Problem next = *this;
    for (int round = 0; round < rounds && damping < 1e12; round++) {
        std::vector<Block> blocks;
        for (const View &v : views)
            blocks.push_back(block(v));
        double then = now;
        for (; damping < 1e12; damping *= 10)
            if (step(*this, blocks, damping, &next) && (then = next.cost()) < now)
                break;
        if (!(then < now))
            return;
        *this = next;
        damping = std::max(damping / 10, 1e-12);
        if (now - then < 1e-12 * now)
            return;
        now = then;
    }
}
