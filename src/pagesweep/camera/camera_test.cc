// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/camera/camera.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <random>

namespace pagesweep {
namespace {

Camera distorted_camera() {
  Camera camera{"cam1", 1024, 768, 1700, 1690, 511.5, 380, {-0.12, 0.05, 6e-4, -4e-4, 0.01}, {}};
  camera.cam_from_rig.rotation =
      (Eigen::AngleAxisd(3.0, Eigen::Vector3d::UnitX()) * Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitZ())).matrix();
  camera.cam_from_rig.translation = {12, -30, 700};
  return camera;
}

TEST(Camera, DistortsAsThePublishedFormulaOfOpenCv) {
  // Worked by hand: x = 0.1, y = -0.2, r2 = 0.05, k = (-0.1, 0.02, 0.5), p = (0.01, -0.02)
  // radial = 1 - 0.005 + 0.00005 + 0.0000625 = 0.9951125
  const BrownConrady lens{-0.1, 0.02, 0.01, -0.02, 0.5};
  const Eigen::Vector2d image = lens.distort({0.1, -0.2});
  EXPECT_NEAR(image.x(), 0.09951125 + 2 * 0.01 * 0.1 * -0.2 - 0.02 * (0.05 + 0.02), 1e-15);
  EXPECT_NEAR(image.y(), -0.1990225 + 0.01 * (0.05 + 0.08) + 2 * -0.02 * 0.1 * -0.2, 1e-15);
}

TEST(Camera, RayThenProjectionReturnsThePixel) {
  const Camera camera = distorted_camera();
  std::mt19937 random(1);
  std::uniform_real_distribution<double> u(0, 1023), v(0, 767), distance(100, 1500);
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector2d pixel(u(random), v(random));
    const auto ray = camera.ray(pixel);
    ASSERT_TRUE(ray);
    EXPECT_NEAR(ray->direction.norm(), 1, 1e-14);
    const auto back = camera.project(ray->at(distance(random)));
    ASSERT_TRUE(back);
    EXPECT_LT((*back - pixel).norm(), 1e-8);
  }
}

TEST(Camera, JacobianAgreesWithCentralDifferences) {
  const Camera camera = distorted_camera();
  std::mt19937 random(2);
  std::uniform_real_distribution<double> u(0, 1023), v(0, 767);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d point = camera.ray({u(random), v(random)})->at(650);
    const double h = 1e-3;
    Matrix23d numeric;
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d step = h * Eigen::Vector3d::Unit(axis);
      numeric.col(axis) = (*camera.project(point + step) - *camera.project(point - step)) / (2 * h);
    }
    EXPECT_LT((camera.project_jacobian(point) - numeric).norm(), 1e-6);
  }
}

TEST(Camera, SeesNothingBehindItself) {
  Camera camera = distorted_camera();
  camera.cam_from_rig = {};
  EXPECT_TRUE(camera.project({0, 0, 1}));
  EXPECT_FALSE(camera.project({0, 0, 0}));
  EXPECT_FALSE(camera.project({0, 0, -1}));
}

TEST(Camera, RefusesDirectionsBeyondTheFoldOfTheDistortion) {
  // r (1 - 0.5 r2) has its top at r2 = 2/3: farther out the picture would fold back onto itself.
  const BrownConrady lens{-0.5, 0, 0, 0, 0};
  EXPECT_TRUE(lens.is_valid_at(0.66));
  EXPECT_FALSE(lens.is_valid_at(0.67));
  Camera camera{"wide", 100, 100, 50, 50, 49.5, 49.5, lens, {}};
  EXPECT_TRUE(camera.project({0.80, 0, 1}));
  EXPECT_FALSE(camera.project({0.83, 0, 1}));
  EXPECT_FALSE(camera.ray({49.5 + 50 * 0.56, 49.5})) << "no direction is imaged farther out than 0.5443 f";
}

TEST(Camera, FindsAFoldBetweenTwoValidEnds) {
  const BrownConrady lens{-0.7, 0.3, 0, 0, 0};
  // slope = 1 - 2.1 q + 1.5 q^2: discriminant 4.41 - 6 < 0, valid everywhere
  EXPECT_TRUE(lens.is_valid_at(3));
  const BrownConrady folding{-1.0, 0.3, 0, 0, 0};
  // slope = 1 - 3 q + 1.5 q^2: negative between 0.42 and 1.58
  EXPECT_TRUE(folding.is_valid_at(0.4));
  EXPECT_FALSE(folding.is_valid_at(1.0));
  EXPECT_FALSE(folding.is_valid_at(3.0)) << "positive again out there, but the fold lies between";
}

TEST(Rigid3, ChainsAndInverts) {
  const Rigid3 a_from_b = distorted_camera().cam_from_rig;
  const Rigid3 identity = a_from_b * a_from_b.inverse();
  EXPECT_LT((identity.rotation - Eigen::Matrix3d::Identity()).norm(), 1e-14);
  EXPECT_LT(identity.translation.norm(), 1e-12);
}

}  // namespace
}  // namespace pagesweep
