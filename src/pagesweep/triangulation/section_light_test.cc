// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/triangulation/section_light.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "pagesweep/sim/analytic_scene.h"

namespace pagesweep {
namespace {

using sim::AnalyticScene;

const AnalyticScene cylinder{[](double x, double) { return 30 + 25 * std::cos(x / 60); }};

/// A sheet of light that swings about a line above the table.
Light swinging() {
  RotatingPlane plane;
  plane.axis_point = {0, -60, 700};
  plane.axis = Eigen::Vector3d(1, 0.05, 0).normalized();
  plane.normal0 = Eigen::Vector3d(-0.05, 1, 0).normalized();
  plane.angle0 = -0.3;
  plane.angle_per_frame = 0.003;
  return Light(plane);
}

class SectionLight : public testing::TestWithParam<bool> {
 protected:
  const Rig rig = sim::make_test_rig(128);
  const Camera& camera = rig.cameras[1];
  const Light light = GetParam() ? swinging() : *rig.light;
};

TEST_P(SectionLight, ExactTimesGiveExactPoints) {
  const PointMap truth = cylinder.points(camera);
  const TimeMap times = cylinder.times(camera, light);
  const PointMap points = section_light(times, camera, light);
  int count = 0;
  for (int y = 0; y < points.height(); ++y)
    for (int x = 0; x < points.width(); ++x) {
      if (points.status(x, y) != PixelStatus::ok) continue;
      ++count;
      const Eigen::Vector3d error(points.x(x, y) - truth.x(x, y), points.y(x, y) - truth.y(x, y),
                                  points.z(x, y) - truth.z(x, y));
      const double mm_per_frame = points.sigma(x, y) / times.sigma(x, y);
      EXPECT_LT(error.norm(), 1e-3 + 1e-5 * mm_per_frame);  // a time of up to 200 frames in single precision
    }
  EXPECT_GT(count, 5000);
}

TEST_P(SectionLight, SigmaIsTheSpreadAlongTheViewingRay) {
  const PointMap truth = cylinder.points(camera);
  TimeMap times = cylinder.times(camera, light, 0.03);
  std::mt19937 random(3);
  std::normal_distribution<float> normal(0, 0.03f);
  for (float& time : times.time.pixels()) time += normal(random);
  const PointMap points = section_light(times, camera, light);
  double squares = 0, count = 0;
  for (int y = 0; y < points.height(); ++y)
    for (int x = 0; x < points.width(); ++x) {
      if (points.status(x, y) != PixelStatus::ok) continue;
      const double error =
          std::hypot(points.x(x, y) - truth.x(x, y), points.y(x, y) - truth.y(x, y), points.z(x, y) - truth.z(x, y));
      squares += std::pow(error / points.sigma(x, y), 2);
      ++count;
    }
  ASSERT_GT(count, 5000);
  EXPECT_NEAR(std::sqrt(squares / count), 1, 0.05);
}

INSTANTIATE_TEST_SUITE_P(Lights, SectionLight, testing::Bool(),
                         [](const auto& test) { return test.param ? "swinging" : "travelling"; });

TEST(SectionLightStatus, SaysWhyThereIsNoPoint) {
  const Rig rig = sim::make_test_rig(32);
  TimeMap times(32, 32);
  times.status(1, 1) = PixelStatus::truncated;
  times.status(2, 2) = PixelStatus::ok;
  times.time(2, 2) = 100;
  times.sigma(2, 2) = 0.02f;
  // A sheet above the camera is behind all its rays.
  const Light above(TranslatingPlane{Eigen::Vector3d::UnitZ(), 800, 0.1});
  const PointMap points = section_light(times, rig.cameras[0], above);
  EXPECT_EQ(points.status(1, 1), PixelStatus::truncated);
  EXPECT_EQ(points.status(2, 2), PixelStatus::rays_miss);
  EXPECT_TRUE(std::isnan(points.x(2, 2)));
  EXPECT_THROW(section_light(TimeMap(3, 3), rig.cameras[0], above), std::invalid_argument);
}

}  // namespace
}  // namespace pagesweep
