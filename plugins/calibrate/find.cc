/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * find.cc: the inner corners of a chessboard, found by OpenCV and refined where the grey levels
 * have their saddle points.
 *
 * Three ways to find a board, since each fails where another doesn't: the quads of
 * findChessboardCorners, the saddle points of findChessboardCornersSB, and the quads again in an
 * enlarged picture, where small squares are apart. They say only where to begin: cornerSubPix has
 * the last word in a window that is fitted to the squares around each corner, so that only the two
 * edges that meet there are in it. A corner that started on the wrong square is told by a smooth
 * map of the board through all of them, and starts anew from there.
 */
#include "find.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <vector>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "smooth.h"

using Points = std::vector<cv::Point2f>;

static const int FIND_SIDE = 1600;    /* px; bigger pictures are searched at this size */
static const int ENLARGE_BELOW = 900; /* px */
static const int LEAST_SQUARE = 4;    /* px */
static const double WINDOW = 0.35;    /* of a square's height: beyond lie other edges */
/* px to each side. A greater one is worse: the edges bend, and the further ends pull. Bouguet's
 * toolbox takes a 128th of the width. */
static const int MIN_WINDOW = 2, MAX_WINDOW = 7, MAX_SHARE = 90;
static const double ENOUGH = 0.8; /* of the corners must be sound */

static cv::Mat as_mat(const arris_image *im) {
    const int type = im->format == ARRIS_GREY8 ? CV_8UC1 : CV_16UC1;
    return cv::Mat(im->height, im->width, type, im->data, (size_t)im->stride);
}

/* 8 bits over the range that is there, as the finders take it. */
static cv::Mat to_8bit(const cv::Mat &picture) {
    if (picture.depth() == CV_8U)
        return picture;
    cv::Mat to;
    cv::normalize(picture, to, 0, 255, cv::NORM_MINMAX, CV_8U);
    return to;
}

/* ---- where the board is ---------------------------------------------------------------------- */

/* The pixel that the middle of pixel 0 of a picture scaled by `s` comes from is (0.5 / s - 0.5). */
static bool find_quads(const cv::Mat &picture, double s, cv::Size size, Points *c) {
    cv::Mat scaled = picture;
    if (s != 1)
        cv::resize(picture, scaled, cv::Size(), s, s, s < 1 ? cv::INTER_AREA : cv::INTER_LINEAR);
    bool found = cv::findChessboardCorners(
        scaled, size, *c, cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE);
    for (cv::Point2f &p : *c)
        p = cv::Point2f((float)((p.x + 0.5) / s - 0.5), (float)((p.y + 0.5) / s - 0.5));
    return found;
}

static bool find_saddles(const cv::Mat &picture, double s, cv::Size size, Points *c) {
    cv::Mat scaled = picture;
    if (s != 1)
        cv::resize(picture, scaled, cv::Size(), s, s, cv::INTER_AREA);
    bool found = cv::findChessboardCornersSB(scaled, size, *c, cv::CALIB_CB_EXHAUSTIVE);
    for (cv::Point2f &p : *c)
        p = cv::Point2f((float)((p.x + 0.5) / s - 0.5), (float)((p.y + 0.5) / s - 0.5));
    return found;
}

static bool locate(const cv::Mat &picture, cv::Size size, bool quick, Points *c) {
    const int side = std::max(picture.cols, picture.rows);
    const double s = std::min(1.0, (double)FIND_SIDE / side);
    if (find_quads(picture, s, size, c))
        return true;
    if (quick)
        return false;
    return find_saddles(picture, s, size, c) ||
           (side < ENLARGE_BELOW && find_quads(picture, 2, size, c));
}

/* ---- the order of the corners ---------------------------------------------------------------- */

/* The grey level in the middle of the square at (col, row), or of one next to the board's inner
 * corners when they are -1 or the number of squares; NAN outside the picture. */
static double square_level(const cv::Mat &picture, const cal_board *b, const Points &c, int col,
                           int row) {
    int i = std::min(std::max(col, 0), b->cols - 2), j = std::min(std::max(row, 0), b->rows - 2);
    const cv::Point2f o = c[j * b->cols + i], x = c[j * b->cols + i + 1] - o,
                      y = c[(j + 1) * b->cols + i] - o;
    const cv::Point2f p = o + x * (float)(0.5 + col - i) + y * (float)(0.5 + row - j);
    const int u = cvRound(p.x), v = cvRound(p.y);
    if (u < 1 || v < 1 || u > picture.cols - 2 || v > picture.rows - 2)
        return NAN;
    return cv::mean(picture(cv::Rect(u - 1, v - 1, 3, 3)))[0];
}

/* How much lighter the squares of odd col + row are than the others, grey levels. */
static double lightness(const cv::Mat &picture, const cal_board *b, const Points &c) {
    double sum[2] = {0, 0};
    int n[2] = {0, 0};
    for (int row = 0; row < b->rows - 1; row++)
        for (int col = 0; col < b->cols - 1; col++) {
            double level = square_level(picture, b, c, col, row);
            if (std::isnan(level))
                continue;
            sum[(col + row) % 2] += level;
            n[(col + row) % 2]++;
        }
    return n[0] && n[1] ? sum[1] / n[1] - sum[0] / n[0] : 0;
}

template <class T> static void swap_corners(T *c, int i, int j) {
    std::swap(c[2 * i], c[2 * j]);
    std::swap(c[2 * i + 1], c[2 * j + 1]);
}

void find_turn_half(const cal_board *b, double *corner) {
    for (int i = 0, j = cal_corners(b) - 1; i < j; i++, j--)
        swap_corners(corner, i, j);
}

void find_turn_quarter(const cal_board *b, double *corner) {
    const int n = b->cols;
    for (int row = 0; row < n; row++) /* transposed, */
        for (int col = row + 1; col < n; col++)
            swap_corners(corner, row * n + col, col * n + row);
    for (int row = 0; row < n; row++) /* then mirrored */
        for (int col = 0; col < n / 2; col++)
            swap_corners(corner, row * n + col, row * n + n - 1 - col);
}

int find_turns(const cal_board *b) {
    if (b->cols == b->rows)
        return b->cols % 2 ? 2 : 4;
    return (b->cols + b->rows) % 2 ? 1 : 2;
}

static void put_in_order(const cv::Mat &picture, const cal_board *b, Points *c) {
    const cv::Point2f x = (*c)[b->cols - 1] - (*c)[0],
                      y = (*c)[(size_t)(b->rows - 1) * b->cols] - (*c)[0];
    if (x.x * y.y - x.y * y.x < 0) /* seen from behind: mirror it */
        for (int row = 0; row < b->rows; row++)
            std::reverse(c->begin() + row * b->cols, c->begin() + (row + 1) * b->cols);
    if (lightness(picture, b, *c) >= 0)
        return;
    std::vector<double> flat;
    for (const cv::Point2f &p : *c)
        flat.insert(flat.end(), {(double)p.x, (double)p.y});
    if (b->cols == b->rows)
        find_turn_quarter(b, flat.data());
    else
        find_turn_half(b, flat.data());
    for (size_t i = 0; i < c->size(); i++)
        (*c)[i] = cv::Point2f((float)flat[2 * i], (float)flat[2 * i + 1]);
}

/* Whether on some side the squares go on beyond those around the inner corners: their colours
 * alternate there as they do within. */
static bool goes_on(const cv::Mat &picture, const cal_board *b, const Points &c) {
    const double contrast = lightness(picture, b, c);
    for (int side = 0; side < 4; side++) {
        const bool upright = side < 2;
        const int n = upright ? b->rows : b->cols;
        const int at = side % 2 == 0 ? -2 : upright ? b->cols : b->rows;
        int seen = 0, alternate = 0;
        for (int k = -1; k < n - 1; k++) {
            double p =
                upright ? square_level(picture, b, c, at, k) : square_level(picture, b, c, k, at);
            double q = upright ? square_level(picture, b, c, at, k + 1)
                               : square_level(picture, b, c, k + 1, at);
            if (std::isnan(p) || std::isnan(q))
                continue;
            double step = (at + k + 1) % 2 ? q - p : p - q; /* odd squares are the light ones */
            seen++;
            alternate += step * contrast > contrast * contrast / 2;
        }
        if (seen >= 3 && alternate > 0.8 * seen)
            return true;
    }
    return false;
}

/* ---- to sub-pixel ---------------------------------------------------------------------------- */

/* The mean of the differences to both neighbours along a step of the index, or the one there is. */
static cv::Point2f along(const Points &c, int i, int step, bool before, bool after) {
    const cv::Point2f d = c[after ? i + step : i] - c[before ? i - step : i];
    return before && after ? d * 0.5f : d;
}

/* The height of the parallelogram of the squares around corner i, px. */
static double height_at(const cal_board *b, const Points &c, int i) {
    const int col = i % b->cols, row = i / b->cols;
    const cv::Point2f x = along(c, i, 1, col > 0, col < b->cols - 1);
    const cv::Point2f y = along(c, i, b->cols, row > 0, row < b->rows - 1);
    return std::fabs(x.cross(y)) / std::max(std::max(cv::norm(x), cv::norm(y)), 1e-6);
}

static void refine(const cv::Mat &picture, const cal_board *b, Points *c) {
    const Points from = *c;
    const int most = std::max(MAX_WINDOW, std::max(picture.cols, picture.rows) / MAX_SHARE);
    for (int i = 0; i < (int)c->size(); i++) {
        const int w = std::min(std::max(cvRound(WINDOW * height_at(b, from, i)), MIN_WINDOW), most);
        const cv::Point2f p = from[i];
        if (!cv::Rect(1, 1, picture.cols - 2, picture.rows - 2).contains(p))
            continue;
        Points one(1, p);
        cv::cornerSubPix(
            picture, one, cv::Size(w, w), cv::Size(-1, -1),
            cv::TermCriteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 50, 1e-4));
        (*c)[i] = one[0];
    }
}

/* Marks the strays; returns how many. The squares' height scales what one is. */
static int find_strays(const cal_board *b, const Points &c, const Points &smooth,
                       std::vector<bool> *stray) {
    std::vector<double> off;
    for (size_t i = 0; i < c.size(); i++)
        off.push_back(cv::norm(c[i] - smooth[i]));
    std::vector<double> sorted = off;
    std::nth_element(sorted.begin(), sorted.begin() + sorted.size() / 2, sorted.end());
    const double usual = sorted[sorted.size() / 2];
    int n = 0;
    for (size_t i = 0; i < c.size(); i++) {
        (*stray)[i] = !(off[i] < std::max(5 * usual, 0.03 * height_at(b, smooth, (int)i) + 0.2));
        n += (*stray)[i];
    }
    return n;
}

static enum find_result refine_all(const cv::Mat &picture, const cal_board *b, Points *c,
                                   std::vector<bool> *stray) {
    Points smooth(c->size());
    int n = 0;
    for (int round = 0; round < 4; round++) {
        refine(picture, b, c);
        if (!smooth_board(b, *c, &smooth))
            return FIND_UNSURE;
        n = find_strays(b, *c, smooth, stray);
        if (n == 0)
            break;
        for (size_t i = 0; i < c->size(); i++)
            if ((*stray)[i])
                (*c)[i] = smooth[i];
    }
    return n > (1 - ENOUGH) * (double)c->size() ? FIND_UNSURE : FIND_OK;
}

static enum find_result find(const arris_image *image, const cal_board *b, bool quick,
                             double *corner) {
    cv::setNumThreads(1);
    const cv::Mat picture = as_mat(image), grey = to_8bit(picture);
    Points c;
    if (!locate(grey, cv::Size(b->cols, b->rows), quick, &c) || (int)c.size() != cal_corners(b))
        return FIND_NONE;
    put_in_order(grey, b, &c);
    cv::Mat exact = picture;
    if (picture.depth() != CV_8U)
        picture.convertTo(exact, CV_32F);
    std::vector<bool> stray(c.size());
    const enum find_result r = refine_all(exact, b, &c, &stray);
    if (r != FIND_OK)
        return r;
    for (size_t i = 0; i < c.size(); i++) {
        corner[2 * i] = stray[i] ? NAN : (double)c[i].x;
        corner[2 * i + 1] = stray[i] ? NAN : (double)c[i].y;
    }
    return goes_on(grey, b, c) ? FIND_BIGGER : FIND_OK;
}

enum find_result find_board(const arris_image *image, const cal_board *b, bool quick,
                            double *corner) {
    if (std::min(image->width, image->height) < LEAST_SQUARE * std::min(b->cols, b->rows))
        return FIND_NONE;
    try {
        return find(image, b, quick, corner);
    } catch (const std::exception &) {
        return FIND_INTERNAL;
    }
}

const char *find_reason(enum find_result r) {
    switch (r) {
    case FIND_OK:
        return NULL;
    case FIND_NONE:
        return "the board was not found, or not the whole of it";
    case FIND_BIGGER:
        return "the board has more corners than that";
    case FIND_UNSURE:
        return "its corners do not lie like a board's";
    case FIND_INTERNAL:
        break;
    }
    return "OpenCV failed on it";
}
