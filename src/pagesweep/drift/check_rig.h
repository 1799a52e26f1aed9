// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "pagesweep/drift/correct_poses.h"
#include "pagesweep/drift/tie_points.h"

namespace pagesweep {

/// How far things are from where the rig has them, over the tie points: rms and the part that all have in common.
struct Disagreement {
  double rms = 0;
  double median = 0;  ///< of the absolute values
  int places = 0;
};

/// Whether a rig still describes the instrument, as one ordinary scan shows it.
struct RigCheck {
  Disagreement across_px;                ///< of the cameras' epipolar geometry: print beside its epipolar curve
  std::optional<Disagreement> scan_mm;   ///< print in the scan, on the paper; none without scan or scanner
  std::optional<Disagreement> light_mm;  ///< points from the light's plane of their time; none without light
  PoseCorrection correction;             ///< poses with which it would agree
  std::vector<TiePoint> ties;
};

/// \throws Error no_result  if there is too little print
RigCheck check_rig(const SweepView& view, const DriftPriors& priors = {});

}  // namespace pagesweep
