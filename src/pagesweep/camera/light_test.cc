// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/camera/light.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <random>

namespace pagesweep {
namespace {

void expect_that_points_of_the_plane_have_its_time(const Light& light) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> time(0, 200), x(-200, 200), slope(-0.3, 0.3);
  for (int i = 0; i < 500; ++i) {
    const double t = time(random);
    const Plane plane = light.plane_at(t);
    EXPECT_NEAR(plane.normal.norm(), 1, 1e-12);
    const Ray ray{{x(random), 0, 700}, Eigen::Vector3d(slope(random), slope(random), -1).normalized()};
    const auto point = plane.meet(ray);
    if (!point || point->z() > 300) continue;  // the plane passes above the camera
    EXPECT_NEAR(plane.distance(*point), 0, 1e-9);
    ASSERT_TRUE(light.time_of(*point));
    EXPECT_NEAR(*light.time_of(*point), t, 1e-8);
  }
}

TEST(Light, TranslatingPlanePassesItsPointsAtItsTime) {
  expect_that_points_of_the_plane_have_its_time(
      Light(TranslatingPlane{Eigen::Vector3d(0.01, 1, 0.1).normalized(), -150, 1.5}));
}

TEST(Light, RotatingPlanePassesItsPointsAtItsTime) {
  // A mirror 600 mm above the table; normal0 is horizontal, so that the sheet hangs down.
  expect_that_points_of_the_plane_have_its_time(
      Light(RotatingPlane{{0, 10, 600}, Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), -0.25, 0.0025}));
}

Light recorded() {
  RecordedPlanes light{-20, {}};
  for (int i = -20; i < 230; ++i)
    light.planes.push_back({Eigen::Vector3d(0.01, 1, 1e-3 * i).normalized(), -150 + 1.5 * i + 0.2 * std::sin(0.2 * i)});
  return Light(light);
}

TEST(Light, RecordedPlanesPassTheirPointsAtTheirTimeAlsoBetweenFrames) {
  expect_that_points_of_the_plane_have_its_time(recorded());
}

TEST(Light, SpedUpItIsWhereItWasAtTheFasterTime) {
  const Light turning(RotatingPlane{{0, 10, 600}, Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), -0.25, 0.0025});
  const Light moving(TranslatingPlane{Eigen::Vector3d(0.01, 1, 0.1).normalized(), -150, 1.5});
  for (const Light& light : {turning, moving, recorded()}) {
    const Plane slow = light.plane_at(80), fast = light.sped_up(2).plane_at(40);
    EXPECT_LT((slow.normal - fast.normal).norm(), 1e-9);
    EXPECT_NEAR(slow.offset, fast.offset, 1e-9);
  }
}

TEST(Light, ALightThatStandsStillPassesNothing) {
  EXPECT_FALSE(Light(TranslatingPlane{Eigen::Vector3d::UnitY(), 0, 0}).time_of({0, 5, 0}));
}

TEST(Plane, IsMetOnlyInFrontOfTheRay) {
  const Plane plane{Eigen::Vector3d::UnitZ(), 0};
  EXPECT_TRUE(plane.meet({{0, 0, 5}, {0, 0, -1}}));
  EXPECT_FALSE(plane.meet({{0, 0, 5}, {0, 0, 1}}));
  EXPECT_FALSE(plane.meet({{0, 0, 5}, {1, 0, 0}}));
}

}  // namespace
}  // namespace pagesweep
