/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * covariance.cc: how well the globals of a calibration are known.
 *
 * The textbook's sigma² (J'J)^-1 takes every corner for independent. In real pictures the corners
 * of a view err together (light, blur, a board that isn't flat), and it promises too much. So the
 * views are taken as the independent draws: the sandwich A^-1 (sum s_v s_v') A^-1 of the views'
 * scores s_v, each corrected for its own pull on the fit (Bell and McCaffrey's CR2, 2002), which is
 * unbiased when the corners are independent after all. With few views it scatters, and has not even
 * full rank; it is therefore mixed with the textbook's, scaled by how much the views err together
 * on average, in the ratio of parameters to views.
 */
#include <algorithm>

#include "problem.h"

/* (I - W)^-1/2, W being a view's share of the information; a view that determines something alone
 * has 1 there, and no residual tells of it. */
static Eigen::MatrixXd unleverage(const Eigen::MatrixXd &W) {
    const Eigen::Index G = W.rows();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> e(Eigen::MatrixXd::Identity(G, G) - W);
    const Eigen::VectorXd d = e.eigenvalues().cwiseMax(0.05).cwiseSqrt().cwiseInverse();
    return e.eigenvectors() * d.asDiagonal() * e.eigenvectors().transpose();
}

/* The weighted mean square of the residuals per degree of freedom. */
static double variance(const Problem &p) {
    double sum = 0;
    for (const View &v : p.views)
        for (const Observation &o : v.seen) {
            Eigen::Vector2d r;
            if (!o.rejected && p.residual(v, o, &r))
                sum += p.weight(r) * r.squaredNorm();
        }
    const double unknown = (double)p.free.size() + 6 * (double)p.views.size();
    return sum / std::max(2 * p.observations() - unknown, 1.0);
}

bool covariance(const Problem &p, Eigen::MatrixXd *cov, Eigen::VectorXd *dof) {
    const Eigen::Index G = (Eigen::Index)p.free.size();
    const double views = (double)p.views.size(), share = (double)G / ((double)G + views);
    std::vector<Eigen::MatrixXd> parts;
    std::vector<Eigen::VectorXd> scores;
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(G, G);
    for (const View &v : p.views) {
        const Block b = p.block(v);
        const Eigen::LDLT<Matrix6> pose(b.pp);
        parts.push_back(b.gg - b.gp * pose.solve(b.gp.transpose()));
        scores.push_back(b.g - b.gp * pose.solve(b.p));
        A += parts.back();
    }
    const Eigen::VectorXd scale = A.diagonal().cwiseSqrt().cwiseInverse(); /* units differ by 1e6 */
    if (!scale.allFinite())
        return false;
    const Eigen::LLT<Eigen::MatrixXd> llt(scale.asDiagonal() * A * scale.asDiagonal());
    if (llt.info() != Eigen::Success)
        return false;
    const Eigen::MatrixXd whiten =
        llt.matrixL().solve(Eigen::MatrixXd(scale.asDiagonal())); /* whiten A whiten' = I */
    Eigen::MatrixXd B = Eigen::MatrixXd::Zero(G, G), spread = Eigen::MatrixXd::Zero(G, 2);
    for (size_t v = 0; v < parts.size(); v++) {
        const Eigen::MatrixXd W = whiten * parts[v] * whiten.transpose();
        const Eigen::VectorXd s = unleverage(W) * (whiten * scores[v]);
        B += s * s.transpose();
        const Eigen::VectorXd d = (whiten.transpose() * W * whiten).diagonal();
        spread.col(0) += d;
        spread.col(1) += d.cwiseAbs2();
    }
    const double alike = variance(p), together = std::max(B.trace() / (double)G, alike);
    B = share * together * Eigen::MatrixXd::Identity(G, G) + (1 - share) * B;
    *cov = whiten.transpose() * B * whiten;
    *dof = spread.col(0).cwiseAbs2().cwiseQuotient(spread.col(1)) / ((1 - share) * (1 - share));
    return cov->allFinite();
}
