// SPDX-License-Identifier: Apache-2.0
// Real pictures, which are not part of the project: see docs/results.md.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "pagesweep/calibration/calibrate.h"
#include "pagesweep/io/image_file.h"

namespace pagesweep {
namespace {

namespace fs = std::filesystem;

fs::path pictures() {
  const char* given = std::getenv("PAGESWEEP_DATA");
  return fs::path(given ? given : PAGESWEEP_DATA) / "flir-charuco";
}

/// Every third pair, to be quick.
CalibrationInput read_pairs() {
  CalibrationInput input{Board{}, {}, {}};
  for (const char* name : {"cam1", "cam2"}) {
    SensorPictures& sensor = input.sensors.emplace_back();
    sensor.name = name;
    for (int k = 0; k < 5; ++k) {
      const std::string pose = "00000" + std::to_string(3 * k);
      const fs::path file = pictures() / name / (pose.substr(pose.size() - 6) + ".png");
      const auto image = std::get<Image<std::uint8_t>>(read_gray(file));
      sensor.width = image.width(), sensor.height = image.height();
      sensor.pictures.push_back({k, file.string(), detect_board(image.view(), input.board)});
      if (input.sensors.size() == 1) input.poses.push_back(pose);
    }
  }
  return input;
}

TEST(RealBoard, TheStatedAccuracyIsReached) {
  if (!fs::exists(pictures()))
    GTEST_SKIP() << pictures() << " is not there: set PAGESWEEP_DATA to the folder of real captures";
  const Calibration calibration = calibrate(read_pairs(), {});
  double squares = 0, used = 0;
  for (const Observation& seen : calibration.bundle.observations) {
    if (!seen.used) continue;
    squares += calibration.bundle.residual(seen).squaredNorm();
    ++used;
  }
  EXPECT_GT(used / double(calibration.bundle.observations.size()), 0.97);
  EXPECT_LT(std::sqrt(squares / used), 0.15);
}

}  // namespace
}  // namespace pagesweep
