// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "pagesweep/base/image.h"
#include "pagesweep/calibration/calibrate.h"

namespace pagesweep {

/// What a calibration's uncertainty does at one height over the table. Value (i, j) is at low_mm + spacing_mm (i, j).
struct AccuracyMap {
  double height_mm = 0;
  Eigen::Vector2d low_mm = Eigen::Vector2d::Zero();
  double spacing_mm = 1;
  Image<float> point_mm;  ///< standard deviation in space of a triangulated point; NaN where not two cameras see it
  Image<float> scan_px;   ///< standard deviation of where the scan shows the point; empty without a scanner
};

/// Propagates the covariance of the sensors' parameters into triangulated points and scan positions
/// (docs/derivations/calibration.md). It is the calibration's share alone: what noise of the measurement adds is
/// `pagesweep plan`'s business.
/// \return one map a height; empty with fewer than two cameras
std::vector<AccuracyMap> predict_accuracy(const Calibration& calibration, std::span<const double> heights_mm);

}  // namespace pagesweep
