// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/camera/ray_table.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

/// Two Newton steps from a neighbouring direction; full inversion where that is not enough.
Eigen::Vector2d undistort_from(const BrownConrady& lens, const Eigen::Vector2d& distorted, Eigen::Vector2d guess) {
  for (int i = 0; i < 2 && guess.allFinite(); ++i)
    guess -= lens.jacobian(guess).inverse() * (lens.distort(guess) - distorted);
  const bool near = (lens.distort(guess) - distorted).squaredNorm() < 1e-24 && lens.is_valid_at(guess.squaredNorm());
  if (near) return guess;
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  return lens.undistort(distorted).value_or(Eigen::Vector2d(nan, nan));
}

}  // namespace

RayTable::RayTable(const Camera& camera) : camera_(camera), directions_(camera.width, camera.height) {
  parallel_rows(camera.height, [&](int y) {
    Eigen::Vector2d guess(-camera.cx / camera.fx, (y - camera.cy) / camera.fy);
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector2d distorted((x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy);
      guess = undistort_from(camera.distortion, distorted, guess);
      directions_(x, y) = guess;
      guess.x() += 1 / camera.fx;
    }
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
