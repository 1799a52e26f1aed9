// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "pagesweep/base/image.h"

namespace pagesweep {

/// Some pixels of one picture, and where each is expected in another.
struct Patch {
  std::vector<float> gray;
  std::vector<Eigen::Vector2d> offset;  ///< from the patch's middle, in units of half its side: from -1 to 1
  std::vector<Eigen::Vector2d> place;   ///< [px] in the other picture
};

/// In which directions and how far a patch may be off.
struct ShiftRange {
  Eigen::Matrix<double, 2, Eigen::Dynamic> directions;  ///< [px] of a shift by 1; one or two columns
  double farthest = 0;                                  ///< in units of the directions, to both sides
  double step = 1;                                      ///< less than the width of what is printed
};

/// By how much a patch is off.
struct Shift {
  Eigen::VectorXd amount;      ///< in units of the directions
  Eigen::MatrixXd covariance;  ///< from the residuals
  double correlation = 0;      ///< of the patch with what it was found to be
};

/// Finds the patch in the other picture: the highest correlation on a grid of shifts, then least squares for shift,
/// gain and a plane of brightness (Lucas and Kanade 1981; Gruen 1985).
/// \return nothing if the picture is not known there, nothing is like the patch, or the best place is at the border
std::optional<Shift> align_patch(const Image<float>& other, const Patch& patch, const ShiftRange& range);

/// The picture's value at a position by bilinear interpolation; NaN beyond its outermost pixels and beside a NaN.
float sample(const Image<float>& image, const Eigen::Vector2d& position);

}  // namespace pagesweep
