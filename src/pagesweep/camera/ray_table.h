// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "pagesweep/base/image.h"
#include "pagesweep/camera/camera.h"

namespace pagesweep {

/// The viewing directions of all pixels of a camera, undistorted once, for everything that asks for a million of them.
/// A direction is (X/Z, Y/Z) in the camera's frame; NaN where the distortion has no inverse.
class RayTable {
 public:
  RayTable(const Camera& camera);  // NOLINT(*-explicit-*): a camera with all its rays worked out is still that camera

  const Camera& camera() const { return camera_; }
  int width() const { return directions_.width(); }
  int height() const { return directions_.height(); }
  const Eigen::Vector2d& direction(int x, int y) const { return directions_(x, y); }
  /// Direction at a sub-pixel position by bilinear interpolation, extrapolated over the outer half pixel. It differs
  /// from the exact one by an eighth of the distortion's second derivative, for real lenses less than 1e-4 px.
  Eigen::Vector2d direction_at(const Eigen::Vector2d& pixel) const;

 private:
  Camera camera_;
  Image<Eigen::Vector2d> directions_;
};

}  // namespace pagesweep
