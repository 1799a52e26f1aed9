// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "pagesweep/calibration/fit_light.h"
#include "pagesweep/camera/camera.h"
#include "pagesweep/data/time_map.h"

namespace pagesweep {

/// Where a board lies: the part of its plane z = 0 that is surely board.
struct BoardPlace {
  Rigid3 rig_from_board;
  Eigen::Vector2d lower_mm, upper_mm;  ///< corners, board frame
};

/// Where and when a camera saw the light pass over a board: every fourth pixel of each direction that has a time and
/// looks at the board.
/// \throws std::invalid_argument  if the map's size is not the camera's
std::vector<LightSighting> light_sightings(const TimeMap& times, const Camera& camera, const BoardPlace& board);

}  // namespace pagesweep
