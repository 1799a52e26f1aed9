// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "pagesweep/camera/rig.h"
#include "pagesweep/data/picture.h"
#include "pagesweep/data/point_map.h"
#include "pagesweep/data/time_map.h"

namespace pagesweep {

/// One spot of paper as all eyes of the rig see it: where it was found by what is printed there, not where the rig
/// says that it is.
struct TiePoint {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();              ///< [mm] rig frame, as the rig triangulates it
  double time = 0;                                              ///< [frames] when the stripe passed
  Eigen::Vector2d first = Eigen::Vector2d::Zero();              ///< [px] in the first camera
  Eigen::Vector2d second = Eigen::Vector2d::Zero();             ///< [px] in the second
  Eigen::Matrix2d second_covariance = Eigen::Matrix2d::Zero();  ///< [px^2]
  double across_px = 0;  ///< distance of `second` from the epipolar curve, with its sign
  double across_sigma_px = 0;
  struct InScan {
    Eigen::Vector2d place = Eigen::Vector2d::Zero();       ///< [px]
    Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();  ///< [px^2]
    Eigen::Vector2d shift_mm = Eigen::Vector2d::Zero();    ///< from where the rig has it, on the paper
  };
  std::optional<InScan> scan;
};

/// What a scan measured with a rig that is in doubt.
struct SweepView {
  const Rig& rig;
  const Camera& first;
  const Camera& second;
  const TimeMap& first_times;  ///< their amplitudes show what is printed
  const TimeMap& second_times;
  const PointMap& first_points;  ///< from stereo alone: a sheet of light calibrated by these points would hide errors
  const Picture* scan = nullptr;
};

/// Looks for the print of each part of the first camera's picture, 48 px wide and half overlapping, in the second
/// camera's and in the scan. A match by equal times lies on the epipolar curve wherever that is; print tells how far
/// beside it the spot is really seen. Parts without print give no tie point.
/// \throws std::invalid_argument  if maps and cameras differ in size
std::vector<TiePoint> find_tie_points(const SweepView& view);

}  // namespace pagesweep
