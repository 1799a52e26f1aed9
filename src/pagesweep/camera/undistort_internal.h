// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "pagesweep/camera/camera.h"

namespace pagesweep {

/// Distorted coordinates of pixels in a row: (x + k step, y).
struct PixelRow {
  double x, step, y;
};

/// Inverts the distortion for a row of pixels by Newton's method, to 1e-12; NaN where it does not get there within some
/// steps, or far outside. Whether the lens is valid there is not asked.
void undistort_row(const BrownConrady& lens, const PixelRow& row, std::span<Eigen::Vector2d> ideal);

}  // namespace pagesweep
