/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * detect.cc: corners by OpenCV: where Harris's measure det M - k (tr M)² (Harris, Stephens 1988) or
 * the smaller eigenvalue of M (Shi, Tomasi 1994) has a maximum, M being the gradients' second
 * moments.
 */
#include "detect.h"

#include <algorithm>
#include <exception>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "refine.h"

static const int BLOCK = 3;          /* px, the side of the area that M is summed over */
static const double HARRIS_K = 0.04; /* of the customary 0.04 to 0.06 */

/* The picture as OpenCV's functions take it: 8 bits as they are, 16 as floats. */
static cv::Mat as_mat(const arris_image *im) {
    if (im->format == ARRIS_GREY8)
        return cv::Mat(im->height, im->width, CV_8UC1, im->data, (size_t)im->stride);
    cv::Mat to;
    cv::Mat(im->height, im->width, CV_16UC1, im->data, (size_t)im->stride).convertTo(to, CV_32F);
    return to;
}

static void detect(const detect_params *p, const arris_image *in, arris_corners *out) {
    const cv::Mat picture = as_mat(in);
    std::vector<cv::Point2f> at;
    std::vector<float> strength;
    cv::goodFeaturesToTrack(picture, at, 0, p->quality, p->min_distance, cv::noArray(), strength,
                            BLOCK, 3, p->method == DETECT_HARRIS, HARRIS_K);
    out->n = (uint32_t)std::min(at.size(), (size_t)out->max);
    out->lost = (uint32_t)at.size() - out->n;
    out->camera = in->camera;
    for (uint32_t i = 0; i < out->n; i++) {
        out->item[i] = arris_corner{at[i].x, at[i].y, strength[i]};
        refine_corner(in, &out->item[i]);
    }
}

int detect_setup(void) {
    try {
        cv::setNumThreads(1);
        return 0;
    } catch (const std::exception &) {
        return ARRIS_E_INTERNAL;
    }
}

int detect_corners(const detect_params *p, const arris_image *in, arris_corners *out) {
    try {
        detect(p, in, out);
        return 0;
    } catch (const std::exception &) {
        return ARRIS_E_INTERNAL;
    }
}
