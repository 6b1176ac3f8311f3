/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * dense.cc: OpenCV's flow by Kroeger, Timofte, Dai and Van Gool, Fast Optical Flow using Dense
 * Inverse Search (2016), with its variational refinement: the best of OpenCV's that keep up with a
 * camera. It takes 8 bits a pixel and no picture smaller than its patches.
 */
#include "dense.h"

#include <algorithm>
#include <exception>
#include <new>

#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

static const int LEAST = 32; /* px, smaller pictures are continued to this by their border */

struct dense {
    cv::Ptr<cv::DISOpticalFlow> dis;
    cv::Mat before;
};

dense *dense_new(void) {
    try {
        cv::setNumThreads(1);
        dense *d = new dense;
        d->dis = cv::DISOpticalFlow::create(cv::DISOpticalFlow::PRESET_MEDIUM);
        return d;
    } catch (const std::exception &) {
        return nullptr;
    }
}

void dense_free(dense *d) {
    delete d;
}

/* A copy of the picture, of its own bits. */
static cv::Mat copy(const arris_image *im) {
    cv::Mat to;
    cv::copyMakeBorder(cv::Mat(im->height, im->width,
                               im->format == ARRIS_GREY8 ? CV_8UC1 : CV_16UC1, im->data,
                               (size_t)im->stride),
                       to, 0, std::max(0, LEAST - im->height), 0, std::max(0, LEAST - im->width),
                       cv::BORDER_REPLICATE);
    return to;
}

/* Two pictures of 16 bits to 8 by one scale, so that the brighter one just fits. */
static void to_8_bits(cv::Mat &a, cv::Mat &b) {
    double most_a, most_b;
    cv::minMaxLoc(a, nullptr, &most_a);
    cv::minMaxLoc(b, nullptr, &most_b);
    double scale = 255 / std::max({most_a, most_b, 1.});
    cv::Mat a8, b8;
    a.convertTo(a8, CV_8U, scale);
    b.convertTo(b8, CV_8U, scale);
    a = a8;
    b = b8;
}

/* The flow from a to b, CV_32FC2. It starts from a matrix that is empty, since DIS would take what
 * is in it as its first guess. */
static cv::Mat flow_between(dense *d, cv::Mat a, cv::Mat b) {
    cv::Mat uv;
    if (a.depth() != CV_8U)
        to_8_bits(a, b);
    d->dis->calc(a, b, uv);
    return uv;
}

static void run(dense *d, const arris_image *in, arris_flow *out) {
    const cv::Mat now = copy(in);
    out->valid = !d->before.empty();
    const cv::Mat uv = out->valid ? flow_between(d, d->before, now)
                                  : cv::Mat(now.size(), CV_32FC2, cv::Scalar::all(0));
    cv::Mat plane[] = {cv::Mat(out->height, out->width, CV_32F, out->u),
                       cv::Mat(out->height, out->width, CV_32F, out->v)};
    cv::split(uv(cv::Rect(0, 0, out->width, out->height)), plane);
    d->before = now;
}

int dense_run(dense *d, const arris_image *in, arris_flow *out) {
    try {
        run(d, in, out);
        return 0;
    } catch (const std::exception &) {
        return ARRIS_E_INTERNAL;
    }
}
