// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/camera/ray_table.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pagesweep/base/parallel.h"
#include "pagesweep/camera/undistort_internal.h"
#include "pagesweep/camera/valid_radius.h"

namespace pagesweep {
RayTable::RayTable(const Camera& camera) : camera_(camera), directions_(camera.width, camera.height, unfilled) {
  const double valid = largest_valid_radius_squared(camera.distortion);
  parallel_rows(camera.height, [&](int y) {
    const PixelRow row{-camera.cx / camera.fx, 1 / camera.fx, (y - camera.cy) / camera.fy};
    const auto directions = directions_.row(y);
    undistort_row(camera.distortion, row, directions);
    for (int x = 0; x < camera.width; ++x) {
      Eigen::Vector2d& direction = directions[static_cast<std::size_t>(x)];
      if (direction.squaredNorm() <= valid) continue;  // not where it is NaN
      constexpr double nan = std::numeric_limits<double>::quiet_NaN();
      direction = camera.distortion.undistort({row.x + x * row.step, row.y}).value_or(Eigen::Vector2d(nan, nan));
    }
  });
}

Eigen::Vector2d RayTable::direction_at(const Eigen::Vector2d& pixel) const {
  // Cut off, not rounded down: below 0 both end at 0.
  const int x = std::clamp(static_cast<int>(pixel.x()), 0, std::max(0, width() - 2));
  const int y = std::clamp(static_cast<int>(pixel.y()), 0, std::max(0, height() - 2));
  const int right = std::min(x + 1, width() - 1), below = std::min(y + 1, height() - 1);
  const double a = pixel.x() - x, b = pixel.y() - y;
  return (1 - b) * ((1 - a) * direction(x, y) + a * direction(right, y)) +
         b * ((1 - a) * direction(x, below) + a * direction(right, below));
}

}  // namespace pagesweep
