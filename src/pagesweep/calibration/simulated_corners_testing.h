// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <random>
#include <string>

#include "pagesweep/calibration/calibrate.h"
#include "pagesweep/sim/board_series.h"
#include "pagesweep/sim/scene.h"

namespace pagesweep::test {

/// A board of A4's size with few corners, so that many calibrations are quick.
inline Board small_board() { return {.columns = 9, .rows = 7, .square_mm = 28, .marker_mm = 20}; }

/// The simulator's two cameras, and a scanner of 100 dpi if wanted.
inline Rig simulated_rig(std::optional<ScannerModel> scanner = std::nullopt) {
  Rig rig = sim::make_default_rig();
  rig.light.reset();
  rig.scanner.reset();
  if (scanner) rig.scanner = sim::make_skewed_scanner(*scanner, 100);
  return rig;
}

/// Corners as a perfect detector with Gaussian noise would find them, in poses as board_poses() lays them.
struct SimulatedCorners {
  Rig rig;
  Board board = small_board();
  std::vector<Rigid3> poses = sim::board_poses(board.size_mm(), {160, 100}, 60, 20, 7);
  double noise_px = 0.05;

  CalibrationInput input(unsigned seed) const {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> noise(0, noise_px);
    CalibrationInput input{board, {}, {}};
    for (std::size_t k = 0; k < poses.size(); ++k) input.poses.push_back("pose" + std::to_string(k + 1));
    const auto add = [&](const std::string& name, const Scanner& sensor, bool is_scanner) {
      SensorPictures& pictures = input.sensors.emplace_back();
      pictures.name = name, pictures.is_scanner = is_scanner;
      pictures.width = sensor.width(), pictures.height = sensor.height();
      for (std::size_t k = 0; k < poses.size(); ++k) {
        BoardPicture picture{int(k), name + "/" + input.poses[k] + ".png", {}};
        for (int corner = 0; corner < board.corner_count(); ++corner) {
          const auto pixel = sensor.project(
              poses[k] * Eigen::Vector3d(board.corner_mm(corner).homogeneous().cwiseProduct(Eigen::Vector3d(1, 1, 0))));
          const Eigen::Vector2d error(noise(random), noise(random));
          if (pixel && sensor.sees(*pixel)) picture.view.corners.push_back({corner, *pixel + error});
        }
        pictures.pictures.push_back(std::move(picture));
      }
    };
    for (const Camera& camera : rig.cameras) add(camera.name, Scanner(camera), false);
    if (rig.scanner) add("scanner", *rig.scanner, true);
    return input;
  }
};

}  // namespace pagesweep::test
