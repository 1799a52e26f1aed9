// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/camera/ray_table.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

/// Inverts the distortion along a row of pixels.
class RowUndistorter {
 public:
  explicit RowUndistorter(const BrownConrady& lens) : lens_(lens) {}

  /// A Newton step from where the two pixels before let expect it; full inversion where that is not enough.
  Eigen::Vector2d operator()(const Eigen::Vector2d& distorted) {
    Eigen::Vector2d ideal = 2 * before_ - before_that_;
    ideal -= lens_.jacobian(ideal).inverse() * (lens_.distort(ideal) - distorted);
    const bool near = (lens_.distort(ideal) - distorted).squaredNorm() < 1e-24;
    if (!near || !is_valid_at(ideal.squaredNorm())) {
      constexpr double nan = std::numeric_limits<double>::quiet_NaN();
      ideal = lens_.undistort(distorted).value_or(Eigen::Vector2d(nan, nan));
    }
    before_that_ = before_;
    before_ = ideal;
    return ideal;
  }

 private:
  /// What is valid at a radius is valid within.
  bool is_valid_at(double radius_squared) {
    if (radius_squared > known_as_valid_ && lens_.is_valid_at(radius_squared)) known_as_valid_ = radius_squared;
    return radius_squared <= known_as_valid_;
  }

  const BrownConrady& lens_;
  double known_as_valid_ = -1;  ///< largest squared radius
  Eigen::Vector2d before_{0, 0}, before_that_{0, 0};
};

}  // namespace

RayTable::RayTable(const Camera& camera) : camera_(camera), directions_(camera.width, camera.height) {
  parallel_rows(camera.height, [&](int y) {
    RowUndistorter undistort(camera.distortion);
    for (int x = 0; x < camera.width; ++x)
      directions_(x, y) = undistort({(x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy});
  });
}

Eigen::Vector2d RayTable::direction_at(const Eigen::Vector2d& pixel) const {
  const int x = std::clamp(static_cast<int>(std::floor(pixel.x())), 0, std::max(0, width() - 2));
  const int y = std::clamp(static_cast<int>(std::floor(pixel.y())), 0, std::max(0, height() - 2));
  const int right = std::min(x + 1, width() - 1), below = std::min(y + 1, height() - 1);
  const double a = pixel.x() - x, b = pixel.y() - y;
  return (1 - b) * ((1 - a) * direction(x, y) + a * direction(right, y)) +
         b * ((1 - a) * direction(x, below) + a * direction(right, below));
}

}  // namespace pagesweep
