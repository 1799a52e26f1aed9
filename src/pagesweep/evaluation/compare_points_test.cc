// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/evaluation/compare_points.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "pagesweep/sim/analytic_scene.h"

namespace pagesweep {
namespace {

/// Both cameras' view of a page 200 mm x 160 mm, gently waved, on a table that is no page.
struct Scene {
  sim::AnalyticScene surface{.height = [](double x, double y) {
    return std::abs(x) < 100 && std::abs(y) < 80 ? 20 + 8 * std::sin(x / 40) : NAN;
  }};
  Rig rig = sim::make_test_rig(160);
  std::vector<PointMap> points;
  std::vector<TruePoints> truth;

  explicit Scene(double sigma_mm = 0.05) {
    for (const Camera& camera : rig.cameras) {
      points.push_back(surface.points(camera, sigma_mm));
      TruePoints& true_points = truth.emplace_back(camera.width, camera.height);
      for (int y = 0; y < camera.height; ++y)
        for (int x = 0; x < camera.width; ++x)
          true_points(x, y) = {points.back().x(x, y), points.back().y(x, y), points.back().z(x, y)};
    }
  }
  std::vector<MeasuredView> views() const {
    return {{&rig.cameras[0], &points[0], &truth[0]}, {&rig.cameras[1], &points[1], &truth[1]}};
  }
  /// Moves a measured point along its viewing ray, towards the camera.
  void move(std::size_t camera, int x, int y, double distance_mm) {
    PointMap& map = points[camera];
    const Eigen::Vector3d p(map.x(x, y), map.y(x, y), map.z(x, y));
    const Eigen::Vector3d moved = p + distance_mm * (rig.cameras[camera].center() - p).normalized();
    map.x(x, y) = static_cast<float>(moved.x());
    map.y(x, y) = static_cast<float>(moved.y());
    map.z(x, y) = static_cast<float>(moved.z());
  }
  void add_noise(double sigma_mm) {
    for (std::size_t c = 0; c < 2; ++c) {
      std::mt19937 random(static_cast<unsigned>(c));
      std::normal_distribution<double> noise(0, sigma_mm);
      for (int y = 0; y < points[c].height(); ++y)
        for (int x = 0; x < points[c].width(); ++x)
          if (points[c].status(x, y) == PixelStatus::ok) move(c, x, y, noise(random));
    }
  }
};

TEST(ComparePoints, FindsNoErrorInTheTruth) {
  const Scene scene;
  const PointComparison comparison = compare_points(scene.views());
  ASSERT_EQ(comparison.cameras.size(), 2u);
  EXPECT_GT(comparison.all.page_pixels, 7000u);
  EXPECT_LT(comparison.all.distance.max, 1e-6);
  EXPECT_EQ(comparison.all.completeness(), 1);
  EXPECT_EQ(comparison.all.false_points, 0u);
  // Nothing hides anything here and both pictures hold the whole page; but the other camera's nearest pixel may miss
  // the page's rim, which is 350 pixels of 7700 here.
  EXPECT_GT(comparison.all.seen_by_both, 0.955 * static_cast<double>(comparison.all.page_pixels));
}

TEST(ComparePoints, TurnsNoiseAlongTheRayIntoItsKnownSize) {
  Scene scene(0.05);
  scene.add_noise(0.1);
  const PointErrors errors = compare_points(scene.views()).all;
  // The standard deviation of an rms of n values is 0.7 / sqrt(n) of it: below 1 % from 5000 values on.
  EXPECT_NEAR(errors.along_ray.rms, 0.1, 0.003);
  EXPECT_NEAR(errors.normalised.rms, 2, 0.06) << "the points claim half of their error";
  EXPECT_NEAR(errors.error_over_claim(), 2, 0.06);
  EXPECT_LT(errors.distance.rms, errors.along_ray.rms) << "the surface is seen at an angle";
  EXPECT_NEAR(errors.distance.bias, 0, 0.005);
  EXPECT_NEAR(errors.along_ray.p95 / errors.along_ray.rms, 1.96, 0.06) << "Gaussian";
}

TEST(ComparePoints, PerpendicularDistanceOfATiltedSheet) {
  Scene scene;
  const Eigen::Vector3d center = scene.rig.cameras[0].center();
  int x = 80, y = 80;
  const Eigen::Vector3d point = scene.truth[0](x, y).cast<double>();
  // z = 20 + 8 sin(x / 40): its normal, by hand.
  const Eigen::Vector3d normal = Eigen::Vector3d(-0.2 * std::cos(point.x() / 40), 0, 1).normalized();
  EXPECT_LT((true_normal(scene.truth[0], x, y, center) - normal).norm(), 1e-3);
  scene.move(0, x, y, -3);
  const auto comparison = compare_points(scene.views());
  EXPECT_NEAR(comparison.error_maps[0](x, y), -3 * normal.dot((center - point).normalized()), 3e-3);
  EXPECT_NEAR(comparison.all.along_ray.max, 3, 1e-4);
}

TEST(ComparePoints, CountsWhatIsMissingAndWhatIsFalse) {
  Scene scene;
  PointMap& first = scene.points[0];
  std::size_t lost = 0;
  for (int y = 70; y < 80; ++y)
    for (int x = 70; x < 90; ++x) {
      ASSERT_EQ(first.status(x, y), PixelStatus::ok);
      first.status(x, y) = PixelStatus::no_match;
      first.x(x, y) = first.y(x, y) = first.z(x, y) = not_a_number;
      ++lost;
    }
  ASSERT_FALSE(scene.truth[0](0, 0).allFinite());
  first.status(0, 0) = PixelStatus::ok;
  first.x(0, 0) = first.y(0, 0) = first.z(0, 0) = 1000;
  const PointComparison comparison = compare_points(scene.views());
  const PointErrors& errors = comparison.cameras[0];
  EXPECT_EQ(errors.missing[static_cast<std::size_t>(PixelStatus::no_match)], lost);
  EXPECT_EQ(errors.measured + lost, errors.page_pixels);
  EXPECT_EQ(errors.false_points, 1u);
  EXPECT_LT(errors.distance.max, 1e-6) << "a false point is no error of the page's points";
  EXPECT_EQ(comparison.cameras[1].completeness(), 1);
  EXPECT_TRUE(std::isnan(comparison.error_maps[0](75, 75)));
}

TEST(ComparePoints, KnowsWhatTheOtherCameraCannotSee) {
  // A wall across the table hides from each camera what is right behind it. Camera 2 at y = 200, z = 640 looks over the
  // wall's upper edge (y = 2, z = 50) and sees the table behind it from y = 2 - 50 * 198 / 590 = -14.8 on.
  Scene scene;
  scene.surface.height = [](double x, double y) {
    return std::abs(x) < 100 && std::abs(y) < 80 ? (std::abs(y) < 2 ? 50.0 : 0.0) : NAN;
  };
  std::size_t hidden = 0, seen = 0;
  for (std::size_t c = 0; c < 2; ++c) {
    PointMap& map = scene.points[c] = scene.surface.points(scene.rig.cameras[c]);
    for (int y = 0; y < 160; ++y)
      for (int x = 0; x < 160; ++x) {
        scene.truth[c](x, y) = {map.x(x, y), map.y(x, y), map.z(x, y)};
        const bool is_hidden = map.z(x, y) < 1 && std::abs(map.y(x, y) + 8) < 4;
        const bool is_seen = map.z(x, y) < 1 && std::abs(map.y(x, y) + 40) < 10 && std::abs(map.x(x, y)) < 90;
        if (c != 0 || !(is_hidden || is_seen)) continue;
        hidden += is_hidden;
        seen += is_seen;
        map.status(x, y) = is_hidden ? PixelStatus::rays_miss : PixelStatus::no_match;
      }
  }
  const PointErrors errors = compare_points(scene.views()).cameras[0];
  EXPECT_GT(hidden, 100u);
  EXPECT_EQ(errors.missing[static_cast<std::size_t>(PixelStatus::rays_miss)], 0u);
  EXPECT_EQ(errors.missing[static_cast<std::size_t>(PixelStatus::no_match)], seen);
  EXPECT_EQ(errors.page_pixels - errors.measured, hidden + seen);
}

TEST(ComparePoints, LocalFitsAverageTheNoiseAway) {
  Scene scene;
  scene.surface.height = [](double x, double y) { return std::abs(x) < 100 && std::abs(y) < 80 ? 0.1 * x : NAN; };
  for (std::size_t c = 0; c < 2; ++c) {
    scene.points[c] = scene.surface.points(scene.rig.cameras[c]);
    for (int y = 0; y < 160; ++y)
      for (int x = 0; x < 160; ++x)
        scene.truth[c](x, y) = {scene.points[c].x(x, y), scene.points[c].y(x, y), scene.points[c].z(x, y)};
  }
  scene.add_noise(0.1);
  scene.move(0, 80, 80, 20);  // one outlier that a fit without robust weights would follow by more than 1 mm
  const PointComparisonOptions wide{.neighbourhood_mm = 30};
  const PointErrors errors = compare_points(scene.views(), wide).all;
  // Pixels are 2.7 mm apart: about 90 points in a disk of 30 mm. A plane's height in the middle of n points has the
  // standard deviation sigma / sqrt(n).
  EXPECT_GT(errors.fitted.count, 500u);
  EXPECT_NEAR(errors.fitted.rms, 0.1 / std::sqrt(90.0), 0.003);
  // A quadric's height in the middle of a disk of n points has twice that: its second-order terms must be told apart
  // from it (variance 4 / n for evenly spread points).
  const PointComparisonOptions curved{.neighbourhood_mm = 30, .local_fit = LocalFit::quadric};
  EXPECT_NEAR(compare_points(scene.views(), curved).all.fitted.rms, 2 * 0.1 / std::sqrt(90.0), 0.005);
}

TEST(ComparePoints, NothingMeasuredIsCountedNotAnError) {
  Scene scene;
  for (PointMap& map : scene.points) map = PointMap(map.width(), map.height());
  const PointErrors errors = compare_points(scene.views()).all;
  EXPECT_EQ(errors.completeness(), 0);
  EXPECT_EQ(errors.missing[static_cast<std::size_t>(PixelStatus::not_computed)], errors.seen_by_both);
  EXPECT_TRUE(std::isnan(errors.distance.rms));

  for (TruePoints& truth : scene.truth) truth = TruePoints(160, 160, Eigen::Vector3f::Constant(not_a_number));
  EXPECT_TRUE(std::isnan(compare_points(scene.views()).all.completeness())) << "there is no page";
}

TEST(ComparePoints, RefusesWhatDoesNotFit) {
  Scene scene;
  auto views = scene.views();
  views[1].truth = nullptr;
  EXPECT_THROW(compare_points(views), std::invalid_argument);
  const TruePoints small(3, 3);
  views[1].truth = &small;
  EXPECT_THROW(compare_points(views), std::invalid_argument);
}

TEST(CompareCloud, AgreesWithThePixelwiseComparison) {
  Scene scene(0.1);
  scene.add_noise(0.1);
  std::vector<Eigen::Vector3f> cloud;
  std::vector<float> sigma;
  for (const PointMap& map : scene.points)
    for (int y = 0; y < map.height(); ++y)
      for (int x = 0; x < map.width(); ++x)
        if (map.status(x, y) == PixelStatus::ok) {
          cloud.push_back({map.x(x, y), map.y(x, y), map.z(x, y)});
          sigma.push_back(map.sigma(x, y));
        }
  cloud.push_back({130, 0, 0});  // beside the page
  sigma.push_back(0.1f);
  const PointErrors pixelwise = compare_points(scene.views()).all;
  const PointErrors errors = compare_cloud(cloud, sigma, scene.views());
  // A point is judged by the camera that excuses it most, and pixels are nearly 3 mm wide here.
  EXPECT_NEAR(errors.distance.rms, pixelwise.distance.rms, 0.05 * pixelwise.distance.rms);
  EXPECT_EQ(errors.distance.count, pixelwise.distance.count);
  EXPECT_EQ(errors.false_points, 1u);
}

}  // namespace
}  // namespace pagesweep
