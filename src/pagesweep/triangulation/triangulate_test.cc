// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/triangulation/triangulate.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "pagesweep/sim/analytic_scene.h"
#include "pagesweep/triangulation/normals.h"

namespace pagesweep {
namespace {

using sim::AnalyticScene;

const AnalyticScene tilted{[](double x, double y) { return 25 + 0.15 * x - 0.1 * y; }};
const AnalyticScene cylinder{[](double x, double) { return 30 + 25 * std::cos(x / 60); }};
const AnalyticScene step{[](double x, double y) { return std::abs(x) < 40 && std::abs(y) < 45 ? 45.0 : 20.0; }};

Eigen::Vector3d point_at(const PointMap& points, int x, int y) {
  return {points.x(x, y), points.y(x, y), points.z(x, y)};
}

Eigen::Vector3d normal_at(const PointMap& points, int x, int y) {
  return {points.nx(x, y), points.ny(x, y), points.nz(x, y)};
}

class Triangulate : public testing::Test {
 protected:
  const Rig rig = sim::make_test_rig(160);
  const Camera& cam1 = rig.cameras[0];
  const Camera& cam2 = rig.cameras[1];
};

TEST_F(Triangulate, ExactMatchesGiveExactPoints) {
  for (const AnalyticScene* scene : {&tilted, &cylinder}) {
    const PointMap truth = scene->points(cam1);
    const PointMap points = triangulate(scene->correspondences(cam1, cam2), truth.intensity, cam1, cam2);
    int count = 0;
    for (int y = 0; y < points.height(); ++y)
      for (int x = 0; x < points.width(); ++x) {
        if (points.status(x, y) != PixelStatus::ok) continue;
        ++count;
        // Interpolated directions err by 2e-4 px of 2.5 mm; the rays meet at about 35 degrees.
        EXPECT_LT((point_at(points, x, y) - point_at(truth, x, y)).norm(), 2e-3);
        EXPECT_EQ(points.intensity(x, y), truth.intensity(x, y));
      }
    EXPECT_GT(count, 10000);
  }
}

TEST_F(Triangulate, SigmaIsTheSpreadAlongTheViewingRay) {
  const auto truth = cylinder.points(cam1);
  Correspondences matches = cylinder.correspondences(cam1, cam2);
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  for (int y = 0; y < matches.height(); ++y)
    for (int x = 0; x < matches.width(); ++x) {
      if (matches.status(x, y) != PixelStatus::ok) continue;
      // Moved along its epipolar curve by a known spread.
      const Eigen::Vector3d point = point_at(truth, x, y);
      const Eigen::Vector3d along = (point - cam1.center()).normalized();
      const Eigen::Vector2d here = *cam2.project(point), there = *cam2.project(point + along);
      const Eigen::Vector2d moved = here + 0.1 * normal(random) * (there - here).normalized();
      matches.u(x, y) = static_cast<float>(moved.x());
      matches.v(x, y) = static_cast<float>(moved.y());
      matches.sigma(x, y) = 0.1f;
    }
  const PointMap points = triangulate(matches, {}, cam1, cam2);
  double squares = 0, count = 0, off_ray = 0;
  for (int y = 0; y < points.height(); ++y)
    for (int x = 0; x < points.width(); ++x) {
      if (points.status(x, y) != PixelStatus::ok) continue;
      const Eigen::Vector3d error = point_at(points, x, y) - point_at(truth, x, y);
      const Eigen::Vector3d along = (point_at(truth, x, y) - cam1.center()).normalized();
      off_ray = std::max(off_ray, error.cross(along).norm());
      squares += std::pow(error.dot(along) / points.sigma(x, y), 2);
      ++count;
    }
  ASSERT_GT(count, 10000);
  EXPECT_LT(off_ray, 1e-3);  // a pixel's point stays on its viewing ray
  // With n samples the root mean square of unit normals scatters by 1 / sqrt(2 n) = 0.007.
  EXPECT_NEAR(std::sqrt(squares / count), 1, 0.05);
}

TEST_F(Triangulate, NormalsAreTheSurfaces) {
  for (const AnalyticScene* scene : {&tilted, &cylinder}) {
    const PointMap truth = scene->points(cam1);
    PointMap points = triangulate(scene->correspondences(cam1, cam2), {}, cam1, cam2);
    fit_normals(points, cam1);
    for (int y = 5; y < points.height() - 5; ++y)
      for (int x = 5; x < points.width() - 5; ++x) {
        if (points.status(x, y) != PixelStatus::ok) continue;
        // At the picture's rim only one half of the seven pixels, 8 mm of a cylinder of radius 144 mm, is there.
        EXPECT_GT(normal_at(points, x, y).dot(normal_at(truth, x, y)), std::cos(0.04)) << x << ", " << y;
      }
  }
}

TEST_F(Triangulate, NormalsBesideAnEdgeAreThoseOfTheirOwnSurface) {
  PointMap points = triangulate(step.correspondences(cam1, cam2), {}, cam1, cam2);
  fit_normals(points, cam1);
  int upright = 0, count = 0;
  for (int y = 0; y < points.height(); ++y)
    for (int x = 0; x < points.width(); ++x) {
      if (points.status(x, y) != PixelStatus::ok) continue;
      ++count;
      if (points.nz(x, y) > 0.99f) ++upright;
    }
  EXPECT_GT(upright, 0.93 * count);  // both levels are horizontal
}

TEST_F(Triangulate, APointFarOffItsNeighboursIsOffTheSurface) {
  Correspondences matches = tilted.correspondences(cam1, cam2);
  matches.v(80, 80) += 3;  // 30 standard deviations
  matches.sigma.pixels()[0] = 0.1f;
  PointMap points = triangulate(matches, {}, cam1, cam2);
  fit_normals(points, cam1);
  EXPECT_EQ(points.status(80, 80), PixelStatus::off_surface);
  EXPECT_TRUE(std::isnan(points.x(80, 80)));
  EXPECT_EQ(points.status(81, 80), PixelStatus::ok);
}

TEST_F(Triangulate, SaysWhyThereIsNoPoint) {
  Correspondences matches = tilted.correspondences(cam1, cam2);
  matches.status(70, 70) = PixelStatus::ambiguous;
  matches.u(80, 80) += 4;  // across the epipolar curve
  TriangulationOptions options;
  options.near_mm = 500;
  options.far_mm = 1;
  PointMap points = triangulate(matches, {}, cam1, cam2);
  EXPECT_EQ(points.status(70, 70), PixelStatus::ambiguous);
  EXPECT_EQ(points.status(80, 80), PixelStatus::rays_miss);
  points = triangulate(matches, {}, cam1, cam2, options);
  EXPECT_EQ(points.status(60, 60), PixelStatus::outside_depth);
  EXPECT_TRUE(std::isnan(points.z(60, 60)));
}

TEST_F(Triangulate, RaysThatPartDoNotMeet) {
  // Both cameras look straight down; the match asks cam2 to look away from cam1.
  Camera left = cam1, right = cam2;
  for (Camera* camera : {&left, &right}) {
    const Eigen::Vector3d center = camera->center();
    camera->cam_from_rig.rotation = Eigen::Vector3d(1, -1, -1).asDiagonal();
    camera->cam_from_rig.translation = -camera->cam_from_rig.rotation * center;
  }
  Correspondences matches(left.width, left.height);
  for (const int y : {20, 140}) {
    matches.status(80, y) = PixelStatus::ok;
    matches.u(80, y) = 80;
    matches.v(80, y) = static_cast<float>(160 - y);
    matches.sigma(80, y) = 0.1f;
  }
  const PointMap points = triangulate(matches, {}, left, right);
  EXPECT_EQ(points.status(80, 140), PixelStatus::rays_miss);
}

TEST_F(Triangulate, RefusesPicturesOfAnotherSize) {
  EXPECT_THROW(triangulate(Correspondences(10, 10), {}, cam1, cam2), std::invalid_argument);
  EXPECT_THROW(triangulate(Correspondences(160, 160), Image<float>(10, 160), cam1, cam2), std::invalid_argument);
}

}  // namespace
}  // namespace pagesweep
