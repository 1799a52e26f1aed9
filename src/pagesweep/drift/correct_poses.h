// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>

#include "pagesweep/camera/rig.h"
#include "pagesweep/drift/tie_points.h"

namespace pagesweep {

/// How sure one is beforehand of what may have changed since calibration: standard deviations.
struct DriftPriors {
  double turn_deg = 0.1;
  double shift_mm = 0.5;
  double light_shift_mm = 0.02;  ///< start of the light's motion
  double light_speed = 5e-5;     ///< of its speed: a stepping motor's is as good as its clock
  double light_mm = 0.05;        ///< of the motion's evenness, and of a smoothed time

  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("prior-turn", turn_deg, "degrees", "standard deviation, beforehand, of how far a camera may have turned");
    visit("prior-shift", shift_mm, "mm", "standard deviation, beforehand, of how far a camera may have moved");
    visit("light-start", light_shift_mm, "mm", "how well the light's motion begins at the same place each time");
    visit("light-speed", light_speed, "", "how well the light's speed is the same each time: a part of it");
    visit("light-evenness", light_mm, "mm", "how evenly the light moves");
  }
};

/// What became of one camera.
struct CameraDrift {
  Camera camera;  ///< with the corrected pose
  double turn_deg = 0, turn_sigma_deg = 0;
  double shift_mm = 0, shift_sigma_mm = 0;  ///< of its centre
};

struct PoseCorrection {
  std::array<CameraDrift, 2> cameras;
  double moved_rms_mm = 0;  ///< by how much the tie points move
  int used = 0;             ///< tie points that take part, the others being outliers
  double misfit = 0;        ///< rms of what is left, over its standard deviation
};

/// Adjusts the poses of both cameras to the tie points, with the scanner and the light as they were calibrated: a
/// bundle adjustment in which every tie point is seen by two cameras, and where there are any by the scanner and the
/// light, and the light's start and speed are known as well as the priors say. Points are eliminated; errors are
/// weighed robustly (Huber).
/// \pre both cameras are the first and second of the ties
/// \throws Error no_result  if there are fewer than 20 tie points
PoseCorrection correct_poses(std::span<const TiePoint> ties, const Camera& first, const Camera& second, const Rig& rig,
                             const DriftPriors& priors = {});

}  // namespace pagesweep
