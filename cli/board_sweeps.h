// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "pagesweep/base/progress.h"
#include "pagesweep/calibration/calibrate.h"
#include "pagesweep/calibration/fit_light.h"
#include "pagesweep/pipeline/watch_board.h"

namespace pagesweep::cli {

/// A sweep over the board, once its textures have become pictures of a calibration.
struct WatchedSweep {
  std::string name;
  int pose = 0;  ///< index of CalibrationInput::poses
  std::vector<std::string> cameras;
  Timing timing;
};

/// Follows sweeps over the board and adds what they show to the calibration's pictures: a pose each, its texture for
/// each camera, and its scan for the scanner. A sweep also tells in which direction over the board the light moves.
/// \throws Error  if a capture cannot be read, no stripe passes, or its pictures differ in size from others of a sensor
std::vector<WatchedSweep> add_sweeps(const std::vector<std::filesystem::path>& captures,
                                     const DetectionOptions& options, CalibrationInput& input, Progress& progress);

/// The light's motion from the sweeps over boards whose poses are now known.
/// \throws Error no_result  if it cannot be told
LightFit light_of(const std::vector<WatchedSweep>& sweeps, const Calibration& calibration);

/// What the pictures and sweeps tell of the sensors goes into the rig: noise by photon transfer, median over the
/// sweeps, and the point spread function from the blur of the board's edges.
void describe_sensors(const CalibrationInput& input, const std::vector<WatchedSweep>& sweeps, Rig& rig);

}  // namespace pagesweep::cli
