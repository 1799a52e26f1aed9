// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/epipolar_curve.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "pagesweep/sim/analytic_scene.h"

namespace pagesweep {
namespace {

class EpipolarCurves : public testing::Test {
 protected:
  const Rig rig = sim::make_test_rig(200);
  const Camera& cam1 = rig.cameras[0];
  const Camera& cam2 = rig.cameras[1];
  const RayTable rays1{cam1}, rays2{cam2};
  const EpipolarGeometry geometry{rays1, rays2, {1 / 2000.0, 1 / 200.0}};

  /// The point of a pixel's viewing ray at an inverse depth.
  Eigen::Vector3d point(int x, int y, double w) const {
    const Eigen::Vector3d in_camera = rays1.direction(x, y).homogeneous() / w;
    return cam1.cam_from_rig.inverse() * in_camera;
  }
};

TEST_F(EpipolarCurves, PassThroughThePicturesOfTheRaysPoints) {
  std::mt19937 random(1);
  std::uniform_int_distribution<int> pixel(0, 199);
  std::uniform_real_distribution<double> depth(250, 1900);
  int seen = 0;
  for (int i = 0; i < 2000; ++i) {
    const int x = pixel(random), y = pixel(random);
    const double w = 1 / depth(random);
    const EpipolarCurve curve = geometry.curve(x, y);
    const auto expected = cam2.project(point(x, y, w));
    const bool visible = expected && cam2.sees(*expected);
    const auto found = curve.at(w);
    ASSERT_EQ(found.has_value(), visible);
    if (!visible) continue;
    ++seen;
    EXPECT_LT((*found - *expected).norm(), 1e-9);
    EXPECT_TRUE(curve.contains(w));  // clipping cuts off nothing that is seen
  }
  EXPECT_GT(seen, 500);
}

TEST_F(EpipolarCurves, SpeedIsThatOfThePicture) {
  for (int y = 20; y < 200; y += 40) {
    const EpipolarCurve curve = geometry.curve(100, y);
    const double w = 1 / 620.0, h = 1e-7;
    if (!curve.at(w)) continue;
    const double speed = (*curve.at(w + h) - *curve.at(w - h)).norm() / (2 * h);
    EXPECT_NEAR(curve.speed(w) / speed, 1, 0.06);  // the lens, taken as ideal, shrinks by up to 5 percent
  }
}

TEST_F(EpipolarCurves, SamplesLieOnTheCurveAPixelApart) {
  CurveSamples samples;
  int all = 0;
  for (int y = 10; y < 200; y += 30)
    for (int x = 10; x < 200; x += 30) {
      const EpipolarCurve curve = geometry.curve(x, y);
      sample(curve, samples);
      for (std::size_t i = 0; i < samples.u.size(); ++i) {
        const auto place = curve.at(samples.inverse_depth[i]);
        if (std::isnan(samples.u[i])) continue;
        ++all;
        const Eigen::Vector2d pixel(samples.u[i], samples.v[i]);
        // A fifth of the pixels of a real camera bend the curve five times as much within a stride.
        EXPECT_LT(place ? (*place - pixel).norm() : 0, 0.05);
        const bool first = i == 0 || std::isnan(samples.u[i - 1]);
        EXPECT_LT(first ? 0 : std::hypot(samples.u[i] - samples.u[i - 1], samples.v[i] - samples.v[i - 1]), 1.1);
      }
    }
  EXPECT_GT(all, 1000);
}

TEST_F(EpipolarCurves, AreEmptyWhereTheOtherCameraLooksAway) {
  Camera away = cam2;
  const Eigen::Vector3d center = cam2.center();
  away.cam_from_rig.rotation = Eigen::AngleAxisd(3, Eigen::Vector3d::UnitX()) * away.cam_from_rig.rotation;
  away.cam_from_rig.translation = -away.cam_from_rig.rotation * center;
  const RayTable rays(away);
  const EpipolarGeometry backwards(rays1, rays, {1 / 2000.0, 1 / 200.0});
  EXPECT_TRUE(backwards.curve(100, 100).range().empty());
}

}  // namespace
}  // namespace pagesweep
