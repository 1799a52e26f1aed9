// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "pagesweep/calibration/accuracy.h"
#include "pagesweep/calibration/calibrate.h"
#include "pagesweep/report/report.h"

namespace pagesweep {

/// What one sensor's pictures gave.
struct SensorSummary {
  std::string name;
  int pictures = 0;  ///< searched
  int usable = 0;    ///< in which the board was found
  int corners_found = 0;
  int corners_used = 0;                  ///< without outliers
  double rms_px = 0;                     ///< length of the reprojection error over the corners used
  double sigma_px = 0;                   ///< standard deviation of a coordinate, robust
  double tilted_poses = 0;               ///< boards tilted by more than 10 degrees against the mean of all
  std::vector<std::string> empty_zones;  ///< parts of the picture without corners: "upper left", ...
  double farthest_radius = 0;            ///< of a corner used, as a part of half the picture's diagonal
};

/// Everything that the report tells.
struct CalibrationReport {
  const Calibration* calibration = nullptr;
  const CalibrationInput* input = nullptr;
  std::vector<SensorSummary> sensors;
  std::vector<AccuracyMap> accuracy;
  double left_out_rms_px = 0;  ///< over all poses; NaN: not asked for
  VerdictLevel level = VerdictLevel::good;
  std::string headline, advice;
  std::vector<std::string> remarks;  ///< worst first
  std::string title, program;
  std::vector<OptionValue> options;
};

/// Sums a calibration up and judges it in plain words.
CalibrationReport judge_calibration(const CalibrationInput& input, const Calibration& calibration,
                                    std::vector<AccuracyMap> accuracy);

/// What it says in a terminal.
std::string format_calibration_text(const CalibrationReport& report);

/// {"format": "pagesweep-calibration", "version": 1, ...}: docs/formats.md, "Calibration".
std::string format_calibration_json(const CalibrationReport& report);

/// Writes folder / "report.html" (one self-contained page) and then folder / "report.json".
/// \throws Error  if a file cannot be written
void write_calibration_report(const std::filesystem::path& folder, const CalibrationReport& report);

/// Rms of the lengths of a sensor's errors over its corners in use [px].
double reprojection_rms(const Bundle& bundle, int sensor);

}  // namespace pagesweep
