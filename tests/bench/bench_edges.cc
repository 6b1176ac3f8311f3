/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * bench_edges.cc: the time of `edges` as a share of cv::Canny's, in one process and one thread, the
 * two in turn. cv::Canny works on the raw 8-bit picture: aperture 3, L2 gradient, 50 and 150.
 *
 *     bench_edges [PICTURE.png ...]
 *
 * Pictures are scaled to four sizes. Beside those that are named, or a frame of the sample scan,
 * there are a plain one, one of pure noise, and a drawn one. The ratio is the median over PAIRS
 * pairs of runs.
 */
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <png.h>

extern "C" {
#include "edges/canny.h"
}

namespace {

const int PAIRS = 61;
const cv::Size SIZES[] = {{320, 240}, {640, 480}, {1280, 960}, {1920, 1080}};
const char SAMPLE[] = "samples/box/frames/0000.png";

/* ---- timing --------------------------------------------------------------------------------- */

typedef std::function<void()> Run;

double seconds(const Run &run) {
    auto start = std::chrono::steady_clock::now();
    run();
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

double median(std::vector<double> v) {
    std::sort(v.begin(), v.end());
    return v[v.size() / 2];
}

/* The median ratio of the times of two runs, taken in turn, and the median time of each, s. */
struct Ratio {
    double ratio, ours, theirs;
};

Ratio compare(const Run &ours, const Run &theirs) {
    std::vector<double> a, b, r;
    for (int i = 0; i < PAIRS; i++) {
        a.push_back(seconds(ours));
        b.push_back(seconds(theirs));
        r.push_back(a.back() / b.back());
    }
    return {median(r), median(a), median(b)};
}

/* ---- pictures ------------------------------------------------------------------------------- */

/* Empty when `path` is no picture that libpng can read. */
cv::Mat read_png(const char *path) {
    png_image p;
    std::memset(&p, 0, sizeof p);
    p.version = PNG_IMAGE_VERSION;
    if (!png_image_begin_read_from_file(&p, path))
        return {};
    p.format = PNG_FORMAT_GRAY;
    cv::Mat grey(static_cast<int>(p.height), static_cast<int>(p.width), CV_8U);
    bool read = png_image_finish_read(&p, nullptr, grey.data, static_cast<int>(grey.step), nullptr);
    return read ? grey : cv::Mat();
}

cv::Mat with_noise(const cv::Mat &levels, double sigma) {
    cv::Mat noise(levels.size(), CV_32F), grey;
    cv::RNG(1).fill(noise, cv::RNG::NORMAL, 0, sigma);
    cv::Mat(levels + noise).convertTo(grey, CV_8U);
    return grey;
}

/* Turned rectangles of many grey levels on a ramp, behind a lens, with noise of 2 grey levels. */
cv::Mat drawing(cv::Size size) {
    cv::RNG rng(7);
    cv::Mat m(size, CV_32F);
    float w = static_cast<float>(m.cols), h = static_cast<float>(m.rows);
    for (int y = 0; y < m.rows; y++)
        m.row(y) = 80.0 + 60.0 * y / m.rows;
    for (int i = 0; i < 60; i++) {
        cv::Point2f middle(rng.uniform(0.f, w), rng.uniform(0.f, h));
        cv::Size2f sides(rng.uniform(.02f, .2f) * w, rng.uniform(.02f, .2f) * w);
        cv::Point2f p[4];
        cv::RotatedRect(middle, sides, rng.uniform(0.f, 90.f)).points(p);
        std::vector<cv::Point> corners(p, p + 4);
        cv::fillConvexPoly(m, corners, cv::Scalar(rng.uniform(10., 245.)));
    }
    cv::GaussianBlur(m, m, cv::Size(), 0.8);
    return with_noise(m, 2);
}

/* A copy at `size` whose rows start on 64-byte boundaries, as the runtime's pictures do. */
cv::Mat scaled(const cv::Mat &grey, cv::Size size) {
    cv::Mat wide(size.height + 1, (size.width + 63) / 64 * 64, CV_8U);
    cv::Mat to = wide(cv::Rect({0, 0}, size));
    cv::resize(grey, to, size, 0, 0, size.width < grey.cols ? cv::INTER_AREA : cv::INTER_LINEAR);
    return to;
}

/* ---- the contest ---------------------------------------------------------------------------- */

void contest(const char *name, const cv::Mat &picture, cv::Size size) {
    cv::Mat grey = scaled(picture, size), theirs;
    canny_params params = CANNY_DEFAULTS;
    canny *c = canny_new(grey.cols, grey.rows, &params);
    std::vector<arris_edge_point> point(canny_max_points(grey.cols, grey.rows));
    std::vector<arris_chain> chain(canny_max_chains(grey.cols, grey.rows));
    arris_edges edges = {};
    edges.max = static_cast<uint32_t>(point.size());
    edges.max_chains = static_cast<uint32_t>(chain.size());
    edges.point = point.data();
    edges.chain = chain.data();
    arris_image image = {ARRIS_GREY8, grey.cols, grey.rows, static_cast<ptrdiff_t>(grey.step),
                         nullptr,     grey.data};
    Ratio r = compare([&] { canny_run(c, &image, &edges); },
                      [&] { cv::Canny(grey, theirs, 50, 150, 3, true); });
    double percent = 100.0 / static_cast<double>(grey.total());
    std::printf("%4dx%-4d  %-28s  edges %7.3f ms  %4.1f %% of the pixels in %4u chains   "
                "cv::Canny %7.3f ms  %4.1f %%   ratio %.2f\n",
                grey.cols, grey.rows, name, r.ours * 1e3, percent * edges.n, edges.n_chains,
                r.theirs * 1e3, percent * cv::countNonZero(theirs), r.ratio);
    canny_free(c);
}

} // namespace

int main(int argc, char **argv) {
    cv::setNumThreads(1);
    std::vector<const char *> files(argv + 1, argv + argc);
    if (files.empty())
        files.push_back(SAMPLE);
    for (cv::Size size : SIZES) {
        cv::Mat plain(size, CV_32F, cv::Scalar(128));
        contest("plain", with_noise(plain, 0), size);
        contest("noise of 5", with_noise(plain, 5), size);
        contest("drawing", drawing(size), size);
        for (const char *file : files) {
            cv::Mat picture = read_png(file);
            if (picture.empty()) {
                std::fprintf(stderr, "%s: no picture that libpng can read\n", file);
                return 2;
            }
            size_t length = std::strlen(file);
            contest(file + (length > 28 ? length - 28 : 0), picture, size);
        }
    }
    return 0;
}
