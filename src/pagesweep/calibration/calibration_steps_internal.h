// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "pagesweep/calibration/calibrate.h"

namespace pagesweep {

/// The scanner's name among the sensors of a bundle.
inline constexpr const char* scanner_name = "scanner";

/// The first half of calibrate(): each camera for itself, then all in the frame of the first one, which holds it.
/// \throws Error  naming what is wrong with the pictures
Bundle start_cameras(const CalibrationInput& input, const CalibrationOptions& options,
                     std::vector<std::string>& warnings);

/// Adds the scanner, the last sensor of the input, to a bundle whose boards' poses are known from the cameras.
/// \throws Error  naming what is wrong with the pictures
void add_scanner(const CalibrationInput& input, const CalibrationOptions& options, Bundle& bundle,
                 std::vector<ScannerTrial>& trials, std::vector<std::string>& warnings);

/// Of a board's axes x, -x, y, -y the one nearest to a direction.
Eigen::Vector3d nearest_axis(const Rigid3& rig_from_board, const Eigen::Vector3d& direction);

}  // namespace pagesweep
