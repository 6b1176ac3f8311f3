/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * handeye.cc: where the camera sits on the robot's flange (handeye.h): which views count, and what
 * the result is worth. The estimate itself is handeye_solve.cc.
 */
#include "handeye.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <new>
#include <vector>

#include "find.h"
#include "handeye_solve.h"

static const double ONE_AXIS = 0.02; /* of the diversity: below, a direction is unobservable */
static const double OUTLIER = 4;     /* times the middle view's misfit */
static const int FOLDS = 5;

static const char hint_turn[] =
    "turn the flange by 30 degrees and more about at least two axes between the views, with the "
    "whole board in the picture";

/* ---- how the board lies ---------------------------------------------------------------------- */

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
