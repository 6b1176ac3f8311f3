/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * smooth.h: where each corner of a board should be, by all of them.
 */
#ifndef CALIBRATE_SMOOTH_H
#define CALIBRATE_SMOOTH_H

#include <vector>

#include <opencv2/core.hpp>

#include "model.h"

/* Fits a smooth map from the board to the picture, robustly, and writes what it gives for each
 * corner. Returns false when there is none. May throw what OpenCV and Eigen throw. */
bool smooth_board(const cal_board *b, const std::vector<cv::Point2f> &corner,
                  std::vector<cv::Point2f> *smooth);

#endif
