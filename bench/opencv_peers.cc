// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/structured_light.hpp>
#include <stdexcept>
#include <vector>

#include "bench/peers.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/data/time_map.h"

namespace pagesweep::bench {
namespace {

using Pictures = std::vector<cv::Mat>;

cv::Mat picture_of(const Frames& frames, int i) {
  const auto& image = std::get<Image<std::uint8_t>>(frames.frame(i));
  return {image.height(), image.width(), CV_8U, const_cast<std::uint8_t*>(image.data())};
}

cv::Mat matrix_of(const Camera& camera) {
  return (cv::Mat_<double>(3, 3) << camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
}

cv::Mat distortion_of(const Camera& camera) {
  const BrownConrady& d = camera.distortion;
  return (cv::Mat_<double>(1, 5) << d.k1, d.k2, d.p1, d.p2, d.k3);
}

/// Maps that make the rows of both pictures epipolar lines.
class Rectification {
 public:
  Rectification(const Camera& first, const Camera& second) {
    const Rigid3 second_from_first = second.cam_from_rig * first.cam_from_rig.inverse();
    cv::Mat rotation(3, 3, CV_64F), translation(3, 1, CV_64F), r1, r2, p1, p2;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) rotation.at<double>(i, j) = second_from_first.rotation(i, j);
      translation.at<double>(i) = second_from_first.translation(i);
    }
    const cv::Size size(first.width, first.height);
    cv::stereoRectify(matrix_of(first), distortion_of(first), matrix_of(second), distortion_of(second), size, rotation,
                      translation, r1, r2, p1, p2, depth_from_disparity_);
    cv::initUndistortRectifyMap(matrix_of(first), distortion_of(first), r1, p1, size, CV_16SC2, maps_[0], maps_[1]);
    cv::initUndistortRectifyMap(matrix_of(second), distortion_of(second), r2, p2, size, CV_16SC2, maps_[2], maps_[3]);
    pixels_times_mm_ = p1.at<double>(0, 0) * cv::norm(translation);
  }

  cv::Mat first(const cv::Mat& picture) const { return apply(picture, 0); }
  cv::Mat second(const cv::Mat& picture) const { return apply(picture, 2); }
  double disparity_at(double depth_mm) const { return pixels_times_mm_ / depth_mm; }
  /// Depths of the points in front of the cameras [mm]. Disparity 0 stands for none.
  Image<float> depths(const cv::Mat& disparity) const {
    cv::Mat points;
    cv::reprojectImageTo3D(disparity, points, depth_from_disparity_);
    Image<float> depths(points.cols, points.rows, not_a_number);
    for (int y = 0; y < points.rows; ++y)
      for (int x = 0; x < points.cols; ++x) {
        const float depth = points.at<cv::Vec3f>(y, x)[2];
        if (disparity.at<float>(y, x) != 0 && std::isfinite(depth) && depth > 0) depths(x, y) = depth;
      }
    return depths;
  }

 private:
  cv::Mat apply(const cv::Mat& picture, int map) const {
    cv::Mat rectified;
    cv::remap(picture, rectified, maps_[map], maps_[map + 1], cv::INTER_LINEAR);
    return rectified;
  }

  cv::Mat maps_[4];
  cv::Mat depth_from_disparity_;
  double pixels_times_mm_ = 0;
};

Pictures rows_of(const Pictures& pictures, int y) {
  Pictures rows;
  for (const cv::Mat& picture : pictures) rows.push_back(picture.row(y));
  return rows;
}

}  // namespace

bool has_peers() { return true; }

void limit_peer_threads(int threads) { cv::setNumThreads(threads == 0 ? -1 : threads); }

/// The code tells columns only. OpenCV averages all pixels that have a code, so each row is decoded by itself; and it
/// wants a code of the rows, which black and white give: that of row 0.
Image<float> decode_gray_code(const StereoFrames& frames) {
  const Rectification rectification(frames.first_camera, frames.second_camera);
  const int count = frames.first.count();
  Pictures first, second;
  for (int i = 0; i < count; ++i) {
    first.push_back(rectification.first(picture_of(frames.first, i)));
    second.push_back(rectification.second(picture_of(frames.second, i)));
  }
  // White and black change places: a dark pattern, then its inverse.
  const auto dark = static_cast<std::size_t>(count - 2), lit = static_cast<std::size_t>(count - 1);
  std::swap(first[dark], first[lit]), std::swap(second[dark], second[lit]);
  cv::structured_light::GrayCodePattern::Params size;
  size.width = 1 << (dark / 2);
  size.height = 2;
  const auto code = cv::structured_light::GrayCodePattern::create(size);
  cv::Mat disparity(first[0].size(), CV_32F);
  parallel_rows(disparity.rows, [&](int y) {
    const std::vector<Pictures> rows = {rows_of(first, y), rows_of(second, y)};
    const Pictures black = {rows[0][dark], rows[1][dark]}, white = {rows[0][lit], rows[1][lit]};
    cv::Mat shift;  // second minus first
    code->decode(rows, shift, black, white, cv::structured_light::DECODE_3D_UNDERWORLD);
    cv::Mat out = disparity.row(y);
    shift.convertTo(out, CV_32F, -1);
  });
  return rectification.depths(disparity);
}

Image<float> match_blocks(const StereoFrames& frames, int frame, double near_mm, double far_mm) {
  const Rectification rectification(frames.first_camera, frames.second_camera);
  const cv::Mat first = rectification.first(picture_of(frames.first, frame));
  const cv::Mat second = rectification.second(picture_of(frames.second, frame));
  const int least = static_cast<int>(rectification.disparity_at(far_mm));
  const int steps = (static_cast<int>(rectification.disparity_at(near_mm)) - least) / 16 + 1;
  constexpr int block = 5;
  const auto matcher = cv::StereoSGBM::create(least, 16 * steps, block, 8 * block * block, 32 * block * block, 1, 0, 10,
                                              100, 2, cv::StereoSGBM::MODE_SGBM_3WAY);
  cv::Mat sixteenths, disparity;
  matcher->compute(first, second, sixteenths);
  sixteenths.convertTo(disparity, CV_32F, 1.0 / 16);
  disparity.setTo(0, disparity < least);  // one below stands for none
  return rectification.depths(disparity);
}

}  // namespace pagesweep::bench
