/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * fit.cc: estimates the camera from views of a board (fit.h).
 */
#include "fit.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <new>

#include "problem.h"

static const double REJECT = 5;   /* sigma: such a corner is none */
static const double BAD_VIEW = 3; /* times the rms of the view in the middle */
static const double MOST_REJECTED = 0.3;
static const double SAME = 0.002; /* of the picture's diagonal: views that are one */
static const double BLIND = 0.03; /* sigma of the focal length over it: it is not known */
static const double MIN_TILT = 7; /* degrees; below, tilt and noise look alike */

static const char hint_views[] =
    "take 15 or more pictures with the whole board in them, tilted by 20 to 45 degrees to all "
    "sides, near and far, and into every corner of the picture";

double cal_coverage(double dof) {
    const double z = 1.959964, v = std::max(dof, 2.0);
    return z + (z * z * z + z) / (4 * v) +
           (5 * std::pow(z, 5) + 16 * z * z * z + 3 * z) / (96 * v * v);
}

/* ---- the problem ----------------------------------------------------------------------------- */

static View make_view(const cal_board *b, cal_view *from) {
    View v{from, {}, {}};
    for (int i = 0; i < cal_corners(b); i++)
        if (std::isfinite(from->corner[2 * i]) && std::isfinite(from->corner[2 * i + 1]))
            v.seen.push_back({i, {from->corner[2 * i], from->corner[2 * i + 1]}, false});
    return v;
}

static Problem make_problem(const cal_board *b, cal_view *views, int n, const cal_options *o) {
    Problem p{};
    p.board = b;
    for (int i = 0; i < CAL_N; i++)
        if (!o->fixed[i])
            p.free.push_back(i);
    for (int i = 0; i < n; i++)
        if (!*views[i].left_out)
            p.views.push_back(make_view(b, &views[i]));
    return p;
}

static double rms_of(const Problem &p, const View &v, int *used) {
    double sum = 0;
    *used = 0;
    for (const Observation &o : v.seen) {
        Eigen::Vector2d r;
        if (o.rejected || !p.residual(v, o, &r))
            continue;
        sum += r.squaredNorm();
        ++*used;
    }
    return std::sqrt(sum / std::max(*used, 1));
}

/* To the minimum with Huber's scale and the residuals in agreement. */
static void settle(Problem *p) {
    for (int round = 0; round < 8; round++) {
        const double before = p->noise;
        p->estimate_noise();
        p->minimise(50);
        if (std::fabs(p->noise - before) < 1e-3 * p->noise)
            break;
    }
}

static void reject_corners(Problem *p) {
    for (View &v : p->views)
        for (Observation &o : v.seen) {
            Eigen::Vector2d r;
            o.rejected = !p->residual(v, o, &r) || r.norm() > REJECT * p->noise;
        }
}

/* Leaves out what does not fit; returns whether there was any. */
static bool reject_views(Problem *p) {
    std::vector<double> rms;
    int used;
    for (const View &v : p->views)
        rms.push_back(rms_of(*p, v, &used));
    std::vector<double> sorted = rms;
    std::nth_element(sorted.begin(), sorted.begin() + sorted.size() / 2, sorted.end());
    const double usual = sorted[sorted.size() / 2];
    const size_t before = p->views.size();
    std::vector<View> kept;
    for (size_t i = 0; i < before; i++) {
        const View &v = p->views[i];
        rms_of(*p, v, &used);
        const double lost = 1 - (double)used / std::max((double)v.seen.size(), 1.0);
        if (rms[i] > BAD_VIEW * usual && rms[i] > 0.1)
            snprintf(v.view->left_out, sizeof v.view->left_out,
                     "its corners are off by %.2f px, the usual view's by %.2f", rms[i], usual);
        else if (lost > MOST_REJECTED)
            snprintf(v.view->left_out, sizeof v.view->left_out,
                     "%.0f %% of its corners are off by more than %.1f px", 100 * lost,
                     REJECT * p->noise);
        else
            kept.push_back(v);
    }
    p->views = kept;
    return kept.size() < before;
}

/* A view may have begun in a false minimum of its pose: once more, by the camera as it is now. */
static void pose_anew(Problem *p) {
    for (View &v : p->views) {
        int used;
        View again = v;
        if (start_pose(*p, &again) && rms_of(*p, again, &used) < rms_of(*p, v, &used))
            v = again;
    }
}

/* ---- what can go wrong ----------------------------------------------------------------------- */

static int too_few(const Problem &p, int n, fault *f) {
    if (p.views.size() >= CAL_MIN_VIEWS)
        return 0;
    return fault_set(f, ARRIS_E_INPUT, hint_views,
                     "%zu of %d views can be used, and a camera needs at least %d that differ",
                     p.views.size(), n, CAL_MIN_VIEWS);
}

static double tilt_of(const View &v) {
    return std::acos(std::min(1.0, std::fabs(v.pose.R[8]))) * 180 / M_PI;
}

/* Refuses what a fit would answer with figures that mean nothing. */
static int check_focal(const Problem &p, const Eigen::MatrixXd *cov, fault *f) {
    double tilt = 0, sigma = 0;
    for (const View &v : p.views)
        tilt = std::max(tilt, tilt_of(v));
    for (size_t i = 0; cov && i < p.free.size(); i++)
        if (p.free[i] == CAL_FX || p.free[i] == CAL_FY)
            sigma = std::max(sigma,
                             std::sqrt((*cov)((Eigen::Index)i, (Eigen::Index)i)) / p.k[p.free[i]]);
    const bool asked = std::find(p.free.begin(), p.free.end(), (int)CAL_FX) != p.free.end();
    if (asked && tilt < MIN_TILT)
        return fault_set(f, ARRIS_E_INPUT, hint_views,
                         "the focal length is unobservable: the board faces the camera in every "
                         "view (tilted by %.1f degrees at most), and a nearer camera looks like a "
                         "longer lens",
                         tilt);
    if (asked && (!cov || !(sigma < BLIND)))
        return fault_set(f, ARRIS_E_INPUT, hint_views,
                         "the focal length is unobservable: the views leave it open by %.0f %%; "
                         "they are too few or too much alike",
                         cov ? 100 * sigma : 100.0);
    return cov ? 0
               : fault_set(f, ARRIS_E_INPUT, hint_views,
                           "the views do not determine all parameters: fix some, or add views");
}

/* ---- the result ------------------------------------------------------------------------------ */

static void measure_shape(const Problem &p, const Eigen::MatrixXd &cov, cal_result *r) {
    double low = 0, high = 0;
    const Eigen::Index first = (Eigen::Index)p.free.size() - CAL_SHAPE;
    for (int i = 0; i < cal_corners(p.board); i++) {
        double X[3];
        Eigen::Matrix<double, CAL_SHAPE, 1> basis;
        cal_corner(p.board, p.shape, i, X, basis.data());
        low = i ? std::min(low, X[2]) : X[2];
        high = i ? std::max(high, X[2]) : X[2];
        const double var = basis.dot(cov.block<CAL_SHAPE, CAL_SHAPE>(first, first) * basis);
        r->bulge_sigma = std::max(r->bulge_sigma, std::sqrt(var));
    }
    std::copy(p.shape, p.shape + CAL_SHAPE, r->shape);
    r->bulge = high - low;
}

static void measure_residuals(const Problem &p, cal_result *r) {
    double x = 0, y = 0;
    for (const View &v : p.views) {
        for (const Observation &o : v.seen) {
            Eigen::Vector2d d;
            r->rejected += o.rejected;
            if (o.rejected || !p.residual(v, o, &d))
                continue;
            x += d.x() * d.x();
            y += d.y() * d.y();
        }
        v.view->pose = v.pose;
        v.view->rms = rms_of(p, v, &v.view->used);
    }
    r->views = (int)p.views.size();
    r->corners = p.observations();
    r->rms_x = std::sqrt(x / std::max(r->corners, 1));
    r->rms_y = std::sqrt(y / std::max(r->corners, 1));
    r->rms = std::hypot(r->rms_x, r->rms_y);
}

static void fill(const Problem &p, const cal_options *o, const Eigen::MatrixXd &cov,
                 const Eigen::VectorXd &dof, cal_result *r) {
    *r = cal_result{};
    std::copy(p.k, p.k + CAL_N, r->k);
    r->camera = cal_to_camera(p.k, o->width, o->height);
    r->noise = p.noise;
    for (size_t i = 0; i < p.free.size() && p.free[i] < CAL_N; i++) {
        r->dof[p.free[i]] = dof[(Eigen::Index)i];
        for (size_t j = 0; j < p.free.size() && p.free[j] < CAL_N; j++)
            r->cov[p.free[i] * CAL_N + p.free[j]] = cov((Eigen::Index)i, (Eigen::Index)j);
    }
    if (o->flat)
        measure_shape(p, cov, r);
    measure_residuals(p, r);
}

/* ---- the whole ------------------------------------------------------------------------------- */

static int fit(const cal_board *b, cal_view *views, int n, const cal_options *o, cal_result *result,
               fault *f) {
    Problem p = make_problem(b, views, n, o);
    int r = too_few(p, n, f);
    if (r < 0)
        return r;
    if (!start_problem(&p, o))
        return fault_set(f, ARRIS_E_INPUT, hint_views, "the views give no camera to begin with");
    for (int round = 0; round < 4; round++) {
        settle(&p);
        pose_anew(&p);
        settle(&p);
        reject_corners(&p);
        if (!reject_views(&p))
            break;
        if ((r = too_few(p, n, f)) < 0)
            return r;
    }
    p.bent = o->flat;
    for (int i = 0; p.bent && i < CAL_SHAPE; i++)
        p.free.push_back(CAL_N + i);
    settle(&p);
    Eigen::MatrixXd cov;
    Eigen::VectorXd dof;
    const bool sure = covariance(p, &cov, &dof);
    if ((r = check_focal(p, sure ? &cov : nullptr, f)) < 0)
        return r;
    fill(p, o, cov, dof, result);
    return 0;
}

int cal_fit(const cal_board *b, cal_view *views, int n, const cal_options *o, cal_result *result,
            fault *f) {
    try {
        return fit(b, views, n, o, result, f);
    } catch (const std::bad_alloc &) {
        return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory to calibrate with %d views", n);
    } catch (const std::exception &e) {
        return fault_set(f, ARRIS_E_INTERNAL, NULL, "calibrating failed: %.200s", e.what());
    }
}

/* ---- views alike ----------------------------------------------------------------------------- */

static double distance(const cal_board *b, const cal_view *v, const cal_view *w) {
    double sum = 0;
    int n = 0;
    for (int i = 0; i < cal_corners(b); i++) {
        const double d = std::hypot(v->corner[2 * i] - w->corner[2 * i],
                                    v->corner[2 * i + 1] - w->corner[2 * i + 1]);
        if (std::isnan(d))
            continue;
        sum += d * d;
        n++;
    }
    return n ? std::sqrt(sum / n) : INFINITY;
}

void cal_leave_out_same(const cal_board *b, cal_view *views, int n, const cal_options *o) {
    const double limit = SAME * std::hypot(o->width, o->height);
    for (int i = 0; i < n; i++)
        for (int j = 0; j < i && !*views[i].left_out; j++)
            if (!*views[j].left_out && distance(b, &views[i], &views[j]) < limit)
                snprintf(views[i].left_out, sizeof views[i].left_out, "it shows the same as %.100s",
                         views[j].name);
}

/* ---- one pose -------------------------------------------------------------------------------- */

static int find_pose(const cal_board *b, const arris_camera *c, const double *shape,
                     const double *corner, const uint8_t *use, cal_pose *pose, double cov[36]) {
    cal_view from{};
    from.corner = const_cast<double *>(corner);
    Problem p{};
    p.board = b;
    cal_from_camera(c, p.k);
    p.bent = shape != nullptr;
    if (shape)
        std::copy(shape, shape + CAL_SHAPE, p.shape);
    p.views.push_back(make_view(b, &from));
    View &v = p.views[0];
    for (Observation &o : v.seen)
        o.rejected = use && !use[o.corner];
    if (p.observations() < 6 || !start_pose(p, &v))
        return ARRIS_E_INPUT;
    settle(&p);
    *pose = v.pose;
    if (cov) {
        const Matrix6 inverse = p.block(v).pp.inverse();
        std::copy(inverse.data(), inverse.data() + 36, cov);
    }
    return 0;
}

int cal_find_pose(const cal_board *b, const arris_camera *c, const double *shape,
                  const double *corner, const uint8_t *use, cal_pose *pose, double cov[36]) {
    try {
        return find_pose(b, c, shape, corner, use, pose, cov);
    } catch (const std::exception &) {
        return ARRIS_E_INPUT;
    }
}
