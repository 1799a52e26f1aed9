// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/calibration/calibrate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <map>

#include "pagesweep/base/error.h"
#include "pagesweep/calibration/accuracy.h"
#include "pagesweep/calibration/simulated_corners_testing.h"

namespace pagesweep {
namespace {

using test::SimulatedCorners, test::simulated_rig;
using testing::AllOf, testing::HasSubstr;

std::string complaint(const CalibrationInput& input, const CalibrationOptions& options = {}) {
  try {
    calibrate(input, options);
  } catch (const Error& e) {
    return e.what();
  }
  return "";
}

double rms(const Calibration& calibration, int sensor) {
  double squares = 0;
  int count = 0;
  for (const Observation& seen : calibration.bundle.observations)
    if (seen.sensor == sensor && seen.used) squares += calibration.bundle.residual(seen).squaredNorm(), ++count;
  return std::sqrt(squares / count);
}

TEST(Calibrate, WhatIsLeftIsTheNoise) {
  const SimulatedCorners corners{.rig = simulated_rig(ScannerModel::pushbroom)};
  const Calibration calibration = calibrate(corners.input(1), {.scanner_model = ScannerModelChoice::pushbroom});
  // Two coordinates; about 150 parameters take their share of 5700 coordinates.
  for (int sensor = 0; sensor < 3; ++sensor) EXPECT_NEAR(rms(calibration, sensor), 0.05 * std::sqrt(2.0), 0.003);
  // A median of 960 lengths is known to 2.5 %, and unit_sigma makes up for the mean of the three.
  for (const Sensor& sensor : calibration.bundle.sensors)
    EXPECT_NEAR(calibration.solution.unit_sigma * sensor.sigma_px, 0.05, 0.005);
}

TEST(Calibrate, TheScannersModelIsChosenByPredictionOfPosesLeftOut) {
  for (const ScannerModel model : {ScannerModel::brown_conrady, ScannerModel::pushbroom, ScannerModel::rotating_line}) {
    SimulatedCorners corners{.rig = simulated_rig(model)};
    corners.poses.resize(10);
    const Calibration calibration = calibrate(corners.input(2), {});
    ASSERT_EQ(calibration.trials.size(), 3u);
    for (const ScannerTrial& trial : calibration.trials) {
      EXPECT_EQ(trial.chosen, trial.model == model) << name_of(trial.model) << " for " << name_of(model);
      // Poses come from cameras with 0.45 mm a pixel and the same noise: a share of theirs adds to the scan's own.
      if (trial.chosen) {
        EXPECT_LT(trial.rms_px, 3 * 0.05 * std::sqrt(2.0));
      }
    }
  }
}

TEST(Calibrate, TheRigFrameIsTheTableWithTheSweepAlongY) {
  SimulatedCorners corners{.rig = simulated_rig(ScannerModel::pushbroom)};
  corners.noise_px = 1e-4;
  const Calibration with_scanner =
      calibrate(corners.input(3), {.scanner_model = ScannerModelChoice::pushbroom, .board_thickness_mm = 3});
  for (const Camera& camera : with_scanner.rig.cameras) EXPECT_NEAR(camera.center().z(), 645 + 3, 0.1);
  // The first pose lies in the middle of the true table, and true rows count along -y.
  EXPECT_NEAR(with_scanner.rig.cameras[0].center().y(), 200, 1);
  const Pushbroom& line = std::get<Pushbroom>(with_scanner.rig.scanner->model());
  EXPECT_GT(line.step.y(), 0);
  EXPECT_NEAR(line.step.x(), 0, 2e-3 * line.step.y());
  corners.rig.scanner.reset();
  const Calibration cameras_alone = calibrate(corners.input(3), {});
  EXPECT_NEAR(cameras_alone.rig.cameras[0].center().y(), -200, 1) << "from the first to the second camera";
  EXPECT_NEAR(cameras_alone.rig.cameras[1].center().y(), 200, 1);
  const Calibration third = calibrate(corners.input(3), {.table_pose = "pose3"});
  EXPECT_EQ(third.table_pose, 2);
}

TEST(Calibrate, TheRigsYIsTheWayTheLightGoes) {
  SimulatedCorners corners{.rig = simulated_rig()};
  corners.noise_px = 1e-4;
  CalibrationInput input = corners.input(3);
  // Over the first board, which lies flat, the light goes along -x and a little y of the board; a tilted one has less
  // say.
  const Eigen::Vector2d way = Eigen::Vector2d(-1, 0.1).normalized();
  input.light_directions = {{4, Eigen::Vector2d(0, 1)}, {0, way}};
  const Calibration calibration = calibrate(input, {});
  const Eigen::Vector3d seen = calibration.bundle.rig_from_board[0].rotation.leftCols<2>() * way;
  EXPECT_NEAR((seen - Eigen::Vector3d::UnitY()).norm(), 0, 1e-6);
}

/// The last step of a calibration, from the truth as start values: the frame is the true pose of the first board.
Calibration adjust_in_true_frame(const SimulatedCorners& corners, unsigned seed) {
  const CalibrationInput input = corners.input(seed);
  Calibration c;
  c.bundle = {corners.board, {}, {}, corners.poses, std::vector<bool>(corners.poses.size(), false), {}};
  c.bundle.pose_is_held[0] = true;
  for (const Camera& camera : corners.rig.cameras) c.bundle.sensors.push_back({camera.name, camera, corners.noise_px});
  if (corners.rig.scanner) c.bundle.sensors.push_back({"scanner", corners.rig.scanner->model(), corners.noise_px});
  for (std::size_t k = 0; k < input.sensors.size(); ++k)
    for (const BoardPicture& picture : input.sensors[k].pictures)
      for (const BoardCorner& corner : picture.view.corners)
        c.bundle.observations.push_back({int(k), picture.pose, corner.number, corner.pixel});
  c.solution = solve(c.bundle, {LensModel::full, false, false, 0, true});
  for (std::size_t k = 0; k < 2; ++k) c.rig.cameras.push_back(std::get<Camera>(c.bundle.sensors[k].model));
  return c;
}

TEST(Calibrate, ClaimedStandardDeviationsAreThoseOfFiftyCalibrations) {
  SimulatedCorners corners{.rig = simulated_rig(ScannerModel::pushbroom)};
  corners.board = {.columns = 6, .rows = 5, .square_mm = 40, .marker_mm = 30};
  corners.poses = sim::board_poses(corners.board.size_mm(), {160, 100}, 60, 14, 7);
  constexpr int runs = 50;
  std::map<std::string, std::vector<double>> values;
  std::map<std::string, double> claimed;
  for (int run = 0; run < runs; ++run) {
    const Calibration c = adjust_in_true_frame(corners, 100 + unsigned(run));
    for (std::size_t k = 0; k < c.solution.parameters.size(); ++k) {
      const Parameter& p = c.solution.parameters[k];
      if (p.owner.starts_with("pose")) continue;
      values[p.owner + "." + p.name].push_back(p.value);
      claimed[p.owner + "." + p.name] += c.solution.covariance(Eigen::Index(k), Eigen::Index(k)) / runs;
    }
  }
  double mean_ratio = 0;
  for (const auto& [name, list] : values) {
    double mean = 0, scatter = 0;
    for (const double value : list) mean += value / runs;
    for (const double value : list) scatter += (value - mean) * (value - mean) / (runs - 1);
    const double ratio = std::sqrt(claimed[name] / scatter);
    mean_ratio += ratio / double(values.size());
    // A standard deviation from 50 runs is known to 10 %; three of these among 42 parameters.
    EXPECT_NEAR(ratio, 1, 0.35) << name;
  }
  EXPECT_NEAR(mean_ratio, 1, 0.1);
}

TEST(Calibrate, PredictedAccuracyIsWhatTriangulationScattersBy) {
  SimulatedCorners corners{.rig = simulated_rig()};
  corners.board = {.columns = 6, .rows = 5, .square_mm = 40, .marker_mm = 30};
  corners.poses.resize(12);
  const std::array<double, 1> heights{30};
  const Eigen::Vector3d place(40, -30, 30);
  constexpr int runs = 40;
  double claimed = 0, scatter = 0;
  for (int run = 0; run < runs; ++run) {
    const Calibration c = adjust_in_true_frame(corners, 300 + unsigned(run));
    const AccuracyMap map = predict_accuracy(c, heights).at(0);
    const Eigen::Vector2d cell = (place.head<2>() - map.low_mm) / map.spacing_mm;
    claimed += std::pow(map.point_mm(int(std::lround(cell.x())), int(std::lround(cell.y()))), 2) / runs;
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k < 2; ++k) {
      const Ray ray = *c.rig.cameras[k].ray(*corners.rig.cameras[k].project(place));
      const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - ray.direction * ray.direction.transpose();
      normal += across, right += across * ray.origin;
    }
    scatter += (Eigen::Vector3d(normal.ldlt().solve(right)) - place).squaredNorm() / runs;
  }
  EXPECT_NEAR(std::sqrt(claimed / scatter), 1, 0.25) << "40 runs of three coordinates that go together tell 10 %";
}

TEST(Calibrate, MisreadCornersAreLeftOutAndListed) {
  const SimulatedCorners corners{.rig = simulated_rig()};
  CalibrationInput input = corners.input(4);
  for (int k = 0; k < 12; ++k)
    input.sensors[0].pictures[std::size_t(k)].view.corners[std::size_t(3 * k)].pixel.x() += 2 + k;
  const Calibration calibration = calibrate(input, {});
  int wrong = 0, out = 0;
  for (const Observation& seen : calibration.bundle.observations) {
    if (seen.used) continue;
    ++out;
    wrong += seen.sensor == 0 && seen.pose < 12;
  }
  EXPECT_GE(wrong, 12);
  EXPECT_LE(out, 14) << "five standard deviations leave 4e-6 of the good ones out";
  EXPECT_NEAR(rms(calibration, 0), 0.05 * std::sqrt(2.0), 0.004);
}

TEST(Calibrate, APoseLeftOutIsPredictedAlmostAsWell) {
  const SimulatedCorners corners{.rig = simulated_rig()};
  const Calibration calibration = calibrate(corners.input(5), {.cross_validate = true});
  ASSERT_EQ(calibration.left_out_px.size(), 20u);
  for (const double px : calibration.left_out_px) EXPECT_NEAR(px, 0.05 * std::sqrt(2.0), 0.02);
}

TEST(Calibrate, BadPicturesAreAnErrorThatNamesTheCause) {
  const SimulatedCorners corners{.rig = simulated_rig(ScannerModel::pushbroom)};
  const CalibrationInput sound = corners.input(6);

  CalibrationInput one = sound;
  for (auto& sensor : one.sensors) sensor.pictures.resize(1);
  EXPECT_THAT(complaint(one), AllOf(HasSubstr("cam1"), HasSubstr("only one picture"), HasSubstr("15 to 20")));

  SimulatedCorners parallel = corners;
  for (std::size_t k = 0; k < parallel.poses.size(); ++k) {
    parallel.poses[k].rotation = parallel.poses[0].rotation;
    parallel.poses[k].translation =
        parallel.poses[0].translation + Eigen::Vector3d(5.0 * double(k % 4), 4.0 * double(k / 4), 3.0 * double(k));
  }
  EXPECT_THAT(complaint(parallel.input(6)), AllOf(HasSubstr("parallel"), HasSubstr("tilt the board")));

  CalibrationInput swapped = sound;
  for (const std::size_t k : {4u, 9u})
    std::swap(swapped.sensors[0].pictures[k].view, swapped.sensors[1].pictures[k].view);
  EXPECT_THAT(complaint(swapped), AllOf(HasSubstr("cam1 and cam2 are swapped"), HasSubstr("'pose5', 'pose10'")));

  CalibrationInput shifted = sound;  // somebody lost one picture of the second camera and renumbered the rest
  auto& pictures = shifted.sensors[1].pictures;
  std::rotate(pictures.begin(), pictures.begin() + 1, pictures.end());
  for (std::size_t k = 0; k < pictures.size(); ++k) pictures[k].pose = int(k);
  EXPECT_THAT(complaint(shifted), HasSubstr("contradict"));

  CalibrationInput mirrored = sound;
  for (auto& picture : mirrored.sensors[2].pictures)
    for (auto& corner : picture.view.corners) corner.pixel.x() = mirrored.sensors[2].width - 1 - corner.pixel.x();
  EXPECT_THAT(complaint(mirrored), AllOf(HasSubstr("scanner"), HasSubstr("mirrored")));
}

}  // namespace
}  // namespace pagesweep
