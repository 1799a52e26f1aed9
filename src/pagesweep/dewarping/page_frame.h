// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace pagesweep {

/// Where a flat page lies on the paper: a rectangle in paper coordinates (s, t). Page coordinates are millimetres from
/// its upper left corner, x to the right, y down.
struct PageFrame {
  Eigen::Vector2d corner_mm = Eigen::Vector2d::Zero();  ///< (s, t) of the upper left corner
  double angle_rad = 0;                                 ///< of the page's rightward direction, from s towards t
  double width_mm = 0;
  double height_mm = 0;

  Eigen::Vector2d right() const { return {std::cos(angle_rad), std::sin(angle_rad)}; }  ///< unit vector in (s, t)
  Eigen::Vector2d down() const { return {-std::sin(angle_rad), std::cos(angle_rad)}; }  ///< unit vector in (s, t)
  Eigen::Vector2d paper_from_page(const Eigen::Vector2d& page_mm) const {
    return corner_mm + page_mm.x() * right() + page_mm.y() * down();
  }
  Eigen::Vector2d page_from_paper(const Eigen::Vector2d& paper_mm) const {
    const Eigen::Vector2d from_corner = paper_mm - corner_mm;
    return {from_corner.dot(right()), from_corner.dot(down())};
  }
  bool contains(const Eigen::Vector2d& paper_mm) const {
    const Eigen::Vector2d page_mm = page_from_paper(paper_mm);
    return page_mm.x() >= 0 && page_mm.y() >= 0 && page_mm.x() <= width_mm && page_mm.y() <= height_mm;
  }

  int width_px(double pixels_per_mm) const {
    return std::max(1, static_cast<int>(std::lround(width_mm * pixels_per_mm)));
  }
  int height_px(double pixels_per_mm) const {
    return std::max(1, static_cast<int>(std::lround(height_mm * pixels_per_mm)));
  }
  /// Paper under the middle of pixel (x, y); (0, 0) is the CENTRE of the upper left one, half a pixel inside the
  /// corner.
  Eigen::Vector2d paper_at_pixel(double x_px, double y_px, double pixels_per_mm) const {
    return paper_from_page({(x_px + 0.5) / pixels_per_mm, (y_px + 0.5) / pixels_per_mm});
  }
};

}  // namespace pagesweep
