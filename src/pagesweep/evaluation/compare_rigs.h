// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "pagesweep/camera/rig.h"
#include "pagesweep/data/figure.h"

namespace pagesweep {

struct RigComparisonOptions {
  double lowest_mm = 0;
  double highest_mm = 60;
  double grid_mm = 20;

  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("lowest", lowest_mm, "mm", "z from which a rig's volume is compared with the true rig's");
    visit("highest", highest_mm, "mm", "z up to which it is");
    visit("grid", grid_mm, "mm", "spacing of the points in that volume");
  }
};

/// What errors of a rig do to measurements, in a volume over the table that two of the true rig's cameras see. Points
/// there are projected by the true cameras and triangulated by the others'; what is left after the best rigid motion
/// are the errors, because the frames may differ. With the same motion both scanners look at the same point.
struct RigComparison {
  std::size_t points = 0;
  double point_rms_mm = 0, point_worst_mm = 0;  ///< length of the error in space
  std::size_t scan_points = 0;                  ///< 0: a rig has no scanner
  double scan_rms_px = 0, scan_worst_px = 0;    ///< length of the error in the scan
  double frame_turn_rad = 0,
         frame_shift_mm = 0;  ///< by which the rigid motion turned and, at the volume's middle, moved
};

/// \throws std::invalid_argument  if the rigs do not have the same two or more cameras, or nothing is seen by two
RigComparison compare_rigs(const Rig& rig, const Rig& truth, const RigComparisonOptions& options = {});

std::vector<Figure> figures_of(const RigComparison& comparison);

}  // namespace pagesweep
