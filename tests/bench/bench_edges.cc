/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * bench_edges.cc: `edges` and `edges ! segments` beside OpenCV's detectors, in one process and one
 * thread: cv::Canny (on the raw 8-bit picture: aperture 3, L2 gradient, 50 and 150), LSD, FLD and
 * EdgeDrawing, all as they come.
 *
 *     bench_edges [PICTURE.png ...]
 *
 * First the times, in those of cv::Canny with which each is run in turn, the median over pairs of
 * runs. Pictures are scaled to four sizes, and laid side by side where they are smaller, which
 * makes them as dense as they come; beside those that are named, or a frame of the sample scan,
 * there are a plain one, one of pure noise, and a drawn one. Then the errors of isolated
 * edges' offsets, in multiples of the Cramer-Rao bound.
 */
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <functional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/ximgproc/edge_drawing.hpp>
#include <opencv2/ximgproc/fast_line_detector.hpp>
#include <png.h>

extern "C" {
#include "../strip.h"
#include "edges/canny.h"
#include "segments/segmenter.h"
}

namespace {

const int PAIRS = 61, FEW_PAIRS = 7; /* of what takes more than SLOW */
const double SLOW = 0.02;            /* s */
const cv::Size SIZES[] = {{320, 240}, {640, 480}, {1280, 960}, {1920, 1080}};
const int POSES = 100;
const size_t NAME_WIDTH = 28;
const char SAMPLE[] = "samples/box/frames/0000.png";

/* ---- timing --------------------------------------------------------------------------------- */

typedef std::function<void()> Run;

/* Of this thread alone, so that what else the machine does has less of a say. */
double now() {
    timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

double seconds(const Run &run) {
    double start = now();
    run();
    return now() - start;
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
    int pairs = seconds(ours) > SLOW ? FEW_PAIRS : PAIRS;
    for (int i = 0; i < pairs; i++) {
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

/* Room for a picture whose rows start on 64-byte boundaries, as the runtime's do. */
cv::Mat aligned(cv::Size size) {
    cv::Mat wide(size.height + 1, (size.width + 63) / 64 * 64, CV_8U);
    return wide(cv::Rect({0, 0}, size));
}

cv::Mat scaled(const cv::Mat &grey, cv::Size size) {
    cv::Mat to = aligned(size);
    cv::resize(grey, to, size, 0, 0, size.width < grey.cols ? cv::INTER_AREA : cv::INTER_LINEAR);
    return to;
}

cv::Mat tiled(const cv::Mat &grey, cv::Size size) {
    cv::Mat to = aligned(size), all;
    cv::repeat(grey, size.height / grey.rows + 1, size.width / grey.cols + 1, all);
    all(cv::Rect({0, 0}, size)).copyTo(to);
    return to;
}

/* ---- the contestants ------------------------------------------------------------------------ */

typedef std::vector<cv::Vec4f> Lines;

/* Our two kernels and their layers. */
struct Ours {
    canny *edges_of;
    segmenter *segments_of;
    std::vector<arris_edge_point> point;
    std::vector<arris_chain> chain;
    arris_edges edges = {};
    arris_segments segments;

    explicit Ours(cv::Size size)
        : point(canny_max_points(size.width, size.height)),
          chain(canny_max_chains(size.width, size.height)),
          segments(segments_new(segmenter_max(size.width, size.height))) {
        canny_params edge = CANNY_DEFAULTS;
        segmenter_params line = SEGMENTER_DEFAULTS;
        edges_of = canny_new(size.width, size.height, &edge);
        segments_of = segmenter_new(size.width, size.height, &line);
        edges.max = static_cast<uint32_t>(point.size());
        edges.max_chains = static_cast<uint32_t>(chain.size());
        edges.point = point.data();
        edges.chain = chain.data();
    }
    ~Ours() {
        canny_free(edges_of);
        segmenter_free(segments_of);
        free(segments.item);
    }
    static arris_image view(const cv::Mat &grey) {
        return {ARRIS_GREY8, grey.cols, grey.rows, static_cast<ptrdiff_t>(grey.step),
                nullptr,     grey.data};
    }
    void find_edges(const cv::Mat &grey) {
        arris_image im = view(grey);
        canny_run(edges_of, &im, &edges);
    }
    Lines find_segments(const cv::Mat &grey) {
        arris_image im = view(grey);
        canny_run(edges_of, &im, &edges);
        segmenter_run(segments_of, &edges, &im, &segments);
        Lines lines;
        for (uint32_t i = 0; i < segments.n; i++) {
            const arris_segment &s = segments.item[i];
            lines.emplace_back(s.x1, s.y1, s.x2, s.y2);
        }
        return lines;
    }
};

Lines lsd(const cv::Mat &grey) {
    static cv::Ptr<cv::LineSegmentDetector> d = cv::createLineSegmentDetector();
    Lines lines;
    d->detect(grey, lines);
    for (cv::Vec4f &l : lines) /* its shift at the scale of 0.8 */
        l += cv::Vec4f::all(0.125f);
    return lines;
}

Lines fld(const cv::Mat &grey) {
    static cv::Ptr<cv::ximgproc::FastLineDetector> d = cv::ximgproc::createFastLineDetector();
    Lines lines;
    d->detect(grey, lines);
    return lines;
}

Lines edge_drawing(const cv::Mat &grey) {
    static cv::Ptr<cv::ximgproc::EdgeDrawing> d = cv::ximgproc::createEdgeDrawing();
    Lines lines;
    d->detectEdges(grey);
    d->detectLines(lines);
    return lines;
}

/* ---- speed ---------------------------------------------------------------------------------- */

/* `grey` is as `aligned` makes them. */
void contest(const std::string &name, const cv::Mat &grey) {
    cv::Mat theirs;
    Ours ours(grey.size());
    Run canny = [&] { cv::Canny(grey, theirs, 50, 150, 3, true); };
    Ratio edges = compare([&] { ours.find_edges(grey); }, canny);
    Ratio both = compare([&] { ours.find_segments(grey); }, canny);
    std::printf("%4dx%-4d %-34s %9.3f %8.2f %8.2f %9.2f %8.2f %8.2f\n", grey.cols, grey.rows,
                name.c_str(), edges.theirs * 1e3, edges.ratio, both.ratio,
                compare([&] { lsd(grey); }, canny).ratio, compare([&] { fld(grey); }, canny).ratio,
                compare([&] { edge_drawing(grey); }, canny).ratio);
}

/* ---- accuracy ------------------------------------------------------------------------------- */

/* The offset, px, from the true edge's middle to the nearest line along it that covers half of it;
 * NAN when there is none. */
double offset_of(const strip &s, const Lines &lines) {
    double c = std::cos(s.angle), d = std::sin(s.angle), best = NAN;
    for (const cv::Vec4f &l : lines) {
        double ux = l[2] - l[0], uy = l[3] - l[1], n = std::hypot(ux, uy);
        double x = (l[0] + l[2]) / 2 - s.x, y = (l[1] + l[3]) / 2 - s.y, off = y * c - x * d;
        bool along = std::fabs(ux * c + uy * d) > 0.98 * n && n > s.length / 2;
        if (along && std::fabs(off) < 2 && !(std::fabs(off) > std::fabs(best)))
            best = off;
    }
    return best;
}

struct Score {
    double squares = 0;
    int found = 0;

    void add(double offset, double bound) {
        if (std::isnan(offset))
            return;
        squares += offset * offset / (bound * bound);
        found++;
    }
    void print() const {
        std::printf("  %6.2f (%3d %%)", std::sqrt(squares / found), found * 100 / POSES);
    }
};

void accuracy(double noise, double contrast, double length) {
    uint64_t seed = 0x9E3779B97F4A7C15;
    cv::Size size(192, 192);
    Ours ours(size);
    arris_image im = picture_new(size.width, size.height, ARRIS_GREY8);
    cv::Mat grey(size, CV_8U, im.data, static_cast<size_t>(im.stride));
    Score score[4];
    for (int i = 0; i < POSES; i++) {
        strip s = strip_anywhere(size.width, size.height, length, contrast, &seed);
        picture_draw(&im, strip_level, &s, noise, &seed);
        double bound = strip_bound(&s, noise, length - 5, 8);
        score[0].add(offset_of(s, ours.find_segments(grey)), bound);
        score[1].add(offset_of(s, lsd(grey)), bound);
        score[2].add(offset_of(s, fld(grey)), bound);
        score[3].add(offset_of(s, edge_drawing(grey)), bound);
    }
    std::printf("%5.0f %8.0f %6.0f", noise, contrast, length);
    for (const Score &each : score)
        each.print();
    std::putchar('\n');
    free(im.data);
}

} // namespace

int main(int argc, char **argv) {
    cv::setNumThreads(1);
    std::vector<std::string> files(argv + 1, argv + argc);
    if (files.empty())
        files.push_back(SAMPLE);
    std::printf("times, in cv::Canny's\n%-44s %9s %8s %8s %9s %8s %8s\n", "picture", "Canny/ms",
                "edges", "+segments", "LSD", "FLD", "EDLines");
    for (cv::Size size : SIZES) {
        cv::Mat plain(size, CV_32F, cv::Scalar(128));
        contest("plain", scaled(with_noise(plain, 0), size));
        contest("noise of 5", scaled(with_noise(plain, 5), size));
        contest("drawing", scaled(drawing(size), size));
        for (const std::string &file : files) {
            cv::Mat picture = read_png(file.c_str());
            if (picture.empty()) {
                std::fprintf(stderr, "%s: no picture that libpng can read\n", file.c_str());
                return 2;
            }
            std::string name = file.substr(file.size() - std::min(file.size(), NAME_WIDTH));
            contest(name, scaled(picture, size));
            if (picture.cols < size.width)
                contest(name + " tiled", tiled(picture, size));
        }
    }
    std::printf(
        "\nerrors of isolated edges' offsets over the bound (and the share found), %d poses\n"
        "noise contrast length   segments          LSD             FLD             EDLines\n",
        POSES);
    for (double noise : {2., 5.})
        for (double contrast : {40., 150.})
            for (double length : {30., 100.})
                accuracy(noise, contrast, length);
    return 0;
}
