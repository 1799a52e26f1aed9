// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/camera/scanner.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>
#include <string>

namespace pagesweep {
namespace {

Scanner make_pushbroom() {
  Pushbroom line{4961, 3508, 8268, 2480, -0.02, {}, {5, 148, 700}, {0.0003, -0.0847, 0.0001}};
  line.rotation =
      Eigen::Vector3d(1, -1, -1).asDiagonal() * Eigen::AngleAxisd(0.01, Eigen::Vector3d(1, 2, 3).normalized());
  return Scanner(line);
}

Scanner make_rotating_line() {
  RotatingLine line{4961, 3508, 8268, 2480, -0.02, {}, {5, -4, 700}, 0.21, -1.2e-4};
  line.rotation =
      Eigen::Vector3d(1, -1, -1).asDiagonal() * Eigen::AngleAxisd(0.02, Eigen::Vector3d(3, 1, 2).normalized());
  return Scanner(line);
}

Scanner make_frame_camera() {
  Camera camera{"scan", 4961, 3508, 8268, 8268, 2480, 1753.5, {-0.03, 0.01, 1e-4, 2e-4, 0}, {}};
  camera.cam_from_rig.rotation = Eigen::Vector3d(1, -1, -1).asDiagonal();
  camera.cam_from_rig.translation = {0, 0, 700};
  return Scanner(camera);
}

class ScannerModels : public testing::TestWithParam<std::pair<std::string, Scanner>> {};

TEST_P(ScannerModels, RayThenProjectionReturnsThePixel) {
  const Scanner& scanner = GetParam().second;
  std::mt19937 random(1);
  std::uniform_real_distribution<double> u(0, scanner.width() - 1), v(0, scanner.height() - 1), distance(500, 800);
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector2d pixel(u(random), v(random));
    const auto ray = scanner.ray(pixel);
    ASSERT_TRUE(ray);
    const auto back = scanner.project(ray->at(distance(random)));
    ASSERT_TRUE(back);
    EXPECT_LT((*back - pixel).norm(), 1e-7);
  }
}

TEST_P(ScannerModels, JacobianAgreesWithCentralDifferences) {
  const Scanner& scanner = GetParam().second;
  std::mt19937 random(2);
  std::uniform_real_distribution<double> x(-200, 200), y(-140, 140), z(-10, 90);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d point(x(random), y(random), z(random));
    const double h = 1e-3;
    Matrix23d numeric;
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d step = h * Eigen::Vector3d::Unit(axis);
      numeric.col(axis) = (*scanner.project(point + step) - *scanner.project(point - step)) / (2 * h);
    }
    EXPECT_LT((scanner.project_jacobian(point) - numeric).norm(), 1e-5);
  }
}

INSTANTIATE_TEST_SUITE_P(All, ScannerModels,
                         testing::Values(std::pair{"frame_camera", make_frame_camera()},
                                         std::pair{"pushbroom", make_pushbroom()},
                                         std::pair{"rotating_line", make_rotating_line()}),
                         [](const auto& model) { return model.param.first; });

TEST(Pushbroom, FollowsTheFormulaOfTheRigFile) {
  // A sensor 700 mm above the table that looks straight down and steps by 0.1 mm: worked by hand.
  Pushbroom line{1000, 2000, 7000, 500, 0.1, Eigen::Vector3d(1, -1, -1).asDiagonal(), {0, 100, 700}, {0, -0.1, 0}};
  const auto pixel = Scanner(line).project({35, 50, 0});
  ASSERT_TRUE(pixel);
  EXPECT_NEAR(pixel->y(), 500, 1e-9);
  EXPECT_NEAR(pixel->x(), 7000 * 0.05 * (1 + 0.1 * 0.0025) + 500, 1e-9);
}

TEST(RotatingLine, FollowsTheFormulaOfTheRigFile) {
  // Straight down at row 0, turned by 1 mrad a row: a point at tan(a) = 0.1 towards the camera's +y.
  RotatingLine line{1000, 2000, 7000, 500, 0, Eigen::Vector3d(1, -1, -1).asDiagonal(), {0, 0, 700}, 0, 1e-3};
  const auto pixel = Scanner(line).project({0, -70, 0});
  ASSERT_TRUE(pixel);
  EXPECT_NEAR(pixel->y(), 1000 * std::atan(0.1), 1e-9);
  EXPECT_NEAR(pixel->x(), 500, 1e-9);
}

TEST(Scanner, SeesNothingBehindItself) {
  EXPECT_FALSE(make_pushbroom().project({0, 0, 900}));
  EXPECT_FALSE(make_frame_camera().project({0, 0, 900}));
}

}  // namespace
}  // namespace pagesweep
