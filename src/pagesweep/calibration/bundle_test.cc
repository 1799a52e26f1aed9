// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/calibration/bundle.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "pagesweep/calibration/simulated_corners_testing.h"

namespace pagesweep {
namespace {

constexpr std::array all_models{ScannerModel::brown_conrady, ScannerModel::pushbroom, ScannerModel::rotating_line};

Bundle bundle_of(ScannerModel model) {
  Bundle bundle{test::small_board(), {}, {}, {}, {}, {}};
  bundle.sensors.push_back({"sensor", sim::make_skewed_scanner(model, 100).model()});
  bundle.rig_from_board = sim::board_poses(bundle.board.size_mm(), {160, 100}, 60, 6, 11);
  bundle.pose_is_held.assign(bundle.rig_from_board.size(), false);
  return bundle;
}

TEST(Bundle, PredictsWhatTheCamerasOfThisProjectSee) {
  for (const ScannerModel model : all_models) {
    const Bundle bundle = bundle_of(model);
    const Scanner witness(bundle.sensors[0].model);
    for (int pose = 0; pose < 6; ++pose)
      for (int corner = 0; corner < bundle.board.corner_count(); ++corner) {
        const Eigen::Vector3d point =
            bundle.rig_from_board[std::size_t(pose)] * bundle.shape.corner_mm(bundle.board, corner);
        EXPECT_LT((*bundle.predict(0, pose, corner) - *witness.project(point)).norm(), 1e-8) << name_of(model);
      }
  }
}

TEST(Bundle, MovingASensorAndAPointTogetherChangesNothing) {
  for (const ScannerModel model : all_models) {
    const Scanner scanner = sim::make_skewed_scanner(model, 100);
    const Eigen::Vector3d point(30, -40, 20);
    const Eigen::MatrixXd by_parameters = parameter_jacobian(scanner.model(), point);
    ASSERT_EQ(by_parameters.cols(), Eigen::Index(parameter_names(scanner.model()).size()));
    EXPECT_LT((by_parameters.rightCols<3>() + scanner.project_jacobian(point)).cwiseAbs().maxCoeff(), 1e-5)
        << name_of(model);
  }
}

TEST(Bundle, TheMiddleOfACirclesPictureIsPredicted) {
  Bundle bundle = bundle_of(ScannerModel::brown_conrady);
  bundle.board = {.type = BoardType::circles, .columns = 4, .rows = 5, .square_mm = 30, .marker_mm = 28};
  const Scanner camera(bundle.sensors[0].model);
  for (int pose = 0; pose < 6; ++pose) {
    // The ellipse's middle is that of the box around it.
    const Eigen::Vector2d middle = bundle.board.corner_mm(9);
    Eigen::AlignedBox2d box;
    for (int k = 0; k < 20000; ++k) {
      const double angle = k * 2 * M_PI / 20000;
      box.extend(
          *camera.project(bundle.rig_from_board[std::size_t(pose)] *
                          Eigen::Vector3d(middle.x() + 14 * std::cos(angle), middle.y() + 14 * std::sin(angle), 0)));
    }
    const Eigen::Vector2d picture_of_middle =
        *camera.project(bundle.rig_from_board[std::size_t(pose)] * Eigen::Vector3d(middle.x(), middle.y(), 0));
    // Fourth-order terms are left out, a tenth of the second order's where a circle is 4 % of the distance wide.
    EXPECT_LT((*bundle.predict(0, pose, 9) - box.center()).norm(),
              0.005 + 0.1 * (picture_of_middle - box.center()).norm());
  }
}

TEST(Bundle, UnflatnessAndStretchAreFound) {
  test::SimulatedCorners corners{.rig = test::simulated_rig()};
  corners.noise_px = 0.02;
  const CalibrationInput input = corners.input(5);
  Bundle truth{corners.board, {}, {}, corners.poses, std::vector<bool>(corners.poses.size(), false), {}};
  for (const Camera& camera : corners.rig.cameras) truth.sensors.push_back({camera.name, camera});
  truth.shape.stretch = 0.002;
  truth.shape.bend_mm = {0.4, -0.2, 0.3};
  std::mt19937_64 random(1);
  std::normal_distribution<double> noise(0, 0.02);
  for (int sensor = 0; sensor < 2; ++sensor)
    for (int pose = 0; pose < int(corners.poses.size()); ++pose)
      for (int corner = 0; corner < corners.board.corner_count(); ++corner)
        truth.observations.push_back(
            {sensor, pose, corner,
             *truth.predict(sensor, pose, corner) + Eigen::Vector2d(noise(random), noise(random))});
  Bundle found = truth;
  found.shape = {};
  found.sensors[0].pose_is_held = true;
  const BundleSolution solution = solve(found, {LensModel::full, true, true, 0, true});
  EXPECT_EQ(solution.problem, "");
  for (std::size_t k = 0; k < solution.parameters.size(); ++k) {
    if (solution.parameters[k].owner != "board") continue;
    const double sigma = std::sqrt(solution.covariance(Eigen::Index(k), Eigen::Index(k)));
    EXPECT_LT(sigma, 0.05) << solution.parameters[k].name;
  }
  EXPECT_NEAR(found.shape.stretch, truth.shape.stretch, 2e-4);
  for (int k = 0; k < BoardShape::bends; ++k)
    EXPECT_NEAR(found.shape.bend_mm[std::size_t(k)], truth.shape.bend_mm[std::size_t(k)], 0.05);
}

TEST(Bundle, AParameterThatNothingTellsIsNamed) {
  Bundle bundle = bundle_of(ScannerModel::brown_conrady);
  bundle.rig_from_board.resize(1), bundle.pose_is_held.assign(1, true);
  for (int corner = 0; corner < bundle.board.corner_count(); ++corner)
    bundle.observations.push_back({0, 0, corner, *bundle.predict(0, 0, corner)});
  // One view of a plane cannot tell fx, fy and the distance apart.
  const BundleSolution solution = solve(bundle, {LensModel::full, false, false, 0, true});
  EXPECT_NE(solution.problem, "");
}

}  // namespace
}  // namespace pagesweep
