/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * quality.cc: what a calibration is worth (quality.h).
 */
#include "quality.h"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <exception>
#include <new>
#include <vector>

#include <Eigen/Dense>

static const double STEEP = 20;  /* degrees */
static const double NARROW = 30; /* degrees, of the range of tilts about one axis */
static const int FEW_VIEWS = 10;
static const double APART = 2;     /* the halves' differences over their sigma */
static const double UNEVEN = 10;   /* times the uncertainty in the middle one of the places */
static const double BLURRED = 0.5; /* px, the noise of a corner */

/* ---- on the part ----------------------------------------------------------------------------- */

/* How the points of the plane that the cells' middles show move with the parameters, mm each; what
 * a motion of the camera can undo is taken out. */
static Eigen::MatrixXd effect(const cal_result *r, double distance) {
    const int n = MAP_ROWS * MAP_COLS;
    Eigen::MatrixXd by_k(2 * n, CAL_N), by_motion(2 * n, 6);
    const cal_pose still = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 0}};
    for (int i = 0; i < n; i++) {
        double x, y, p[2], Jk[2][CAL_N], JX[2][3];
        const arris_camera *c = &r->camera;
        arris_undistort(c, (i % MAP_COLS + 0.5) / MAP_COLS * c->width - 0.5,
                        (i / MAP_COLS + 0.5) / MAP_ROWS * c->height - 0.5, &x, &y);
        y = (y - c->cy) / c->fy;
        x = (x - c->cx - c->skew * y) / c->fx;
        const double X[3] = {x * distance, y * distance, distance};
        cal_project(r->k, &still, X, p, Jk, nullptr, JX);
        const Eigen::Matrix2d by_X{{JX[0][0], JX[0][1]}, {JX[1][0], JX[1][1]}};
        const Eigen::Matrix<double, 2, CAL_N> J =
            Eigen::Map<Eigen::Matrix<double, 2, CAL_N, Eigen::RowMajor>>(Jk[0]);
        by_k.middleRows<2>(2 * i) = -by_X.inverse() * J;
        const double D = distance;
        by_motion.middleRows<2>(2 * i) << -x * y * D, D + x * x * D, -y * D, 1, 0, -x,
            -D - y * y * D, x * y * D, x * D, 0, 1, -y;
    }
    by_motion.leftCols<3>() /= distance;
    return by_k - by_motion * by_motion.colPivHouseholderQr().solve(by_k);
}

static void summarise(cal_map *m) {
    double all[MAP_ROWS * MAP_COLS];
    std::copy(m->at[0], m->at[0] + MAP_ROWS * MAP_COLS, all);
    std::sort(all, all + MAP_ROWS * MAP_COLS);
    m->middle = all[MAP_ROWS * MAP_COLS / 2];
    m->worst = all[MAP_ROWS * MAP_COLS - 1];
}

void cal_map_sigma(const cal_result *r, double distance, cal_map *m) {
    const Eigen::MatrixXd J = effect(r, distance);
    const Eigen::Matrix<double, CAL_N, CAL_N> cov =
        Eigen::Map<const Eigen::Matrix<double, CAL_N, CAL_N>>(r->cov);
    for (int i = 0; i < MAP_ROWS * MAP_COLS; i++) {
        const Eigen::Matrix2d c = J.middleRows<2>(2 * i) * cov * J.middleRows<2>(2 * i).transpose();
        const double greatest = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(c).eigenvalues()[1];
        m->at[i / MAP_COLS][i % MAP_COLS] = 1000 * std::sqrt(std::max(greatest, 0.0));
    }
    summarise(m);
}

static void map_difference(const cal_result *mean, const cal_result half[2], double distance,
                           cal_map *m) {
    const Eigen::MatrixXd J = effect(mean, distance);
    Eigen::Matrix<double, CAL_N, 1> d;
    for (int i = 0; i < CAL_N; i++)
        d[i] = half[1].k[i] - half[0].k[i];
    const Eigen::VectorXd shift = J * d;
    for (int i = 0; i < MAP_ROWS * MAP_COLS; i++)
        m->at[i / MAP_COLS][i % MAP_COLS] = 1000 * shift.segment<2>(2 * i).norm();
    summarise(m);
}

/* ---- two halves ------------------------------------------------------------------------------ */

/* Every other view that counts, from the first or the second on. */
static bool fit_half(const cal_board *b, const cal_view *views, int n, const cal_options *o,
                     int which, cal_result *r) {
    std::vector<cal_view> half;
    int turn = 0;
    fault f;
    for (int i = 0; i < n; i++)
        if (!*views[i].left_out && turn++ % 2 == which)
            half.push_back(views[i]);
    return cal_fit(b, half.data(), (int)half.size(), o, r, &f) == 0;
}

static void compare_halves(const cal_board *b, const cal_view *views, int n, const cal_options *o,
                           const cal_result *r, cal_quality *q) {
    q->halved =
        fit_half(b, views, n, o, 0, &q->half[0]) && fit_half(b, views, n, o, 1, &q->half[1]);
    if (!q->halved)
        return;
    map_difference(r, q->half, q->distance, &q->difference);
    double sum = 0;
    int free = 0;
    for (int i = 0; i < CAL_N; i++) {
        const int at = i * CAL_N + i;
        const double d = q->half[1].k[i] - q->half[0].k[i];
        if (o->fixed[i])
            continue;
        sum += d * d / (q->half[0].cov[at] + q->half[1].cov[at]);
        free++;
    }
    q->apart = free ? std::sqrt(sum / free) : 0;
}

/* ---- what the views show --------------------------------------------------------------------- */

double cal_tilt(const cal_view *v) {
    return std::acos(std::min(1.0, std::fabs(v->pose.R[8]))) * 180 / M_PI;
}

double cal_usual_distance(const cal_board *b, const cal_view *views, int n) {
    std::vector<double> all;
    for (int i = 0; i < n; i++) {
        const double *R = views[i].pose.R, X = (b->cols - 1) * b->square / 2,
                     Y = (b->rows - 1) * b->square / 2;
        if (!*views[i].left_out)
            all.push_back(R[6] * X + R[7] * Y + views[i].pose.t[2]);
    }
    if (all.empty())
        return 0;
    std::nth_element(all.begin(), all.begin() + all.size() / 2, all.end());
    return all[all.size() / 2];
}

/* 0, 1 or 2: the first fifth, the middle, the last fifth. */
static int fifth(double at, int size) {
    return at < 0.2 * size ? 0 : at < 0.8 * size ? 1 : 2;
}

static void look_at_views(const cal_board *b, const cal_view *views, int n, const cal_options *o,
                          cal_quality *q) {
    double low[2] = {90, 90}, high[2] = {-90, -90};
    for (int i = 0; i < n; i++) {
        if (*views[i].left_out)
            continue;
        for (int c = 0; c < cal_corners(b); c++)
            if (std::isfinite(views[i].corner[2 * c]))
                q->covered[fifth(views[i].corner[2 * c + 1], o->height)]
                          [fifth(views[i].corner[2 * c], o->width)]++;
        const double *R = views[i].pose.R;
        const double tilt[2] = {std::atan2(R[5], R[8]) * 180 / M_PI,
                                std::atan2(R[2], R[8]) * 180 / M_PI};
        for (int k = 0; k < 2; k++) {
            low[k] = std::min(low[k], tilt[k]);
            high[k] = std::max(high[k], tilt[k]);
        }
        q->tilted += cal_tilt(&views[i]) > STEEP;
    }
    q->tilt_x = std::max(high[0] - low[0], 0.0);
    q->tilt_y = std::max(high[1] - low[1], 0.0);
}

/* ---- what to do next ------------------------------------------------------------------------- */

__attribute__((format(printf, 2, 3))) static void advise(cal_quality *q, const char *format, ...) {
    va_list args;
    if (q->n_advice == ADVICE_MAX)
        return;
    va_start(args, format);
    vsnprintf(q->advice[q->n_advice++], sizeof q->advice[0], format, args);
    va_end(args);
}

/* The greatest uncertainty in one of the nine regions of the picture, µm. */
static double worst_in(const cal_quality *q, int row, int col) {
    double worst = 0;
    for (int i = 0; i < MAP_ROWS; i++)
        for (int j = 0; j < MAP_COLS; j++)
            if (fifth(i + 0.5, MAP_ROWS) == row && fifth(j + 0.5, MAP_COLS) == col)
                worst = std::max(worst, q->sigma.at[i][j]);
    return worst;
}

static void advise_on_cover(cal_quality *q) {
    static const char *const names[GRID][GRID] = {
        {"upper left corner", "upper edge", "upper right corner"},
        {"left edge", "middle", "right edge"},
        {"lower left corner", "lower edge", "lower right corner"}};
    char list[200] = "";
    int n = 0;
    for (int row = 0; row < GRID; row++)
        for (int col = 0; col < GRID; col++)
            if (q->covered[row][col] == 0 || worst_in(q, row, col) > UNEVEN * q->sigma.middle) {
                const size_t at = std::char_traits<char>::length(list);
                snprintf(list + at, sizeof list - at, "%s%s", n++ ? ", " : "", names[row][col]);
            }
    if (n)
        advise(q,
               "Add views with the board in the %s: too few corners were seen there, and the lens "
               "is only guessed.",
               list);
}

static void advise_all(const cal_options *o, const cal_result *r, cal_quality *q) {
    if (r->views < FEW_VIEWS)
        advise(q, "Add views: %d are few, 15 to 30 are good.", r->views);
    if (q->tilted < 4)
        advise(q,
               "Add views tilted by more than 20 degrees: there are %d, and the focal length "
               "comes from them.",
               q->tilted);
    if (q->tilt_x < NARROW)
        advise(q, "Add views with the board's upper edge tilted towards the camera, and away.");
    if (q->tilt_y < NARROW)
        advise(q, "Add views with the board's left edge tilted towards the camera, and away.");
    advise_on_cover(q);
    if (r->noise > BLURRED)
        advise(q,
               "Look at the pictures: a corner scatters by %.2f px; 0.1 px is usual. Are they "
               "sharp, and did the board stand still?",
               r->noise);
    if (q->halved && q->apart > APART)
        advise(q, "The two halves differ by %.1f times their uncertainty: %s", q->apart,
               o->flat ? "the focus or the board changed while the pictures were taken."
                       : "try --flat, which estimates the board's shape, and see that the focus "
                         "does not change.");
    if (q->n_advice == 0)
        advise(q, "Nothing is missing. More views of the same kind make it better with the square "
                  "root of their number.");
}

int cal_assess(const cal_board *b, const cal_view *views, int n, const cal_options *o,
               const cal_result *r, double distance, cal_quality *q, fault *f) {
    *q = cal_quality{};
    q->distance = distance > 0 ? distance : cal_usual_distance(b, views, n);
    try {
        cal_map_sigma(r, q->distance, &q->sigma);
        q->depth_sigma = 1000 * q->distance * std::sqrt(r->cov[0]) / r->k[CAL_FX];
        compare_halves(b, views, n, o, r, q);
        look_at_views(b, views, n, o, q);
        advise_all(o, r, q);
        return 0;
    } catch (const std::bad_alloc &) {
        return fault_set(f, ARRIS_E_MEMORY, NULL, "no memory to assess the calibration");
    } catch (const std::exception &e) {
        return fault_set(f, ARRIS_E_INTERNAL, NULL, "assessing failed: %.200s", e.what());
    }
}
