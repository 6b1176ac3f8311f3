/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * remap.cc: a picture resampled by cv::remap. The map is our own, since OpenCV's knows no skew.
 */
#include "remap.h"

#include <cmath>
#include <new>

#include <opencv2/imgproc.hpp>

#include "arris_geometry.h"

struct remap {
    cv::Mat map; /* of (u, v), CV_32FC2 */
};

/* Whether the model is invertible at the ideal pixel (x, y): beyond its fold it mirrors the picture
 * into itself. */
static bool sees(const arris_camera *camera, double x, double y) {
    double u, v, x2, y2;
    arris_distort(camera, x, y, &u, &v);
    return arris_undistort(camera, u, v, &x2, &y2) == 0 && std::hypot(x2 - x, y2 - y) < 0.01;
}

/* Whether a block of pixels is seen is asked once, at its middle, since it takes a microsecond. */
static void fill_block(const arris_camera *camera, cv::Mat block, cv::Point at) {
    bool seen = sees(camera, at.x + block.cols / 2, at.y + block.rows / 2);
    for (int y = 0; y < block.rows; y++)
        for (int x = 0; x < block.cols; x++) {
            double u = -1, v = -1;
            if (seen)
                arris_distort(camera, at.x + x, at.y + y, &u, &v);
            block.at<cv::Vec2f>(y, x) = cv::Vec2f((float)u, (float)v);
        }
}

remap *remap_new(const arris_camera *camera) {
    const int side = 8;
    const cv::Rect all(0, 0, camera->width, camera->height);
    remap *r = nullptr;
    try {
        cv::setNumThreads(1);
        r = new remap;
        r->map.create(camera->height, camera->width, CV_32FC2);
        for (int y = 0; y < camera->height; y += side)
            for (int x = 0; x < camera->width; x += side)
                fill_block(camera, r->map(cv::Rect(x, y, side, side) & all), cv::Point(x, y));
        return r;
    } catch (const std::exception &) {
        delete r;
        return nullptr;
    }
}

void remap_free(remap *r) {
    delete r;
}

static cv::Mat as_mat(const arris_image *im) {
    return cv::Mat(im->height, im->width, im->format == ARRIS_GREY8 ? CV_8UC1 : CV_16UC1, im->data,
                   (size_t)im->stride);
}

int remap_image(const remap *r, const arris_image *in, arris_image *out) {
    try {
        cv::Mat to = as_mat(out);
        cv::remap(as_mat(in), to, r->map, cv::noArray(), cv::INTER_LANCZOS4, cv::BORDER_REPLICATE);
        return to.data == out->data ? 0 : ARRIS_E_INTERNAL;
    } catch (const std::exception &) {
        return ARRIS_E_INTERNAL;
    }
}
